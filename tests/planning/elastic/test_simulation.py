"""Simulations of elastic robots and mechanisms under their feedforward, which know nothing of the trajectory."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.planning import elastic_robot, link_errors
from jounce.planning.elastic.driven_systems import robot_drives
from jounce.planning.elastic.motor_torques import torques_of

DRIVES = {
    "shoulder": jn.planning.Drive(stiffness=500.0, damping=2.0, rotor_inertia=1e-4, gear_ratio=50),
    "elbow": jn.planning.Drive(stiffness=300.0, rotor_inertia=5e-5, gear_ratio=-80),
}
PLATFORM = "examples/sea_platform.yaml"


def test_rotors_are_links_on_the_base(arm):
    whole = elastic_robot(arm, DRIVES)
    assert sorted(whole.joint_names) == ["elbow", "elbow_motor", "shoulder", "shoulder_motor"]
    assert whole.joints["elbow_motor"].armature == pytest.approx(5e-5 * 6400)
    assert (whole.joints["elbow"].damping, whole.joints["elbow"].armature) == (0.2, 0.0)
    assert whole.mass == arm.mass


def test_torques_of_motors_are_numbers_expressions_and_functions_of_time(arm):
    arrays = robot_drives(arm, DRIVES, losses=True)
    given = {"shoulder": lambda t: jnp.sin(3 * t), "elbow": np.array(0.4)}
    constant, ((index, law),), feedback = torques_of(arrays, given)
    assert torques_of(arrays, jn.JointTrajectory({"elbow": "t"}, 0.0, 1.0))[1][0][0] == arrays.names.index("elbow")
    assert (arrays.names[index], feedback) == ("shoulder", None)
    assert dict(zip(arrays.names, constant, strict=True)) == {"shoulder": 0.0, "elbow": 0.4}
    found = [float(x) for x in law(jn.Jet.variable(0.3, order=3)).derivatives()]
    assert found == pytest.approx([math.sin(0.9), 3 * math.cos(0.9), -9 * math.sin(0.9), -27 * math.cos(0.9)])


@pytest.mark.parametrize("change, words", [({"rotor_inertia": 0.0}, "no inertia"), ({}, "no inertia")])
def test_a_rotor_without_inertia_is_refused(arm, change, words):
    with pytest.raises(jn.errors.RobotError, match=words):
        elastic_robot(arm, {"elbow": jn.planning.Drive(stiffness=1.0, **change)})


def test_what_does_not_fit_is_refused(arm):
    with pytest.raises(jn.JounceError, match="itself"):
        jn.planning.simulate_elastic(arm, DRIVES, [0.0, 1.0], driven={"elbow": "t"})
    with pytest.raises(jn.errors.RobotError, match="shape"):
        jn.planning.simulate_elastic(arm, DRIVES, [0.0, 1.0], state=[0.0, 1.0])
    with pytest.raises(jn.errors.RobotError, match="state: must be real numbers"):
        jn.planning.simulate_elastic(arm, DRIVES, [0.0, 1.0], state=np.zeros((2, 2)) + 1j)
    with pytest.raises(jn.errors.RobotError, match="law of time"):
        jn.planning.simulate_elastic(arm, DRIVES, [0.0, 1.0], {"elbow": [1.0]})
    with pytest.raises(jn.errors.RobotError, match=r"torque.elbow: the motion law cannot be used: .* of jax.numpy"):
        jn.planning.simulate_elastic(arm, DRIVES, [0.0, 1.0], {"elbow": lambda t: math.sin(t)})
    with pytest.raises(jn.errors.RobotError, match=r"torque.elbow: unknown name 'shoulder'"):
        jn.planning.simulate_elastic(arm, DRIVES, [0.0, 1.0], {"elbow": "2*shoulder"})
    with pytest.raises(jn.errors.RobotError, match=r"torque: the function must return an array of 2 forces.* not \(\)"):
        jn.planning.simulate_elastic(arm, DRIVES, [0.0, 1.0], lambda t, *_: 2 * t)
    with pytest.raises(jn.errors.RobotError, match=r"torque: must be a function of time, q, q', theta and theta'"):
        jn.planning.simulate_elastic(arm, DRIVES, [0.0, 1.0], lambda t: 2 * t)
    hinge = jn.load("examples/hooke_joint.yaml")
    (name,) = hinge.drivers
    spring = {name: jn.planning.Drive(stiffness=1.0, rotor_inertia=1.0)}
    with pytest.raises(jn.errors.UnsupportedError, match="feedforward"):
        jn.planning.simulate_elastic(hinge, spring, [0.0, 0.1], state=np.zeros((2, 2, 1)))


@pytest.mark.parametrize(
    "drive, armatures",
    [(jn.planning.Drive(stiffness=40.0), {"lead_motor": 0.5}), (jn.planning.Drive(rotor_inertia=0.2), {"lead": 0.2})],
    ids=["elastic", "rigid"],
)
def test_armature_and_friction_of_a_joint_that_follows_count_once(drive, armatures):
    rod = jn.Inertia(1.0, center_of_mass=[0.1, 0, 0])
    tip = jn.Joint("tip", "arm", "tip", mimic=jn.robot.Mimic("lead", -2.0), armature=0.1, friction=0.3)
    lead = jn.Joint("lead", "base", "arm", armature=0.1, friction=0.4)
    robot = jn.Robot("gripper", [jn.Link("base"), jn.Link("arm", rod), jn.Link("tip", rod)], [lead, tip])
    whole = elastic_robot(robot, {"lead": drive})
    found = dict(zip(whole.joint_names, whole.tree.armature, strict=True))
    assert {name: value for name, value in found.items() if value} == pytest.approx(armatures)  # 0.1 + 2^2 * 0.1
    assert whole.tree.friction.sum() == pytest.approx(1.0)  # 0.4 + 2 * 0.3


@pytest.mark.slow
def test_links_of_an_arm_follow_to_rounding(arm, swing):
    """Two joints, one damped: 2 s without feedback; without the acceleration of the springs a millimeter and more."""
    found = link_errors(jn.planning.feedforward(arm, swing, DRIVES))
    assert found.units == ("rad", "rad")
    assert found.exact.max() < 1e-11
    assert found.rigid.max() > 1e-4


@pytest.mark.slow
def test_free_motion_keeps_its_energy_and_feedback_acts(arm):
    """Motors and links swing freely: energy of springs included, nothing is lost."""
    drives = {name: jn.planning.Drive(stiffness=40.0, rotor_inertia=0.3) for name in DRIVES}
    free = jn.planning.simulate_elastic(
        arm, drives, np.linspace(0, 1, 11), None, [[0.3, -0.5], [0.0, 0.0]], losses=False
    )
    columns = [free.robot.joint_names.index(name) for name in ("shoulder", "elbow", "shoulder_motor", "elbow_motor")]
    q = free.q[:, 0, columns]
    energy = free.energy + 20.0 * ((q[:, :2] - q[:, 2:]) ** 2).sum(axis=1)
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-11)
    assert np.ptp(free.energy) > 0.1

    def held(time, q, rate, theta, theta_rate):
        return -200.0 * theta - 60.0 * theta_rate

    run = jn.planning.simulate_elastic(arm, drives, [0.0, 0.4, 0.8], held, [[0.3, -0.5], [0.0, 0.0]])
    q, theta = run.q[..., columns[:2]], run.q[..., columns[2:]]
    spring = 40.0 * (theta - q)[:, 0]
    damping = np.array([0.1, 0.2])
    tau = np.asarray(jn.inverse_dynamics(arm, q, drives=False))[:, 0] + damping * q[:, 1]
    np.testing.assert_allclose(spring, tau, rtol=0, atol=1e-11)
    torque = held(0.0, q[:, 0], q[:, 1], theta[:, 0], theta[:, 1])
    np.testing.assert_allclose(0.3 * theta[:, 2] + spring, torque, rtol=0, atol=1e-11)
    assert np.abs(theta[-1, 0]).max() < 0.2


@pytest.mark.slow
def test_the_platform_on_springs_follows():
    """Closed loops: six legs with springs, spindles and rotors. It is not stable without feedback: exp(5 t) or so."""
    platform = jn.load(PLATFORM)
    drives = jn.io.load_drives("examples/drives/sea_platform.yaml", platform)
    found = link_errors(jn.planning.feedforward(platform, np.linspace(0, 0.5, 26), drives), rigid=False)
    assert (found.names, found.rigid) == (("platform",), None)
    assert found.exact.max() < 1e-9
    assert found.time[-1] == 0.5


@pytest.mark.slow
def test_a_crank_with_an_elastic_drive_and_a_rod_in_the_plane():
    """A coordinate driver: a rod in gravity at an angle, against the pendulum of a robot."""
    rod = jn.Body([0, 0], mass=1.0, inertia=1 / 12, center_of_mass=[0.5, 0])
    pin = jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])
    driver = jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion="0.5*sin(2*t)")
    crank = jn.Mechanism(
        space="planar", bodies={"rod": rod}, joints={"O": pin}, drivers={"turn": driver}, gravity=[0, -9.81]
    )
    drive = jn.planning.Drive(stiffness=100.0, damping=1.0, rotor_inertia=1e-4, gear_ratio=50)
    found = jn.planning.feedforward(crank, np.linspace(0, 1, 51), {"turn": drive})
    inertia = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    joint = jn.Joint("turn", "base", "rod", axis=[0, -1, 0])
    arm = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", inertia)], [joint])
    law = jn.JointTrajectory({"turn": "0.5*sin(2*t)"}, 0.0, 1.0, times=np.linspace(0, 1, 51))
    same = jn.planning.feedforward(arm, law, {"turn": drive})
    for field in ("position", "torque", "deflection", "motor_torque"):
        np.testing.assert_allclose(getattr(found, field), getattr(same, field), rtol=0, atol=1e-10)
    assert link_errors(found, rigid=False).exact.max() < 1e-11
