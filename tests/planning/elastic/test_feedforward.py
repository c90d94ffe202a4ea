"""Feedforward of elastic joints against closed forms of 50 digits, order by order, and what must not change it."""

import dataclasses

import mpmath
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from tests.problems.robots import random_robot

TIMES = np.array([0.1, 0.77, 1.3])
MASS, ARM, MOMENT, WEIGHT = 2.0, 0.4, 0.05, 9.81
DRIVES = {
    "shoulder": jn.planning.Drive(stiffness=500.0, rotor_inertia=1e-4, gear_ratio=50),
    "elbow": jn.planning.Drive(stiffness=300.0, rotor_inertia=5e-5, gear_ratio=-80),
}


def pendulum(**changes):
    """Return a rod that rises from the horizontal, in a frame turned by chance."""
    rod = jn.Inertia(MASS, center_of_mass=[ARM, 0, 0], tensor=[0, MOMENT, MOMENT])
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn = turn * np.sign(np.linalg.det(turn))
    pin = jn.Joint("pin", "base", "rod", position=[0.3, 0, 1], rotation=turn, axis=[0, -1, 0], **changes)
    return jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin], gravity=turn @ [0, 0, -WEIGHT])


def exact_angle(t):
    return mpmath.mpf("0.7") * mp.sin(2 * t) + mpmath.mpf("0.2") * t**3


def exact_torque(t):
    inertia = mpmath.mpf(MOMENT) + mpmath.mpf(MASS) * mpmath.mpf(ARM) ** 2
    return inertia * mp.diff(exact_angle, t, 2) + mpmath.mpf(MASS) * mpmath.mpf(WEIGHT) * mpmath.mpf(ARM) * mp.cos(
        exact_angle(t)
    )


LAW = jn.JointTrajectory({"pin": "0.7*sin(2*t) + 0.2*t**3"}, 0.0, 1.5)


def test_a_pendulum_to_the_third_rate_of_the_torque():
    drive = jn.planning.Drive(stiffness=90.0, rotor_inertia=2e-4, gear_ratio=60)
    found = jn.planning.feedforward(pendulum(), LAW, {"pin": drive}, rates=3, times=TIMES)
    inertia = mpmath.mpf(60) ** 2 * mpmath.mpf(2e-4)
    with mp.workdps(50):
        for row, t in enumerate(map(mpmath.mpf, TIMES)):
            position = mp.taylor(lambda s: exact_angle(s) + exact_torque(s) / 90, t, 7)
            torque = mp.taylor(exact_torque, t, 3)
            for k in range(6):
                exact = position[k] * mp.factorial(k)
                assert abs(found.position[row, k, 0] - exact) < 1e-12 * max(1, abs(exact))
                assert abs(found.motor_position[row, k, 0] - 60 * exact) < 60e-12 * max(1, abs(exact))
            for k in range(4):
                exact = inertia * position[k + 2] * mp.factorial(k + 2) + torque[k] * mp.factorial(k)
                assert abs(found.torque[row, k, 0] - exact) < 1e-12 * max(1, abs(exact))
                assert abs(found.motor_torque[row, k, 0] - exact / 60) < 1e-12 * max(1, abs(exact))


@pytest.mark.slow
def test_a_damped_pendulum_is_solved_along_the_trajectory():
    """Against quadrature of 30 digits from the same start, and its own equation."""
    drive = jn.planning.Drive(stiffness=90.0, damping=9.0, rotor_inertia=2e-4, gear_ratio=60)
    found = jn.planning.feedforward(pendulum(), LAW, {"pin": drive}, times=TIMES)
    start = found.at([0.0]).deflection[0, 0, 0]
    with mp.workdps(30):
        for row, t in enumerate(map(mpmath.mpf, TIMES)):
            past = mp.quad(lambda s, t=t: mp.exp(-10 * (t - s)) * exact_torque(s), mpmath.linspace(0, t, 8)) / 9
            assert abs(found.deflection[row, 0, 0] - start * mp.exp(-10 * t) - past) < 1e-14
    force = 90.0 * found.deflection[:, :2] + 9.0 * found.deflection[:, 1:]
    np.testing.assert_allclose(force, found.spring_torque[:, :2], rtol=0, atol=1e-12)
    first = jn.planning.feedforward(
        pendulum(), LAW, {"pin": dataclasses.replace(drive, damping=0.0)}, times=[0.0], rates=1
    )
    tau = first.spring_torque[0, :3, 0]
    assert start == pytest.approx((tau[0] - 0.1 * tau[1] + 0.01 * tau[2]) / 90, rel=1e-13)


def test_without_damping_is_the_limit_of_little_damping(arm, swing):
    hard = jn.planning.feedforward(arm, swing, DRIVES, times=TIMES)
    little = {name: dataclasses.replace(drive, damping=1e-9) for name, drive in DRIVES.items()}
    soft = jn.planning.feedforward(arm, swing, little, times=TIMES)
    for field in ("position", "torque", "deflection"):
        np.testing.assert_allclose(getattr(soft, field), getattr(hard, field), rtol=1e-9, atol=1e-11)


def test_a_stiff_spring_is_a_rigid_joint(arm, swing):
    rigid = {name: dataclasses.replace(drive, stiffness=None) for name, drive in DRIVES.items()}
    stiff = {name: dataclasses.replace(drive, stiffness=1e13) for name, drive in DRIVES.items()}
    expected, found = (jn.planning.feedforward(arm, swing, drives, times=TIMES) for drives in (rigid, stiff))
    assert not expected.deflection.any()
    np.testing.assert_allclose(found.torque, expected.torque, rtol=1e-9)
    q = swing.derivatives(TIMES, 4)
    armature = [jn.planning.Drive(rotor_inertia=d.reflected_inertia) for d in DRIVES.values()]
    joints = [
        dataclasses.replace(j, armature=d.rotor_inertia) for j, d in zip(arm.moving_joints, armature, strict=True)
    ]
    geared = jn.Robot("arm", list(arm.links.values()), joints)
    np.testing.assert_allclose(expected.torque[:, :1], jn.inverse_dynamics(geared, q, drives=True)[:, :1], rtol=1e-13)
    own = jn.planning.feedforward(geared, swing, {}, times=TIMES)  # the armature of the file is that of the rotor
    np.testing.assert_allclose(own.torque, expected.torque, rtol=1e-13)


def test_a_gear_changes_what_the_motor_does_and_not_the_joint(arm, swing):
    plain = {n: dataclasses.replace(d, gear_ratio=1.0, rotor_inertia=d.reflected_inertia) for n, d in DRIVES.items()}
    geared, direct = (jn.planning.feedforward(arm, swing, drives, times=TIMES) for drives in (DRIVES, plain))
    np.testing.assert_allclose(geared.torque, direct.torque, rtol=1e-14)
    np.testing.assert_allclose(geared.motor_torque * [50, -80], direct.motor_torque, rtol=1e-14)
    np.testing.assert_allclose(geared.motor_position / [50, -80], direct.motor_position, rtol=1e-14)
    power = (geared.motor_torque[:, 0] * geared.motor_position[:, 1]) / (direct.torque[:, 0] * direct.position[:, 1])
    np.testing.assert_allclose(power, 1.0, rtol=1e-13)


@pytest.mark.slow
def test_derivatives_alone_give_the_same(arm, swing):
    along = jn.planning.feedforward(arm, swing, DRIVES, rates=2, times=TIMES)
    found = jn.planning.feedforward(arm, swing.derivatives(TIMES, 6), DRIVES, rates=2)
    assert isinstance(found, jn.planning.MotorMotion)
    for field in ("position", "torque", "deflection", "motor_torque"):
        np.testing.assert_allclose(getattr(found, field), getattr(along, field), rtol=1e-12, atol=1e-13)


@pytest.mark.slow
def test_the_expansion_alone_is_refused_until_it_is_good_enough(arm, swing):
    damped = {name: dataclasses.replace(drive, damping=0.5) for name, drive in DRIVES.items()}
    with pytest.raises(jn.errors.RobotError, match="more derivatives"):
        jn.planning.feedforward(arm, swing.derivatives(TIMES, 4), damped)
    with pytest.raises(jn.errors.RobotError, match="derivative 2 of the deflection"):  # of which there is one term
        jn.planning.feedforward(arm, swing.derivatives(TIMES, 4), damped, tolerance=0.1)
    found = jn.planning.feedforward(arm, swing.derivatives(TIMES, 9), damped)
    along = jn.planning.feedforward(arm, swing, damped, times=TIMES)
    for level in range(3):
        size = np.abs(along.deflection[:, level]).max()
        np.testing.assert_allclose(found.deflection[:, level], along.deflection[:, level], rtol=0, atol=1e-6 * size)


def test_instants_outside_are_refused(arm, swing):
    found = jn.planning.feedforward(arm, swing, DRIVES)
    for times in ([-0.1], [2.1], [np.nan], [[0.1]]):
        with pytest.raises(jn.errors.TrajectoryError, match="from 0 to 2 s"):
            found.at(times)
    with pytest.raises(jn.errors.TrajectoryError, match="times: must be real numbers"):
        found.at(np.array([0.1j]))


@pytest.mark.parametrize("seed", [1, 2])
def test_springs_obey_their_law_on_robots_of_chance(seed):
    robot = random_robot(seed, 5)
    names = robot.joint_names
    rng = np.random.default_rng(seed)
    drives = {name: jn.planning.Drive(stiffness=rng.uniform(50, 900), rotor_inertia=0.01) for name in names[::2]}
    q = rng.uniform(-1, 1, (6, 7, len(names)))
    found = jn.planning.feedforward(robot, q, drives, rates=2, losses=False)
    tau = np.asarray(jn.inverse_dynamics(robot, q, drives=False))
    stiffness = np.array([drives[n].stiffness if n in drives else np.inf for n in names])
    inertia = np.array([0.01 if n in drives else a for n, a in zip(names, robot.tree.armature, strict=True)])
    np.testing.assert_allclose(stiffness[::2] * (found.position - q[:, :5])[..., ::2], tau[..., ::2], rtol=1e-10)
    np.testing.assert_allclose(
        found.torque - inertia * found.position[:, 2:], tau[:, :3], rtol=0, atol=1e-9 * np.abs(tau).max()
    )


def test_limits_are_reported_with_joint_and_instant():
    """tau = 3.2 cos t about a vertical axis, K = 100, so that the deflection is largest at the start and at pi."""
    rod = jn.Inertia(1.0, tensor=[0.16, 0.16, 0.32])
    robot = jn.Robot("fan", [jn.Link("base"), jn.Link("rod", rod)], [jn.Joint("pin", "base", "rod")])
    law = jn.JointTrajectory({"pin": "-10*cos(t)"}, 0.5, 3.5, times=[0.5, 2.0, 3.5])
    drive = jn.planning.Drive(
        stiffness=100.0, rotor_inertia=1e-9, gear_ratio=10, deflection_limit=0.03, velocity_limit=200.0
    )
    report = jn.planning.feedforward(robot, law, {"pin": drive}).report
    (row,) = report.broken
    assert (row.joint, row.quantity, row.unit, row.limit) == ("pin", "deflection", "rad", -0.03)
    assert row.time == pytest.approx(np.pi, abs=1e-5)
    assert row.ratio == pytest.approx(0.032 / 0.03, rel=1e-12)
    speed = next(row for row in report.rows if row.quantity == "motor velocity")
    assert (speed.unit, speed.broken) == ("rad/s", False)
    assert speed.value == pytest.approx(10 * (10 - 0.032), rel=1e-9)  # theta = -(10 - 0.032) cos t
    assert speed.time == pytest.approx(np.pi / 2, abs=1e-5)


def test_friction_acts_on_the_motor_and_damping_on_the_link():
    robot, drive = pendulum(damping=0.3, friction=0.7), jn.planning.Drive(stiffness=90.0, rotor_inertia=1e-3)
    with_, without = (jn.planning.feedforward(robot, LAW, {"pin": drive}, times=TIMES, losses=x) for x in (True, False))
    q = LAW.derivatives(TIMES, 4)
    np.testing.assert_allclose(with_.spring_torque - without.spring_torque, 0.3 * q[:, 1:4], rtol=0, atol=1e-12)
    expected = 0.3 * q[:, 1] + 1e-3 * 0.3 * q[:, 3] / 90.0 + 0.7 * np.sign(with_.position[:, 1])
    np.testing.assert_allclose(with_.torque[:, 0] - without.torque[:, 0], expected, rtol=0, atol=1e-12)


def test_a_trajectory_whose_jerk_jumps_is_refused(arm):
    times = np.linspace(0, 2, 9)
    cubic = jn.JointTrajectory.from_samples(times, np.stack([np.sin(times), np.cos(times)], axis=1), arm.joint_names, 3)
    with pytest.raises(jn.errors.TrajectoryError, match="continuous to jerk"):
        jn.planning.feedforward(arm, cubic, DRIVES)
    with pytest.warns(jn.errors.SampleWarning):  # the rates that the table tells
        rigid = jn.planning.feedforward(arm, cubic, {})
    assert np.isfinite(rigid.torque).all()


def test_loops_followers_and_shapes_are_refused(arm):
    five_bar = jn.load_robot("examples/robots/five_bar.xml")
    with pytest.raises(jn.errors.RobotError, match="mechanism"):
        jn.planning.feedforward(five_bar, np.zeros((5, len(five_bar.joint_names))), {})
    panda = jn.load_robot("examples/robots/panda.urdf")
    with pytest.raises(jn.errors.RobotError, match="follows panda_finger_joint1"):
        jn.planning.feedforward(panda, np.zeros((5, 8)), {"panda_finger_joint2": jn.planning.Drive(stiffness=1.0)})
    with pytest.raises(jn.errors.RobotError):
        jn.planning.feedforward(arm, np.zeros((4, 2)), DRIVES)
    with pytest.raises(jn.JounceError, match="at most"):
        jn.planning.feedforward(arm, np.zeros((5, 2)), DRIVES, rates=25)
    with pytest.raises(jn.errors.TrajectoryError, match="times: must be real numbers"):
        jn.planning.feedforward(arm, jn.JointTrajectory({"elbow": "t"}, 0.0, 1.0), DRIVES, times=np.array([0.5j]))
    with pytest.raises(jn.errors.TrajectoryError, match="within"):
        jn.planning.feedforward(arm, jn.JointTrajectory({"elbow": "t"}, 0.0, 1.0), DRIVES, times=[0.5, 1.5])


@pytest.mark.slow
def test_the_table_has_what_both_sides_of_the_gear_do(arm, swing):
    found = jn.planning.feedforward(arm, swing, DRIVES, rates=1)
    table = found.dataset
    assert table.sizes == {"time": 201, "derivative": 2}
    np.testing.assert_array_equal(table["elbow_motor_velocity"].values, found.motor_position[:, 1:3, 1])
    np.testing.assert_array_equal(table["elbow_torque"].values, found.torque[..., 1])
    assert table["shoulder_motor_acceleration"].attrs["units"] == "rad/s**2"
    laws = found.torque_laws()
    t = np.array([0.0123, 1.4567])
    np.testing.assert_allclose(
        np.asarray(laws["elbow"](jn.Jet([t])).coefficients[0]), found.at(t).torque[:, 0, 1], rtol=0, atol=1e-11
    )
