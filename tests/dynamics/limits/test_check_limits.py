"""Limits of robots: the worst instants of closed forms, ratios, ranges, joints held still, and what is refused."""

import dataclasses
import warnings

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar

import jounce as jn
from jounce.dynamics.limits.check_limits import check_limits
from jounce.dynamics.limits.trajectories import BLOCK
from jounce.robot.model.mimics import leaders
from jounce.trajectory import JointTrajectory, motion_profile

GRAVITY, LENGTH, MASS = 9.81, 0.5, 2.0
INERTIA = MASS * LENGTH**2


def pendulum(**limits):
    """Return a point mass on a massless rod: torque = m l^2 q'' + m g l cos q."""
    bob = jn.Inertia(MASS, center_of_mass=[LENGTH, 0, 0])
    pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0], limits=jn.Limits(**limits))
    return jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", bob)], [pin])


def slide_and_pin(**limits):
    """Return a carriage on a horizontal slide that carries the pendulum."""
    links = [jn.Link("base"), jn.Link("carriage", jn.Inertia(3.0)), jn.Link("rod", jn.Inertia(MASS, [LENGTH, 0, 0]))]
    slide = jn.Joint("slide", "base", "carriage", "prismatic", axis=[1, 0, 0], limits=jn.Limits(**limits))
    return jn.Robot("crane", links, [slide, jn.Joint("pin", "carriage", "rod", axis=[0, -1, 0])])


def rows_of(report):
    return {(row.joint, row.quantity): row for row in report.rows}


def largest(function, start, stop, samples=20001):
    """Return the largest magnitude of a function, by a dense grid and Brent's method."""
    t = np.linspace(start, stop, samples)
    best = int(np.argmax(np.abs(function(t))))
    low, high = t[max(best - 1, 0)], t[min(best + 1, samples - 1)]
    found = minimize_scalar(lambda x: -abs(function(x)), bounds=(low, high), method="bounded", options={"xatol": 1e-10})
    return max(-found.fun, abs(function(t[best])))


def test_worst_values_are_those_of_the_closed_form():
    robot = pendulum(lower=-1.0, upper=2.0, velocity=3.0, acceleration=8.0, jerk=50.0, effort=12.0, effort_rate=40.0)
    found = rows_of(check_limits(robot, JointTrajectory({"pin": "0.7*sin(3*t)"}, start=0.1, stop=2.3)))
    q = lambda t: 0.7 * np.sin(3 * t)  # noqa: E731
    curves = {
        "position": (lambda t: q(t) - 0.5, 1.5),
        "velocity": (lambda t: 2.1 * np.cos(3 * t), 3.0),
        "acceleration": (lambda t: -6.3 * np.sin(3 * t), 8.0),
        "jerk": (lambda t: -18.9 * np.cos(3 * t), 50.0),
        "torque": (lambda t: INERTIA * -9 * q(t) + MASS * GRAVITY * LENGTH * np.cos(q(t)), 12.0),
        "torque rate": (
            lambda t: INERTIA * -18.9 * np.cos(3 * t) - MASS * GRAVITY * LENGTH * np.sin(q(t)) * 2.1 * np.cos(3 * t),
            40.0,
        ),
    }
    for quantity, (curve, limit) in curves.items():
        row = found["pin", quantity]
        # The search ends at a millionth of the duration: the error of a peak is the square of that.
        assert row.ratio == pytest.approx(largest(curve, 0.1, 2.3) / limit, rel=1e-10), quantity
        stated = abs(curve(row.time)) / limit
        assert row.ratio == pytest.approx(stated, rel=1e-12), quantity


@pytest.mark.parametrize(
    "limits, start, stop, ratio, bound",
    [
        ({"acceleration": 4.0, "deceleration": 1.0}, 0.0, 0.6, 2 * np.sin(1.2), -1.0),  # slows down all the time
        ({"acceleration": 4.0, "deceleration": 1.0}, 1.0, 1.5, np.sin(2.0) / 2, -4.0),  # speeds up
        ({"acceleration": 4.0, "deceleration": 1.0}, 0.0, 1.5, 2.0, -1.0),
        ({"acceleration": 1.0, "deceleration": 4.0}, 0.0, 1.5, 2.0, -1.0),
        ({"acceleration": 1.0, "deceleration": 4.0}, 0.0, np.pi / 4, 0.5, -4.0),  # slows down until it is at rest
        ({"deceleration": 1.0}, 1.0, 1.5, 0.0, None),
        ({"acceleration": 4.0}, 0.0, 0.6, np.sin(1.2) / 2, -4.0),
    ],
)
def test_an_acceleration_against_the_velocity_may_have_a_limit_of_its_own(limits, start, stop, ratio, bound):
    trajectory = JointTrajectory({"pin": "0.5*sin(2*t)"}, start=start, stop=stop)  # q' = cos 2t, q'' = -2 sin 2t
    row = rows_of(check_limits(pendulum(**limits), trajectory))["pin", "acceleration"]
    assert row.ratio == pytest.approx(ratio, rel=1e-6)  # from one side, where the bound changes at t = pi/4
    assert bound is None or row.limit == pytest.approx(bound, rel=1e-15)


def test_a_joint_that_starts_at_rest_speeds_up_there_and_one_that_ends_at_rest_slows_down():
    limits = {"acceleration": 6.0, "deceleration": 3.0}  # q'' = 6 - 12 t, which slows down from t = 1/2 on
    trajectory = JointTrajectory({"pin": "3*t**2 - 2*t**3"}, start=0.0, stop=1.0)
    report = check_limits(pendulum(**limits), trajectory)
    row = rows_of(report)["pin", "acceleration"]
    assert row.ratio == pytest.approx(2.0, rel=1e-5)
    assert row.value == pytest.approx(-6.0, rel=1e-5)
    assert report.shares[[0, -1], 2, 0] == pytest.approx([1.0, -2.0], rel=1e-12)


def test_the_highest_of_many_peaks_is_found_where_another_has_the_highest_sample():
    law = "sin(397*t)*(1 + 0.0015*exp(-((t - 0.52)/0.01)**2))"  # 63 waves of 32 samples each
    report = check_limits(pendulum(velocity=397.5), JointTrajectory({"pin": law}, start=0.0, stop=1.0))
    t = np.linspace(0.5, 0.54, 100_001)
    bump = 0.0015 * np.exp(-(((t - 0.52) / 0.01) ** 2))
    speeds = 397 * np.cos(397 * t) * (1 + bump) - np.sin(397 * t) * bump * (t - 0.52) / 0.01**2 * 2
    assert abs(rows_of(report)["pin", "velocity"].value) == pytest.approx(np.abs(speeds).max(), rel=1e-8)
    assert not report.kept


def test_units_and_words_tell_turning_from_sliding():
    found = check_limits(slide_and_pin(), JointTrajectory({"slide": "sin(t)", "pin": "t"}, start=0.0, stop=1.0))
    listed = [(row.joint, row.quantity, row.unit) for row in found.rows]
    assert listed[:6] == [
        ("slide", "position", "m"),
        ("slide", "velocity", "m/s"),
        ("slide", "acceleration", "m/s^2"),
        ("slide", "jerk", "m/s^3"),
        ("slide", "force", "N"),
        ("slide", "force rate", "N/s"),
    ]
    assert [unit for joint, _, unit in listed if joint == "pin"] == [
        "rad",
        "rad/s",
        "rad/s^2",
        "rad/s^3",
        "N m",
        "N m/s",
    ]


def test_a_quantity_without_limit_is_reported_by_its_largest_magnitude():
    found = check_limits(pendulum(), JointTrajectory({"pin": "1 - t"}, start=0.0, stop=3.0))
    assert (found.kept, found.worst, found.limited) == (True, None, ())
    row = rows_of(found)["pin", "position"]
    assert (row.value, row.time, row.limit, row.ratio) == (-2.0, 3.0, None, None)
    assert np.isnan(found.shares).all()


@pytest.mark.parametrize(
    "limits, law, ratio, limit, broken",
    [
        ({"lower": 1.0, "upper": 3.0}, "2.5", 0.5, 3.0, False),
        ({"lower": 1.0, "upper": 3.0}, "0.5", 1.5, 1.0, True),
        ({"lower": 1.0, "upper": 3.0}, "2", 0.0, 3.0, False),
        ({"upper": 2.0}, "1.5", 0.75, 2.0, False),
        ({"upper": 2.0}, "-9", 0.0, 2.0, False),
        ({"upper": -2.0}, "-1", 1.5, -2.0, True),
        ({"lower": 0.0}, "-0.25", 1.25, 0.0, True),
        ({"lower": 0.3, "upper": 0.3}, "0.3", 1.0, 0.3, False),
        ({"lower": 0.3, "upper": 0.3}, "0.6", 2.0, 0.3, True),
        ({"lower": -1.0, "upper": 1.0}, "1.0000000001", 1.0, 1.0, False),
        ({"lower": -1.0, "upper": 1.0}, "1.000001", 1.000001, 1.0, True),
    ],
)
def test_ratio_of_a_range(limits, law, ratio, limit, broken):
    report = check_limits(pendulum(**limits), JointTrajectory({"pin": law}, start=0.0, stop=1.0))
    row = report.worst
    assert row.ratio == pytest.approx(ratio, abs=2e-10)
    assert (row.limit, row.broken, report.kept) == (limit, broken, not broken)


def test_shares_run_from_minus_one_to_one():
    report = check_limits(
        pendulum(lower=-1.0, upper=3.0, velocity=4.0), JointTrajectory({"pin": "-1 + 4*t"}, start=0.0, stop=1.0)
    )
    np.testing.assert_allclose(report.shares[:, 0, 0], -1 + 2 * report.times, atol=1e-14)
    np.testing.assert_allclose(report.shares[:, 1, 0], 1.0, atol=1e-14)
    assert np.isnan(report.shares[:, 2:, 0]).all()
    np.testing.assert_allclose(report.values[:, 0, 0], -1 + 4 * report.times, atol=1e-14)


def test_a_peak_between_coarse_samples_is_found():
    t = np.linspace(0.0, 2.0, 12)
    samples = np.sin(4 * t)
    trajectory = JointTrajectory.from_samples(t, samples[:, None], ["pin"])
    with pytest.warns(jn.errors.SampleWarning, match="samples of 'pin' do not support"):
        report = check_limits(pendulum(velocity=5.0), trajectory)
    spline = make_interp_spline(t, samples, k=5)
    row = rows_of(report)["pin", "velocity"]
    assert abs(row.value) == pytest.approx(largest(spline.derivative(), 0.0, 2.0), rel=1e-10)
    assert row.value == pytest.approx(float(spline(row.time, nu=1)), rel=1e-10)


def test_a_narrow_peak_is_found_where_the_samples_are_dense():
    # A pulse of 10 ms in a minute: only the samples say where to look.
    times = np.unique(np.concatenate([np.linspace(0.0, 60.0, 61), np.linspace(29.95, 30.05, 101)]))
    law = "0.1*exp(-((t - 30)/0.01)**2)"
    report = check_limits(
        pendulum(lower=-0.05, upper=0.05), JointTrajectory({"pin": law}, start=0.0, stop=60.0, times=times)
    )
    assert report.worst.ratio == pytest.approx(2.0, rel=1e-12)
    assert report.worst.time == pytest.approx(30.0, abs=1e-6)


def test_both_sides_of_a_jump_count():
    law = motion_profile("trapezoidal", 0.0, 1.0, limits=(0.8, 3.0, 20.0))
    report = check_limits(
        pendulum(velocity=0.8, acceleration=3.0, jerk=20.0),
        JointTrajectory({"pin": law}, start=0.0, stop=float(law.duration)),
    )
    found = rows_of(report)
    assert found["pin", "jerk"].ratio == pytest.approx(1.0, rel=1e-9)
    assert found["pin", "velocity"].ratio == pytest.approx(1.0, rel=1e-9)
    assert report.kept


def test_joints_not_named_are_held_still_within_their_range():
    robot = slide_and_pin(lower=0.2, upper=0.5, effort=30.0)
    report = check_limits(robot, JointTrajectory({"pin": "0.3*sin(2*t)"}, start=0.0, stop=1.0))
    assert dict(report.held) == {"slide": 0.2}
    assert [row.quantity for row in report.rows if row.joint == "slide"] == ["force", "force rate"]
    np.testing.assert_array_equal(report.values[:, 0, 0], 0.2)
    t = report.times
    q, dq, ddq = 0.3 * np.sin(2 * t), 0.6 * np.cos(2 * t), -1.2 * np.sin(2 * t)
    force = -MASS * LENGTH * (np.sin(q) * ddq + np.cos(q) * dq**2)  # what the swinging mass asks of the slide
    np.testing.assert_allclose(report.values[:, 4, 0], force, atol=1e-13)


def test_own_limits_replace_those_of_the_robot():
    robot, trajectory = pendulum(velocity=1.0), JointTrajectory({"pin": "2*t"}, start=0.0, stop=1.0)
    assert not check_limits(robot, trajectory).kept
    report = check_limits(robot, trajectory, {"pin": jn.Limits(velocity=4.0)})
    assert report.kept
    assert report.worst.ratio == pytest.approx(0.5)


def test_drives_add_armature_and_damping():
    links = [jn.Link("base"), jn.Link("rod", jn.Inertia(MASS, center_of_mass=[LENGTH, 0, 0]))]
    pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0], armature=0.4, damping=1.5, limits=jn.Limits(effort=1.0))
    robot = jn.Robot("driven", links, [pin], gravity=[0, 0, 0])
    trajectory = JointTrajectory({"pin": "t**2"}, start=0.0, stop=1.0)
    assert check_limits(robot, trajectory).worst.value == pytest.approx(2 * (INERTIA + 0.4) + 1.5 * 2)
    assert check_limits(robot, trajectory, drives=False).worst.value == pytest.approx(2 * INERTIA)


def test_broken_rows_are_sorted_worst_first():
    report = check_limits(
        pendulum(velocity=1.0, acceleration=0.5), JointTrajectory({"pin": "t**2"}, start=0.0, stop=1.0)
    )
    assert [(row.quantity, round(row.ratio, 9)) for row in report.broken] == [("acceleration", 4.0), ("velocity", 2.0)]
    assert report.worst is report.broken[0]


def test_long_trajectories_and_own_instants():
    trajectory = JointTrajectory({"pin": "sin(t)"}, start=0.0, stop=3.0, times=np.linspace(0.0, 3.0, BLOCK))
    report = check_limits(pendulum(velocity=2.0), trajectory)
    assert len(report.times) > BLOCK
    np.testing.assert_allclose(report.values[:, 1, 0], np.cos(report.times), atol=1e-14)
    single = check_limits(pendulum(velocity=2.0), trajectory, times=[1.0])
    assert single.worst.time == 1.0
    assert single.worst.value == pytest.approx(np.cos(1.0), rel=1e-14)


def test_samples_that_support_the_jerk_raise_no_warning():
    t = np.linspace(0.0, 2.0, 401)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        report = check_limits(pendulum(jerk=30.0), JointTrajectory.from_samples(t, np.sin(3 * t)[:, None], ["pin"]))
    assert report.worst.ratio == pytest.approx(0.9, rel=1e-5)  # the error of the spline


@pytest.mark.parametrize(
    "laws, message",
    [
        ({"pim": "t"}, "no moving joint of pendulum has this name, got 'pim'; did you mean 'pin'?"),
        ({"pin": "1/t"}, "the law is not defined or not smooth at 0 s"),
        ({"pin": "1e200*t"}, "pin: the effort of this joint is not finite at t = 0 s"),
    ],
)
def test_what_a_trajectory_cannot_be(laws, message):
    with pytest.raises(jn.errors.TrajectoryError) as raised:
        check_limits(pendulum(velocity=1.0), JointTrajectory(laws, start=0.0, stop=1.0))
    assert message in str(raised.value)


def test_joints_that_follow_or_are_fixed_are_no_part_of_a_trajectory():
    body = jn.Inertia(1.0, center_of_mass=[0.1, 0, 0])
    links = [jn.Link(name, body) for name in "abcd"]
    joints = [
        jn.Joint("one", "a", "b"),
        jn.Joint("two", "b", "c", mimic=jn.robot.Mimic("one")),
        jn.Joint("three", "c", "d", "fixed"),
    ]
    robot = jn.Robot("fingers", links, joints)
    for name, message in [
        ("two", "this joint follows one"),
        ("three", "this joint is fixed"),
    ]:
        with pytest.raises(
            jn.errors.TrajectoryError, match=rf"{message}.*leave it out, of a file by joints \(--joints\)"
        ):
            check_limits(robot, JointTrajectory({"one": "t", name: "t"}, start=0.0, stop=1.0))
        with pytest.raises(jn.errors.RobotError, match=message):
            check_limits(robot, JointTrajectory({"one": "t"}, start=0.0, stop=1.0), {name: jn.Limits(velocity=1.0)})


def gripper(**limits):
    """Return a jaw, and a tip that slides back three times as fast from half a metre, with limits of its own."""
    body, lead = jn.Inertia(1.0), jn.Limits(lower=0.0, upper=1.0, velocity=1.0, deceleration=4.0, effort=9.0)
    tip = jn.Joint("tip", "jaw", "tip", "prismatic", mimic=jn.robot.Mimic("jaw", -3.0, 0.5), limits=jn.Limits(**limits))
    joints = [jn.Joint("jaw", "base", "jaw", "prismatic", limits=lead), tip]
    return jn.Robot("gripper", [jn.Link("base"), jn.Link("jaw", body), jn.Link("tip", body)], joints)


def test_limits_of_joints_that_follow_bind_the_joint_that_they_follow():
    robot = gripper(lower=-1.0, upper=0.2, velocity=0.6, acceleration=1.5, jerk=30.0, effort=1.0)
    found = [getattr(robot.limits["jaw"], field.name) for field in dataclasses.fields(jn.Limits)]
    np.testing.assert_allclose(np.array(found, float), [0.1, 0.5, 0.2, 0.5, 10.0, 9.0, np.nan, 0.5], rtol=1e-14)
    report = check_limits(robot, JointTrajectory({"jaw": "0.2 + 0.4*t"}, start=0.0, stop=1.0), times=[0.0, 1.0])
    broken = {row.quantity: (row.value, row.limit) for row in report.broken}
    assert (broken["position"], broken["velocity"]) == (pytest.approx((0.6, 0.5)), pytest.approx((0.4, 0.2)))
    assert gripper().limits["jaw"] == robot.joints["jaw"].limits
    with pytest.raises(jn.errors.RobotError, match="jaw: no coordinate keeps the range"):
        check_limits(gripper(lower=1.0), JointTrajectory({"jaw": "t"}, start=0.0, stop=1.0))


def chain_of_followers():
    """Return a robot whose joint c follows b, which follows a: q_b = -2 q_a, q_c = 3 q_b + 0.3 = 0.3 - 6 q_a."""
    body = jn.Inertia(1.0, [0.1, 0, 0], [0.1, 0.1, 0.1])
    follows = leaders({"b": jn.robot.Mimic("a", -2.0), "c": jn.robot.Mimic("b", 3.0, 0.3)})
    own = {"a": {}, "b": {"velocity": 1.0}, "c": {"lower": -0.9, "upper": 1.5, "jerk": 12.0}}
    joints = [jn.Joint(x, "base", x, mimic=follows.get(x), limits=jn.Limits(**own[x])) for x in "abc"]
    return jn.Robot("chain", [jn.Link("base"), *(jn.Link(x, body) for x in "abc")], joints)


def test_limits_that_are_given_leave_those_of_joints_that_follow():
    robot, given = chain_of_followers(), {"a": jn.Limits(lower=-3.0, upper=0.1, velocity=5.0, acceleration=9.0)}
    found = [getattr(robot.limits_with(given)["a"], field.name) for field in dataclasses.fields(jn.Limits)]
    np.testing.assert_allclose(
        np.array(found, float), [-0.2, 0.1, 0.5, 9.0, 2.0, np.nan, np.nan, np.nan], rtol=0, atol=1e-15
    )
    trajectory = JointTrajectory({"a": "-0.3*sin(2*t)"}, start=0.0, stop=0.5)
    report = check_limits(robot, trajectory, given)
    ratios = {row.quantity: row.ratio for row in report.limited}  # the range is 0.3 wide about -0.05
    expected = {
        "position": (0.3 * np.sin(1.0) - 0.05) / 0.15,
        "velocity": 0.6 / 0.5,
        "acceleration": 1.2 * np.sin(1.0) / 9.0,
        "jerk": 2.4 / 2.0,
    }
    assert ratios == pytest.approx(expected, rel=1e-10)
    with pytest.raises(jn.errors.RobotError, match="a: no coordinate keeps the range"):
        check_limits(robot, trajectory, {"a": jn.Limits(lower=0.5)})


def test_a_joint_held_still_stands_where_those_that_follow_it_may_be():
    robot = gripper(lower=-1.0, upper=-0.1)  # q_tip = 0.5 - 3 q_jaw
    links, joints = [*robot.links.values(), jn.Link("arm", jn.Inertia(1.0))], [*robot.joints.values()]
    arm = jn.Robot("arm", links, [*joints, jn.Joint("arm", "base", "arm")])
    assert dict(check_limits(arm, JointTrajectory({"arm": "t"}, start=0.0, stop=1.0)).held) == {
        "jaw": pytest.approx(0.2, rel=1e-15)
    }


def test_limits_and_times_are_checked():
    trajectory = JointTrajectory({"pin": "t"}, start=0.0, stop=1.0)
    with pytest.raises(jn.errors.RobotError, match=r"no moving joint of .* has this name, got 'pim'"):
        check_limits(pendulum(), trajectory, {"pim": jn.Limits()})
    for times in ([], [0.0, 0.0], [[0.0]], ["x"], [np.nan]):
        with pytest.raises(jn.errors.TrajectoryError, match="times: must be"):
            check_limits(pendulum(), trajectory, times=times)
    rigid = jn.Robot("block", [jn.Link("base", jn.Inertia(1.0))], [])
    with pytest.raises(jn.errors.RobotError, match="no moving joint"):
        check_limits(rigid, trajectory)


@pytest.mark.parametrize("check", [check_limits, jn.dynamics.trajectory_torques])
@pytest.mark.parametrize("given", ["motion.csv", np.zeros((5, 1))], ids=["file", "array"])
def test_what_is_no_trajectory_is_refused_with_what_to_give(check, given):
    with pytest.raises(jn.errors.TrajectoryError, match=r"^trajectory: must be a jn\.JointTrajectory, as"):
        check(pendulum(), given)


def test_limits_for_retiming_are_refused_with_what_to_give():
    robot = jn.load_robot("examples/robots/planar_arm.xml")
    laws = jn.JointTrajectory({"shoulder": "0.3*sin(3*t)"}, 0.0, 1.0)
    limits = jn.planning.MotionLimits({"shoulder": jn.Limits(velocity=1.0)})
    with pytest.raises(jn.errors.RobotError, match=r"got 'MotionLimits'; of .* give their `joints`"):
        jn.check_limits(robot, laws, limits)
    assert not jn.check_limits(robot, laws, limits.joints).broken
