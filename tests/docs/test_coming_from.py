"""Every row of the page for those who come from elsewhere holds: both sides on one state, or ours in closed form."""

import dataclasses
import pathlib
import re

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jounce as jn
from jounce.cli.file_kinds import kind_of
from jounce.constraints import catalogue
from jounce.mechanism.resolve import resolve_motion
from jounce.robot.closed_loops.closures import Loops
from tests.problems.closed_robots import FIVE_BAR, in_contact, in_pinocchio

ROOT = pathlib.Path(__file__).parents[2]
PAGE = ROOT / "docs" / "coming_from.md"
ROBOTS = ROOT / "examples" / "robots"
AXES = pin.LOCAL_WORLD_ALIGNED
LINK = "panda_link7"
TIME = np.array([0.0, 0.3, 0.7])
SLOW = set()
HELD = {}  # what checks a row, by its section and its left column


def row(section, there, slow=False):
    """Decorate what checks a row; slow where much is compiled for it."""

    def held(check):
        HELD[section, there] = check
        SLOW.update({(section, there)} if slow else ())
        return check

    return held


def rows():
    """Give section and both columns of all rows of the page."""
    section = ""
    for line in PAGE.read_text().splitlines():
        if line.startswith("## "):
            section = line.removeprefix("## From ")
        elif line.startswith("| ") and not line.startswith(("| there |", "|---")):
            there, here = re.split(r" \| ", line.strip("| "), maxsplit=1)
            yield section, there, here


def near(found, expected, tolerance=1e-12):
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * max(np.abs(expected).max(), 1.0))


# a crank of 2 kg with its mass 0.5 m out, about z, driven; and the same free


def crank(law="0.3*sin(2*t)", **more):
    return jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"crank": jn.Body([0, 0], mass=2.0, inertia=0.1, center_of_mass=[0.5, 0])},
        joints={"O": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])},
        outputs={"tip": jn.outputs.PointOutput("crank", [1.0, 0.0]), "angle": jn.outputs.AngleOutput("crank")},
        time=TIME,
        **({"drivers": {"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", law)}} if law else {}),
        **more,
    )


@pytest.fixture(scope="module")
def motion():
    return jn.solve(crank("a*sin(2*t)", parameters={"a": 0.3}), order=4)


@pytest.fixture(scope="module")
def fall():
    """The crank let go at 0.2 rad with 0.5 rad/s, slowed by dry friction of 0.4 N m."""
    start = {"start": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", "0.2 + 0.5*t")}
    friction = {"friction": jn.forces.Torque(("ground", "crank"), law="-0.4*sign(v)")}
    return jn.simulate(crank(None, initial=start, forces=friction), [0.0, 0.05], order=2)


ANGLE = np.stack([0.3 * np.sin(2 * TIME), 0.6 * np.cos(2 * TIME), -1.2 * np.sin(2 * TIME)])
TORQUE = 0.6 * ANGLE[2] + 2 * 9.81 * 0.5 * np.cos(ANGLE[0])

MATLAB = "MATLAB and Simscape Multibody"


@row(MATLAB, "Rigid Transform, Solid blocks")
def _(motion):
    near(motion.point("crank", [0.4, 0.1]).values[:, 0, 0], 0.4 * np.cos(ANGLE[0]) - 0.1 * np.sin(ANGLE[0]))


@row(MATLAB, "Revolute Joint, Prismatic Joint")
def _():
    for space, kinds in (("planar", jn.planar), ("spatial", jn.spatial)):
        found = catalogue(space, "joint")
        assert (found["revolute"], found["prismatic"]) == (kinds.Revolute, kinds.Prismatic)


@row(MATLAB, "Weld Joint")
def _():
    whole = jn.Inertia.total([jn.Inertia(1.0), jn.Inertia(1.0, center_of_mass=[2.0, 0, 0])])
    near(np.diag(whole.tensor), [0, 2.0, 2.0])
    near([whole.mass, *whole.center_of_mass], [2.0, 1.0, 0, 0])


@row(MATLAB, 'Motion actuation "Provided by Input"')
def _(motion):
    near(motion.outputs["angle"][:, :3].T, ANGLE)


@row(MATLAB, 'Torque "Automatically Computed"')
def _(motion):
    found = jn.driver_force(motion, "theta").values
    near(found[:, 0], TORQUE)
    near(found[:, 1], 0.6 * -2.4 * np.cos(2 * TIME) - 9.81 * np.sin(ANGLE[0]) * ANGLE[1])


@row(MATLAB, "joint state targets", slow=True)
def _(fall):
    near(fall.outputs["angle"][0, :2], [0.2, 0.5])


@row(MATLAB, "Transform Sensor")
def _(motion):
    near(motion.outputs["tip"][:, 0, 1], np.sin(ANGLE[0]))
    near(motion.point("crank", [1.0, 0.0]).values[..., 1], motion.outputs["tip"][..., 1])


@row(MATLAB, "a solver and its step size", slow=True)
def _(motion, fall):
    assert not hasattr(motion, "steps")
    assert fall.energy[1] < fall.energy[0]


@row(MATLAB, "`rigidBodyTree`, `inverseDynamics`")
def _(panda):
    near(jn.inverse_dynamics(panda.robot, panda.q, drives=False)[0], panda.rnea)


@row(MATLAB, "`gradient` of logged accelerations")
def _(motion):
    near(motion.outputs["angle"][:, 3], -2.4 * np.cos(2 * TIME))


@row(MATLAB, "`timeseries`")
def _(motion):
    near(motion.dataset["angle"].sel(derivative=1).values, ANGLE[1])


@row(MATLAB, "Mechanics Explorer")
def _():
    from jounce.cli.mechanism_commands.figures import plot
    from jounce.cli.viewing import view

    assert callable(view)
    assert "animation" in plot.__doc__


ADAMS = "Adams"


@row(ADAMS, "PART, MARKER")
def _(motion):
    near(motion.point("crank", [0.0, 1.0]).values[:, 0, 1], np.cos(ANGLE[0]))


@row(ADAMS, "JOINT, JPRIM")
def _():
    assert {"dot1", "dot2"} <= set(catalogue("spatial", "joint"))
    assert {"parallel1", "parallel2"} <= set(catalogue("planar", "joint"))


@row(ADAMS, "COUPLER, GEAR", slow=True)
def _():
    """With the arm at rest a wheel turns by the ratio; the frame body is the third."""
    wheels = {name: jn.Body([k, 0]) for k, name in enumerate(("sun", "planet"))}
    joints = {name: jn.planar.Revolute(("ground", name), [k, 0], [0, 0]) for k, name in enumerate(wheels)}
    joints["gear"] = jn.planar.Gear(("sun", "planet", "ground"), ratio=-2.0)
    turn = {"turn": jn.drivers.CoordinateDriver(("ground", "sun"), "angle", "3*t")}
    outputs = {name: jn.outputs.AngleOutput(name) for name in wheels}
    found = jn.solve(jn.Mechanism(space="planar", bodies=wheels, joints=joints, drivers=turn, outputs=outputs), TIME)
    assert abs(found.outputs["planet"][1, 1] / found.outputs["sun"][1, 1]) in (pytest.approx(2.0), pytest.approx(0.5))
    assert found.outputs["planet"][1, 1] < 0


row(ADAMS, "MOTION")(HELD[MATLAB, 'Motion actuation "Provided by Input"'])


@row(ADAMS, "SPRINGDAMPER, SFORCE, VFORCE", slow=True)
def _():
    """A damped spring, a law of the angle and a force with components, each on a crank that stands at 0.25 rad."""
    forces = {
        "spring": jn.forces.TorsionalSpring(("ground", "crank"), stiffness=3.0, damping=0.5),
        "single": jn.forces.Torque(("ground", "crank"), law="2*x - 0.1*v"),
        "vector": jn.forces.PointForce(("crank",), point=[1.0, 0.0], law=["4*t", "5"]),
    }
    found = jn.solve(crank("0.25 + 0.7*t", forces=forces), [0.0], order=2)
    needed = 9.81 * np.cos(0.25) + 3 * 0.25 + 0.5 * 0.7 - 2 * 0.25 + 0.1 * 0.7 - 5 * np.cos(0.25)
    near(jn.driver_force(found, "theta").values[0, 0], needed)


row(ADAMS, "REQUEST, MEASURE")(HELD[MATLAB, "Transform Sensor"])
row(ADAMS, "kinematic analysis")(HELD[MATLAB, 'Motion actuation "Provided by Input"'])


@row(ADAMS, "dynamic analysis (GSTIFF, HHT)", slow=True)
def _(fall):
    """The acceleration at the start follows from weight and friction about the pin."""
    near(fall.outputs["angle"][0, 2], (-9.81 * np.cos(0.2) - 0.4) / 0.6)


@row(ADAMS, "redundant constraints removed silently", slow=True)
def _():
    """A second pin on the axis of the first repeats both its equations: it is solved, and the reactions are NaN."""
    twice = crank()
    joints = {**twice.joints, "P": jn.planar.Revolute(("ground", "crank"), [0, 0], [0, 0])}
    found = jn.solve(dataclasses.replace(twice, joints=joints), order=2)
    near(found.outputs["angle"][:, :3].T, ANGLE)
    assert np.isnan(jn.joint_reaction(found, "P").force.values).all()
    near(jn.driver_force(found, "theta").values[:, 0], TORQUE)


row(ADAMS, "Postprocessor: animation, plots")(HELD[MATLAB, "Mechanics Explorer"])


@row(ADAMS, "design variables")
def _(motion):
    wider = jn.solve(motion.mechanism.with_parameters(a=0.6), order=4)
    near(wider.outputs["angle"][:, :3].T, 2 * ANGLE)
    assert callable(jn.simulate_batch)


row(ADAMS, "contact, flexible bodies")(lambda: None)  # what is not supported has no check


@row(ADAMS, "friction that depends on reactions", slow=True)
def _(fall):
    """Friction of a constant size takes its work from the energy, on the way up and on the way back."""
    (turn,) = (instant for instant, _ in fall.kinks)
    top = fall.at([turn]).outputs["angle"][0, 0]
    start, end = fall.outputs["angle"][:, 0]
    assert top > max(start, end)
    near(np.diff(fall.energy)[0], -0.4 * (top - start + top - end), 1e-11)


# a robot of URDF and one of MJCF, both as Pinocchio has them


class State:
    """A state of a robot in jounce and in Pinocchio."""

    def __init__(self, path, seed=4):
        self.robot = jn.load_robot(path)
        if path.suffix == ".xml":
            self.model = pin.buildModelFromMJCF(str(path))
            self.model.gravity.linear = self.robot.gravity
        else:
            self.model = pin.buildModelFromUrdf(str(path))
        mimics = {name: j.mimic for name, j in self.robot.joints.items() if j.moving and j.mimic is not None}
        for name in mimics:
            self.model = pin.buildReducedModel(self.model, [self.model.getJointId(name)], pin.neutral(self.model))
            self.robot = self.robot.locked({mimics[name].joint: 0.0})
        for name in {mimic.joint for mimic in mimics.values()}:
            self.model = pin.buildReducedModel(self.model, [self.model.getJointId(name)], pin.neutral(self.model))
        assert list(self.model.names)[1:] == list(self.robot.joint_names)
        self.q = np.random.default_rng(seed).uniform(-1, 1, (5, len(self.robot.joint_names)))
        self.data, (q, v, a) = self.model.createData(), self.q[:3]
        self.rnea = np.array(pin.rnea(self.model, self.data, q, v, a))
        pin.computeJointJacobiansTimeVariation(self.model, self.data, q, v)
        pin.forwardKinematics(self.model, self.data, q, v, a)
        pin.updateFramePlacements(self.model, self.data)


@pytest.fixture(scope="module")
def panda():
    return State(ROBOTS / "panda.urdf")


@pytest.fixture(scope="module")
def planar_arm():
    return State(ROBOTS / "planar_arm.xml")


@pytest.fixture(scope="module")
def frame(panda):
    return jn.forward_kinematics(panda.robot, panda.q, LINK)


def frame_of(panda):
    return panda.model.getFrameId(LINK)


PINOCCHIO = "Pinocchio"


@row(PINOCCHIO, "`buildModelFromUrdf`, `buildModelFromMJCF`")
def _(panda, planar_arm):
    for state in (panda, planar_arm):
        base = state.robot.base_inertia
        near(state.robot.mass - (0.0 if base is None else base.mass), pin.computeTotalMass(state.model))


@row(PINOCCHIO, "`model.gravity`: 9.81 m/s^2 along -z; `<option gravity>` of an MJCF file is ignored")
def _(panda):
    near(panda.robot.gravity, panda.model.gravity.linear)
    path = ROBOTS / "planar_arm.xml"
    near(pin.buildModelFromMJCF(str(path)).gravity.linear, [0, 0, -9.81])
    near(jn.load_robot(path).gravity, mujoco.MjModel.from_xml_path(str(path)).opt.gravity)
    near(jn.load_robot(path).with_gravity([0, 0, -9.81]).gravity, [0, 0, -9.81])


@row(PINOCCHIO, "`rnea(model, data, q, v, a)`, a model of URDF")
def _(panda):
    found = jn.inverse_dynamics(panda.robot, panda.q[:3], drives=False)[0]
    near(found, panda.rnea)
    whole = jn.inverse_dynamics(panda.robot, panda.q[:3])[0]
    assert np.abs(whole - found).max() > 1e-4  # the damping of the file


@row(PINOCCHIO, "`rnea`, a model of MJCF: includes the armature, but neither damping nor friction")
def _(planar_arm):
    robot, q = planar_arm.robot, planar_arm.q
    near(jn.mass_matrix(robot, q[0]) @ q[2] + jn.bias_forces(robot, q[:2], drives=False), planar_arm.rnea)
    for drives in (True, False):
        assert np.abs(jn.inverse_dynamics(robot, q[:3], drives=drives)[0] - planar_arm.rnea).max() > 0.1


@row(PINOCCHIO, "finite differences of `rnea`, or `computeRNEADerivatives` times rates")
def _(panda):
    q, v, a, j = panda.q[:4]
    data = panda.model.createData()
    pin.computeRNEADerivatives(panda.model, data, q, v, a)
    mass = np.triu(data.M) + np.triu(data.M, 1).T
    found = jn.inverse_dynamics(panda.robot, panda.q[:4], drives=False)
    near(found[1], data.dtau_dq @ v + data.dtau_dv @ a + mass @ j)


@row(PINOCCHIO, "`crba`")
def _(panda, planar_arm):
    for state in (panda, planar_arm):
        mass = np.triu(pin.crba(state.model, state.model.createData(), state.q[0]))
        near(jn.mass_matrix(state.robot, state.q[0]), mass + np.triu(mass, 1).T)


@row(PINOCCHIO, "`nonLinearEffects`")
def _(panda, planar_arm):
    for state in (panda, planar_arm):
        expected = pin.nonLinearEffects(state.model, state.model.createData(), *state.q[:2])
        near(jn.bias_forces(state.robot, state.q[:2], drives=False), expected)


@row(PINOCCHIO, "`aba`")
def _(panda):
    tau = 10 * panda.q[4]
    expected = pin.aba(panda.model, panda.model.createData(), *panda.q[:2], tau)
    near(jn.forward_dynamics(panda.robot, panda.q[:2], [tau], drives=False)[2], expected)


@row(PINOCCHIO, "`forwardKinematics`, `data.oMf`")
def _(panda, frame):
    there = panda.data.oMf[frame_of(panda)]
    near(frame.position[0], there.translation)
    near(frame.rotation[0], there.rotation)


@row(PINOCCHIO, "`getFrameVelocity(..., LOCAL_WORLD_ALIGNED)`")
def _(panda, frame):
    there = pin.getFrameVelocity(panda.model, panda.data, frame_of(panda), AXES)
    near(frame.position[1], there.linear)
    near(frame.angular_velocity[0], there.angular)
    local = pin.getFrameVelocity(panda.model, panda.data, frame_of(panda))
    near(frame.rotation[0].T @ frame.position[1], local.linear)


@row(PINOCCHIO, "`getFrameClassicalAcceleration(..., LOCAL_WORLD_ALIGNED)`")
def _(panda, frame):
    there = pin.getFrameClassicalAcceleration(panda.model, panda.data, frame_of(panda), AXES)
    near(frame.position[2], there.linear)
    near(frame.angular_velocity[1], there.angular)


@row(PINOCCHIO, "`getFrameAcceleration`: spatial, and in `LOCAL` axes by default")
def _(panda, frame):
    there = pin.getFrameAcceleration(panda.model, panda.data, frame_of(panda))
    spatial = frame.position[2] - np.cross(frame.angular_velocity[0], frame.position[1])
    near(frame.rotation[0].T @ spatial, there.linear)
    near(frame.rotation[0].T @ frame.angular_velocity[1], there.angular)
    assert np.abs(frame.position[2] - there.linear).max() > 0.1


@row(PINOCCHIO, "`computeFrameJacobian(..., LOCAL_WORLD_ALIGNED)`")
def _(panda, frame):
    found = jn.jacobian(panda.robot, panda.q[:1], LINK)[0]
    near(found, pin.computeFrameJacobian(panda.model, panda.data, panda.q[0], frame_of(panda), AXES))
    local = pin.computeFrameJacobian(panda.model, panda.data, panda.q[0], frame_of(panda))
    near(np.kron(np.eye(2), frame.rotation[0].T) @ found, local)


@row(
    PINOCCHIO,
    "`computeJointJacobians`, `getFrameJacobian(..., WORLD)`: of the point at the origin of the world",
)
def _(panda, frame):
    J = jn.jacobian(panda.robot, panda.q[:1], LINK)[0]
    linear = J[:3] + np.cross(frame.position[0], J[3:], axisb=0, axisc=0)
    there = np.array(pin.computeJointJacobians(panda.model, panda.model.createData(), panda.q[0]))
    near(np.concatenate([linear, J[3:]]), there)
    near(there, pin.getFrameJacobian(panda.model, panda.data, frame_of(panda), pin.WORLD))


@row(PINOCCHIO, "`getFrameJacobianTimeVariation(..., LOCAL_WORLD_ALIGNED)`")
def _(panda):
    there = pin.getFrameJacobianTimeVariation(panda.model, panda.data, frame_of(panda), AXES)
    near(jn.jacobian(panda.robot, panda.q[:2], LINK)[1], there)


@row(PINOCCHIO, "`computeKineticEnergy`")
def _(panda):
    expected = pin.computeKineticEnergy(panda.model, panda.model.createData(), *panda.q[:2])
    near(jn.energy.kinetic_energy(panda.robot, panda.q[:2], drives=False).total[0], expected)


@row(PINOCCHIO, "`centerOfMass`")
def _(panda):
    robot, base = panda.robot, panda.robot.base_inertia
    there = pin.centerOfMass(panda.model, panda.model.createData(), panda.q[0])
    moving, fixed = robot.mass - base.mass, base.mass * base.center_of_mass
    near(jn.robot.center_of_mass(robot, panda.q)[0], (moving * there + fixed) / robot.mass)


@row(PINOCCHIO, "a continuous joint as (cos, sin)")
def _(wheel):
    robot, model = wheel
    there = pin.rnea(model, model.createData(), np.array([np.cos(7.0), np.sin(7.0)]), np.ones(1), np.ones(1))
    near(jn.inverse_dynamics(robot, [[7.0], [1.0], [1.0]], drives=False)[0], there)


@pytest.fixture
def wheel(tmp_path):
    body = '<mass value="2"/><origin xyz="0.1 0.2 0"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    path = tmp_path / "wheel.urdf"
    path.write_text(
        f'<robot name="wheel"><link name="base"/><link name="rim"><inertial>{body}</inertial></link><joint name="axle" '
        'type="continuous"><parent link="base"/><child link="rim"/><axis xyz="0 1 0"/></joint></robot>'
    )
    return jn.load_robot(path), pin.buildModelFromUrdf(str(path))


@row(PINOCCHIO, "a free flyer with a quaternion")
def _(wheel, tmp_path):
    """The three turns are the axes z, y, x in turn; one with a quaternion begins a `BaseMotion`."""
    flying = wheel[0].with_floating_base()
    model = pin.buildModelFromUrdf(str(tmp_path / "wheel.urdf"), pin.JointModelFreeFlyer())
    z, y, x = 0.4, -0.7, 1.1
    turned = pin.utils.rotate("z", z) @ pin.utils.rotate("y", y) @ pin.utils.rotate("x", x)
    q = np.concatenate([[1, 2, 3], pin.Quaternion(turned).coeffs(), [np.cos(0.3), np.sin(0.3)]])
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    here = jn.forward_kinematics(flying, [[1, 2, 3, z, y, x, 0.3]], "rim")
    near(here.position[0], data.oMf[model.getFrameId("rim")].translation)
    near(here.rotation[0], data.oMf[model.getFrameId("rim")].rotation)


@row(PINOCCHIO, "`MeshcatVisualizer`, Viser")
def _():
    assert kind_of(ROBOTS / "ur5.urdf") == "robot"
    HELD[MATLAB, "Mechanics Explorer"]()


@row(PINOCCHIO, "`RigidConstraintModel`")
def _():
    """A five-bar is assembled where the points that Pinocchio ties are in one place."""
    robot = jn.load_robot(FIVE_BAR)
    mechanism = robot.mechanism(
        {"left_motor": 0.2, "right_motor": 0.1}, drivers={"left_motor": 0.2, "right_motor": 0.1}
    )
    (name,) = robot.closures
    assert name in mechanism.joints
    free = np.array([not joint.endswith("motor") for joint in robot.joint_names])
    q = Loops(robot).closed(robot.coordinates(left_motor=0.2, right_motor=0.1), free)
    model, frames = in_pinocchio(robot.opened())
    tie, data = in_contact(model, frames, robot.closures[name]), model.createData()
    pin.forwardKinematics(model, data, q[[robot.joint_names.index(joint) for joint in list(model.names)[1:]]])
    ends = ((tie.joint1_id, tie.joint1_placement), (tie.joint2_id, tie.joint2_placement))
    first, second = ((data.oMi[joint] * place).translation for joint, place in ends)
    near(first, second)
    for link, body in mechanism.bodies.items():
        number, _ = frames[link]
        near(body.position, data.oMi[number].translation, 1e-9)


@row(PINOCCHIO, "C++ speed for one sample")
def _(panda):
    many = np.random.default_rng(2).uniform(-1, 1, (2, 3, *panda.q[:3].shape))
    found = jn.inverse_dynamics(panda.robot, many, drives=False)
    for place in np.ndindex(2, 3):
        near(found[place][0], pin.rnea(panda.model, panda.model.createData(), *many[place]))


# the planar arm in MuJoCo, dry friction switched off where it is a soft constraint there


class Arm:
    """A state of the planar arm in jounce and in MuJoCo."""

    body = "ram"

    def __init__(self, folder):
        path = folder / "arm.xml"
        path.write_text(re.sub(r' frictionloss="[^"]*"', "", (ROBOTS / "planar_arm.xml").read_text()))
        self.robot, self.model = jn.load_robot(path), mujoco.MjModel.from_xml_path(str(path))
        self.data = mujoco.MjData(self.model)
        self.q = np.array([[0.3, -0.6, 0.1], [0.7, 1.1, -0.4], [2.0, -3.0, 1.5]])
        self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = self.q
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        mujoco.mj_inverse(self.model, self.data)
        self.number = self.model.body(self.body).id
        self.frame = jn.forward_kinematics(self.robot, self.q, self.body)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return Arm(tmp_path_factory.mktemp("arm"))


MUJOCO = "MuJoCo"


@row(MUJOCO, "`MjModel.from_xml_path`")
def _(arm):
    near(arm.robot.mass, arm.model.body_mass.sum())


@row(MUJOCO, "`data.qpos`")
def _(arm):
    assert [arm.model.joint(k).name for k in range(3)] == list(arm.robot.joint_names)


@row(MUJOCO, "`data.xpos`, `data.xmat` of a body")
def _(arm):
    near(arm.frame.position[0], arm.data.xpos[arm.number])
    near(arm.frame.rotation[0], arm.data.xmat[arm.number].reshape(3, 3))


@row(MUJOCO, "`mj_jacBody`")
def _(arm):
    parts = np.zeros((2, 3, 3))
    mujoco.mj_jacBody(arm.model, arm.data, *parts, arm.number)
    near(jn.jacobian(arm.robot, arm.q[:1], arm.body)[0], np.concatenate(parts))


@row(MUJOCO, "`mj_objectVelocity(..., mjOBJ_XBODY, ..., flg_local=0)`: angular first")
def _(arm):
    found, of_center = np.zeros((2, 6))
    mujoco.mj_objectVelocity(arm.model, arm.data, mujoco.mjtObj.mjOBJ_XBODY, arm.number, found, 0)
    near(np.concatenate([arm.frame.angular_velocity[0], arm.frame.position[1]]), found)
    mujoco.mj_objectVelocity(arm.model, arm.data, mujoco.mjtObj.mjOBJ_BODY, arm.number, of_center, 0)
    jacobian = np.zeros((3, 3))
    mujoco.mj_jacBodyCom(arm.model, arm.data, jacobian, None, arm.number)
    near(jacobian @ arm.q[1], of_center[3:])


@row(
    MUJOCO,
    "`mj_objectAcceleration(..., mjOBJ_XBODY, ..., flg_local=0)`, sensor `framelinacc`: less that of free fall",
)
def _(arm):
    found = np.zeros(6)
    mujoco.mj_rnePostConstraint(arm.model, arm.data)
    mujoco.mj_objectAcceleration(arm.model, arm.data, mujoco.mjtObj.mjOBJ_XBODY, arm.number, found, 0)
    near(arm.frame.angular_velocity[1], found[:3])
    near(arm.frame.position[2] - arm.robot.gravity, found[3:])


@row(MUJOCO, "`mj_fullM`")
def _(arm):
    found = np.zeros((3, 3))
    mujoco.mj_fullM(arm.model, arm.data, found)
    near(jn.mass_matrix(arm.robot, arm.q[0]), found)


@row(MUJOCO, "`data.qfrc_bias`")
def _(arm):
    near(jn.bias_forces(arm.robot, arm.q[:2], drives=False), arm.data.qfrc_bias)


@row(MUJOCO, "`data.qfrc_passive`, damping")
def _(arm):
    near(-arm.robot.tree.damping * arm.q[1], arm.data.qfrc_passive)


@row(MUJOCO, "`mj_inverse`, `data.qfrc_inverse`")
def _(arm):
    near(jn.inverse_dynamics(arm.robot, arm.q)[0], arm.data.qfrc_inverse)
    rough = jn.load_robot(ROBOTS / "planar_arm.xml")
    added = jn.inverse_dynamics(rough, arm.q)[0] - jn.inverse_dynamics(arm.robot, arm.q)[0]
    near(added, rough.tree.friction * np.sign(arm.q[1]))


LINKAGES = "pylinkage and other linkage tools"


@row(LINKAGES, "`Crank`, `Revolute`, `Fixed`, `Linear` dyads in order of solution")
def _():
    """A four-bar whose bodies and joints are given in the opposite order: its coupler keeps its length."""
    given = jn.load(ROOT / "examples" / "four_bar.yaml")
    turned = {key: dict(reversed(list(getattr(given, key).items()))) for key in ("bodies", "joints")}
    found = jn.solve(dataclasses.replace(given, **turned), TIME, order=0)
    angle = np.pi / 6 + np.pi / 3 * np.sin(np.pi * TIME)
    crank_end = 0.04 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    near(np.linalg.norm(found.outputs["C"][:, 0] - crank_end, axis=1), 0.1423)


row(LINKAGES, "`linkage.step()`")(HELD[MATLAB, 'Motion actuation "Provided by Input"'])


@row(LINKAGES, "positions of joints")
def _(motion):
    near(motion.outputs["tip"][:, 2, 0], -np.sin(ANGLE[0]) * ANGLE[2] - np.cos(ANGLE[0]) * ANGLE[1] ** 2)


row(LINKAGES, "`show_linkage`")(HELD[MATLAB, "Mechanics Explorer"])


@row(LINKAGES, "constant crank speed")
def _():
    times = np.linspace(0, 1, 20)
    for law, angle in (
        ("2*t", 2 * TIME),
        (lambda t: t * t, TIME**2),
        (jn.laws.SplineMotion(times, times**2), TIME**2),
        (jn.laws.CycloidalMotion(0.0, 1.0, 1.0), TIME - np.sin(2 * np.pi * TIME) / (2 * np.pi)),
    ):
        near(resolve_motion(crank(law).drivers["theta"].motion, {})(jn.Jet.variable(TIME, 0)).coefficients[0], angle)


row(LINKAGES, "optimization over dimensions")(HELD[ADAMS, "design variables"])
row(LINKAGES, "planar")(HELD[MATLAB, "Revolute Joint, Prismatic Joint"])


def test_every_row_has_its_check():
    assert [(section, there) for section, there, _ in rows()] == list(HELD)


def marked(key):
    return pytest.param(*key, marks=pytest.mark.slow if key in SLOW else ())


@pytest.mark.parametrize("section, there", [marked((section, there)) for section, there, _ in rows()])
def test_rows_hold(section, there, request):
    check = HELD[section, there]
    names = check.__code__.co_varnames[: check.__code__.co_argcount]
    check(*(request.getfixturevalue(name) for name in names))
