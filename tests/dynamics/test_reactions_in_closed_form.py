"""Forces of drivers and reactions of joints beside closed forms and other algorithms."""

import dataclasses

import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, planar
from jounce.kinematics import Motion
from jounce.mechanism import build
from tests.problems import small
from tests.problems.massed import TIME_OF_LAW, arm, massed
from tests.problems.mechanisms import example

TIME = np.array([0.1, 0.35, 0.6, 0.85])
ZERO, X = [0.0, 0.0], [1.0, 0.0]


def law(t):
    """The motion law of most mechanisms here, for mpmath."""
    return mpmath.mpf("0.3") + mpmath.mpf("0.7") * t + mpmath.mpf("0.4") * mpmath.sin(3 * t)


def rates(function, times, count=3):
    """Derivatives of a function of time in mpmath, shape (time, count)."""
    with mpmath.workdps(40):
        return np.array([[float(mpmath.diff(function, mpmath.mpf(t), k)) for k in range(count)] for t in times])


@pytest.mark.slow
def test_driven_pendulum_against_its_closed_form():
    motion = jn.solve(arm(mass=2.0, inertia=0.3, center_of_mass=[0.5, 0.0]), TIME, order=4)

    def torque(t):
        with_steiner = mpmath.mpf("0.3") + 2 * mpmath.mpf("0.25")
        return with_steiner * mpmath.diff(law, t, 2) + 2 * mpmath.mpf("9.81") / 2 * mpmath.cos(law(t))

    def pin(component):
        def force(t):
            r, w, a = mpmath.mpf("0.5"), mpmath.diff(law, t), mpmath.diff(law, t, 2)
            c, s = mpmath.cos(law(t)), mpmath.sin(law(t))
            x = -a * r * s - w**2 * r * c
            y = a * r * c - w**2 * r * s + mpmath.mpf("9.81")
            return 2 * (x if component == 0 else y)

        return force

    np.testing.assert_allclose(jn.driver_force(motion, "turn"), rates(torque, TIME), rtol=1e-12, atol=1e-11)
    reaction = jn.joint_reaction(motion, "pin")
    for component in range(2):
        expected = rates(pin(component), TIME)
        np.testing.assert_allclose(reaction.force[..., component], expected, rtol=1e-12, atol=1e-10)
    assert np.abs(reaction.torque).max() <= 1e-12  # a pin carries none about itself


@pytest.mark.slow
def test_slider_crank_against_the_textbook():
    # crank 1 and rod 3 without mass, slider of 4 kg on x: torque = 4 x'' dx/dtheta, guide force from the rod's angle
    mechanism = small.slider_crank()
    bodies = {**mechanism.bodies, "slider": dataclasses.replace(mechanism.bodies["slider"], mass=4.0)}
    driver = drivers.CoordinateDriver(("ground", "crank"), "angle", TIME_OF_LAW)
    mechanism = dataclasses.replace(mechanism, bodies=bodies, drivers={"drive": driver})
    motion = jn.solve(mechanism, TIME, order=4)

    def x(angle):
        return mpmath.cos(angle) + mpmath.sqrt(9 - mpmath.sin(angle) ** 2)

    def push(t):
        return 4 * mpmath.diff(lambda s: x(law(s)), t, 2)

    def torque(t):
        return push(t) * mpmath.diff(x, law(t))

    def guide(t):
        return push(t) * mpmath.sin(law(t)) / mpmath.sqrt(9 - mpmath.sin(law(t)) ** 2)

    np.testing.assert_allclose(jn.driver_force(motion, "drive"), rates(torque, TIME), rtol=1e-9, atol=1e-9)
    normal = jn.joint_reaction(motion, "guide").force
    np.testing.assert_allclose(normal[..., 1], rates(guide, TIME), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(normal[..., 0], 0.0, atol=1e-10)
    rod = jn.joint_reaction(motion, "B", "rod", frame="rod").force  # a rod without mass carries along itself only
    assert np.abs(rod[..., 1]).max() <= 1e-11 * np.abs(rod[..., 0]).max()


@pytest.mark.slow
def test_gear_pair_adds_the_inertia_of_the_other_shaft():
    mechanism = jn.Mechanism(
        space="planar",
        bodies={"one": jn.Body(ZERO, mass=1.0, inertia=0.2), "two": jn.Body([3, 0], mass=1.0, inertia=0.7)},
        joints={
            "A": planar.Revolute(("ground", "one"), ZERO, ZERO),
            "B": planar.Revolute(("ground", "two"), [3.0, 0.0], ZERO),
            "mesh": planar.Coordinate(("one", "two"), "angle", ratio=-0.5),
        },
        drivers={"turn": drivers.CoordinateDriver(("ground", "one"), "angle", TIME_OF_LAW)},
    )
    motion = jn.solve(mechanism, TIME, order=4)
    angle = rates(law, TIME, 5)
    np.testing.assert_allclose(jn.driver_force(motion, "turn"), (0.2 + 0.25 * 0.7) * angle[:, 2:], rtol=1e-12)
    mesh = jn.joint_reaction(motion, "mesh")
    np.testing.assert_allclose(mesh.torque, -0.5 * 0.7 * angle[:, 2:], rtol=1e-12)
    assert np.abs(mesh.force).max() <= 1e-13
    shaft = jn.joint_reaction(motion, "mesh", "one")
    np.testing.assert_allclose(shaft.torque, -0.25 * 0.7 * angle[:, 2:], rtol=1e-12)


@pytest.mark.slow
def test_rolling_disc_needs_friction_for_its_spin():
    # a disc of 3 kg, 0.5 kg m^2 and radius 0.4 on the x axis, pushed at its center
    bodies = ("ground", "disc")
    mechanism = jn.Mechanism(
        space="planar",
        gravity=[0.0, -9.81],
        bodies={"disc": jn.Body([0.0, 0.4], mass=3.0, inertia=0.5)},
        joints={
            "line": planar.Parallel2(bodies, [0.0, 0.4], ZERO, X),
            "roll": planar.Rolling(bodies, [0.0, 0.4], ZERO, [-1.0, 0.0], 0.4),
        },
        drivers={"push": drivers.SlideDriver(bodies, [0.0, 0.4], ZERO, X, TIME_OF_LAW)},
    )
    motion = jn.solve(mechanism, TIME, order=4)
    x = rates(law, TIME, 5)
    np.testing.assert_allclose(jn.driver_force(motion, "push"), (3.0 + 0.5 / 0.16) * x[:, 2:], rtol=1e-12)
    roll = jn.joint_reaction(motion, "roll", point=[0.0, 0.0])
    np.testing.assert_allclose(roll.force[..., 0], -0.5 / 0.16 * x[:, 2:], rtol=1e-12)
    weight = jn.joint_reaction(motion, "line").force[..., 1]
    np.testing.assert_allclose(weight, np.array([[3.0 * 9.81, 0.0, 0.0]] * len(TIME)), atol=1e-11)


@pytest.mark.slow
def test_a_body_at_rest_gives_its_weight_and_no_rates():
    mechanism = massed(small.crank("0.7"))
    motion = jn.solve(mechanism, TIME, order=4)
    body = mechanism.bodies["crank"]
    weight = -body.mass * np.array(mechanism.gravity)
    force = jn.joint_reaction(motion, "O").force
    np.testing.assert_allclose(force[:, 0], np.tile(weight, (len(TIME), 1)), rtol=1e-13)
    assert np.abs(force[:, 1:]).max() == 0


def test_free_motion_has_the_reactions_of_the_driven_one():
    # the law's own torque, in closed form, on a pendulum that nothing drives: the same motion, so the same pin forces
    body = {"mass": 2.0, "inertia": 0.3, "center_of_mass": [0.5, 0.0]}
    driven = jn.solve(arm(**body), TIME, order=4)
    torque = f"-0.8*3.6*sin(3*t) + 9.81*cos({TIME_OF_LAW})"
    free = dataclasses.replace(arm(**body), drivers={}, forces={"motor": jn.forces.Torque(("ground", "arm"), torque)})
    status = np.zeros(len(TIME), int)
    motion = Motion(free, build(free), TIME, 4, (driven.poses[1], ()), status, {})
    for frame in ("global", "body"):
        expected, found = (jn.joint_reaction(m, "pin", frame=frame).force for m in (driven, motion))
        np.testing.assert_allclose(found, expected, atol=1e-11)
    balance = jn.energy.power_balance(motion)
    assert (np.abs(balance["residual"]) <= 1e-12 * balance["scale"].max()).all()


def test_springs_are_balanced_by_the_driver():
    mechanism = dataclasses.replace(
        arm(),
        forces={"spring": jn.forces.TorsionalSpring(("ground", "arm"), stiffness=3.0, angle=0.1, damping=0.5)},
    )
    motion = jn.solve(mechanism, TIME, order=4)
    angle = rates(law, TIME, 5)
    expected = 3.0 * (angle - [0.1, 0, 0, 0, 0])[:, :3] + 0.5 * angle[:, 1:4]
    np.testing.assert_allclose(jn.driver_force(motion, "turn"), expected, rtol=1e-12)
    np.testing.assert_allclose(jn.dynamics.applied_force(motion, "spring"), -expected, rtol=1e-12)
    assert jn.dynamics.applied_force(motion, "spring").attrs["units"] == "N*m"


@pytest.mark.slow
def test_bearing_of_an_unbalanced_rotor_in_space():
    # in the axes of the rotor the moment is a I u + w^2 u x (I u), and the force m (a u x c + w^2 u x (u x c))
    tensor = np.array([[0.3, 0.02, -0.05], [0.02, 0.4, 0.03], [-0.05, 0.03, 0.2]])
    center, mass = np.array([0.1, -0.2, 0.3]), 1.7
    mechanism = small.spindle(TIME_OF_LAW)
    body = dataclasses.replace(
        mechanism.bodies["spindle"], mass=mass, inertia=tensor.tolist(), center_of_mass=center.tolist()
    )
    mechanism = dataclasses.replace(mechanism, bodies={"spindle": body}, outputs={})
    motion = jn.solve(mechanism, TIME, order=4)
    bearing = jn.joint_reaction(motion, "O", frame="body", point=center)
    torque = jn.driver_force(motion, "turn").values

    def squared(t):
        return mpmath.diff(law, t) ** 2

    a, w2 = rates(law, TIME, 5)[:, 2:, None], rates(squared, TIME)[..., None]
    axis = np.array([0.0, 0.0, 1.0])
    along = np.cross(axis, center)
    force = mass * (a * along + w2 * np.cross(axis, along))
    np.testing.assert_allclose(bearing.force, force, atol=1e-12 * np.abs(force).max())
    moment = a * tensor[2] + w2 * np.cross(axis, tensor[2])
    found = bearing.torque.values + torque[..., None] * axis  # about the center of mass, bearing and motor together
    np.testing.assert_allclose(found, moment, atol=1e-12 * np.abs(moment).max())
    about_axis = (tensor[2, 2] + mass * (center[0] ** 2 + center[1] ** 2)) * a[..., 0]
    np.testing.assert_allclose(torque, about_axis, rtol=1e-12)


@pytest.mark.slow
def test_a_joint_of_ones_own_has_reactions():
    # a bead of 1.5 kg on y = 2 x^2: the wire pushes across itself only, and the driver does the work
    class Wire(jn.joints.AbstractConstraint, space="planar"):
        curvature: jn.joints.Scalar

        def residual(self, body_i, body_j, time):
            d = body_j.position - body_i.position
            return d[1] - self.curvature * d[0] ** 2

    bodies = ("ground", "bead")
    mechanism = jn.Mechanism(
        space="planar",
        gravity=[0.0, -9.81],
        bodies={"bead": jn.Body([0.3, 0.2], mass=1.5, inertia=0.1)},
        joints={"wire": Wire(bodies, 2.0), "level": planar.Coordinate(bodies, "angle", 0.0)},
        drivers={"push": drivers.CoordinateDriver(bodies, "x", TIME_OF_LAW)},
    )
    motion = jn.solve(mechanism, TIME, order=4)

    def wire(t):
        return mpmath.mpf("1.5") * (mpmath.diff(lambda s: 2 * law(s) ** 2, t, 2) + mpmath.mpf("9.81"))

    def push(t):
        return mpmath.mpf("1.5") * mpmath.diff(law, t, 2) + wire(t) * 4 * law(t)

    reaction = jn.joint_reaction(motion, "wire").force
    np.testing.assert_allclose(reaction[..., 1], rates(wire, TIME), rtol=1e-11)
    np.testing.assert_allclose(jn.driver_force(motion, "push"), rates(push, TIME), rtol=1e-11)
    angle = np.arctan2(-reaction[:, 0, 0], reaction[:, 0, 1])
    np.testing.assert_allclose(np.tan(angle), 4 * rates(law, TIME)[:, 0], rtol=1e-12)


@pytest.mark.slow
def test_reactions_of_a_chain_against_recursive_newton_euler():
    rod = jn.Inertia(1.3, center_of_mass=[0.4, 0.05, -0.1], tensor=[0.02, 0.11, 0.12])
    links = [jn.Link("base"), jn.Link("a", rod), jn.Link("b", rod), jn.Link("c", rod)]
    joints = [
        jn.Joint("A", "base", "a", axis=[0.0, 1.0, 2.0], position=[0.1, 0.0, 0.2]),
        jn.Joint("B", "a", "b", axis=[1.0, 0.0, 0.3], position=[0.5, 0.1, 0.0]),
        jn.Joint("C", "b", "c", axis=[0.0, 1.0, 0.0], position=[0.3, 0.0, 0.1]),
    ]
    robot = jn.Robot("chain", links, joints)
    laws = {"A": "0.4*sin(2*t)", "B": "0.3 + 0.5*t", "C": "cos(1.5*t)"}
    motion = jn.solve(robot.mechanism(drivers=laws), TIME, order=3)
    q = np.stack([motion.outputs[name] for name in "ABC"], axis=-1)
    for frame, axes in (("body", "link"), ("global", "base")):
        expected = jn.robot.joint_wrenches(robot, q, frame=axes)
        for k, (name, link) in enumerate(zip("ABC", "abc", strict=True)):
            parts = [jn.joint_reaction(motion, j, link, frame, [0.0, 0.0, 0.0]) for j in (name, f"{name}_drive")]
            force = sum(part.force.values for part in parts)
            torque = sum(part.torque.values for part in parts)
            found = np.concatenate([force, torque], axis=-1)[:, : expected.shape[1]]
            sizes = np.abs(expected[:, :, k]).max(axis=(0, 2))
            error = np.abs(found - expected[:, : found.shape[1], k]).max(axis=(0, 2)) / sizes[: found.shape[1]]
            assert (error <= 1e-13).all(), (name, frame, error)


@pytest.mark.slow
def test_reactions_in_a_simulation():
    # a double pendulum: what holds the lower mass is m (a - g), with rates, from derivatives of its place alone
    mechanism = jn.load(example("double_pendulum"))
    simulation = jn.simulate(mechanism, np.linspace(0.0, 1.0, 5), order=3)
    tip = simulation.point("lower", mechanism.bodies["lower"].center_of_mass).values
    expected = tip[:, 2:].copy()
    expected[:, 0] += [0.0, 9.81]
    force = jn.joint_reaction(simulation, "B").force.values[:, : expected.shape[1]]
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    balance = jn.energy.power_balance(simulation)
    assert (np.abs(balance["residual"]) <= 1e-12 * balance["scale"].max("time")).all()
