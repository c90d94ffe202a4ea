"""Retimed motions of one joint, and of a pendulum, against closed forms and laws of mechanics."""

import pickle

import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError, RobotError, SolveError, TrajectoryError
from jounce.planning.retiming.quantities.limits import limits_of
from jounce.planning.retiming.quantities.motion_limits_check import check_motion

pytestmark = pytest.mark.long

LENGTH, SPEED, ACCELERATION, JERK, JOUNCE = 2.0, 1.0, 2.0, 10.0, 200.0


def cart(**limits):
    slide = jn.Joint("slide", "base", "cart", "prismatic", axis=[1, 0, 0], limits=jn.Limits(**limits))
    return jn.Robot("cart", [jn.Link("base"), jn.Link("cart", jn.Inertia(1.0))], [slide])


def pendulum(**limits):
    rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0], limits=jn.Limits(**limits))
    return jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin])


def led_cart(multiplier, **limits):
    """Return a cart without limits, and one that follows it with its own."""
    follower = jn.Joint(
        "follow", "base", "led", "prismatic", mimic=jn.robot.Mimic("slide", multiplier), limits=jn.Limits(**limits)
    )
    joints = [jn.Joint("slide", "base", "cart", "prismatic"), follower]
    return jn.Robot(
        "carts", [jn.Link("base"), jn.Link("cart", jn.Inertia(1.0)), jn.Link("led", jn.Inertia(1.0))], joints
    )


LINE = [[0.0], [LENGTH]]
TRAPEZOID = LENGTH / SPEED + SPEED / ACCELERATION


@pytest.mark.slow
def test_a_trapezoid_takes_as_long_as_its_closed_form_says():
    found = jn.retime(cart(velocity=SPEED, acceleration=ACCELERATION), LINE)
    assert TRAPEZOID * (1 - 1e-9) < found.stop < TRAPEZOID * 1.003
    assert found.report.kept
    assert isinstance(found, jn.JointTrajectory)


def test_joints_that_follow_keep_their_limits_beside_those_that_are_given():
    robot = led_cart(-4.0, velocity=4 * SPEED)
    found = jn.retime(robot, LINE, {"slide": jn.Limits(velocity=9.0, acceleration=ACCELERATION)})
    assert TRAPEZOID * (1 - 1e-9) < found.stop < TRAPEZOID * 1.003
    assert found.report.kept


def test_a_limit_that_depends_on_the_position_leaves_those_of_joints_that_follow():
    robot = led_cart(2.0, velocity=1.0, acceleration=3.0, deceleration=1.0)
    laws = {"slide": {"velocity": lambda q: 0.25 + q, "acceleration": lambda q: 1 + 0 * q}}
    own = {"slide": jn.Limits(velocity=0.1, jerk=7.0)}
    found = limits_of(robot, limits_of(robot, jn.planning.MotionLimits(own, varying=laws)))
    q = np.array([0.0, 0.125, 2.0])
    varying = {field: law(q).tolist() for field, law in found.varying["slide"].items()}
    assert varying == {"velocity": [0.25, 0.375, 0.5], "acceleration": [1.0] * 3, "deceleration": [0.5] * 3}
    assert found.joints["slide"].jerk == 7.0
    trajectory = jn.JointTrajectory({"slide": "0.6*t"}, start=0.0, stop=2.0)
    ratios = {row.quantity: row.ratio for row in check_motion(robot, trajectory, found).limited}
    assert ratios["velocity"] == pytest.approx(0.6 / 0.25, rel=1e-9)
    later = jn.JointTrajectory({"slide": "0.6*t"}, start=1.0, stop=2.0)
    ratios = {row.quantity: row.ratio for row in check_motion(robot, later, found).limited}
    assert ratios["velocity"] == pytest.approx(0.6 / 0.5, rel=1e-9)


def test_what_arrives_has_slowed_down_also_where_the_limits_depend_on_the_position():
    limits = {"acceleration": lambda q: 1.0 + 0 * q, "deceleration": lambda q: 4.0 + 0 * q}
    trajectory = jn.JointTrajectory({"slide": "1 - (1 - t)**2"}, start=0.0, stop=1.0)
    report = check_motion(cart(), trajectory, jn.planning.MotionLimits(varying={"slide": limits}))
    assert report.worst.ratio == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize(
    "law, jumps",
    [
        (jn.laws.PiecewiseMotion(["t", "2*t - 1"], [1.0]), {"jerk", "jounce", "acceleration of the point"}),
        (jn.laws.PiecewiseMotion(["t**3", "3*t**2 - 3*t + 1"], [1.0]), {"jounce"}),  # of which only jerk jumps
        (jn.laws.PiecewiseMotion(["t**4", "4*t**3 - 6*t**2 + 4*t - 1"], [1.0]), set()),
    ],
)
def test_limits_of_all_kinds_are_broken_where_something_below_jumps(law, jumps):
    limits = jn.planning.MotionLimits(
        points=(jn.planning.PointLimits("cart", speed=99.0, acceleration=999.0),),
        jounce={"slide": 999.0},
        varying={"slide": {"jerk": lambda q: 999.0 + 0 * q}},
    )
    report = check_motion(cart(), jn.JointTrajectory({"slide": law}, start=0.0, stop=2.0), limits)
    assert {(row.quantity, row.time, row.ratio) for row in report.broken} == {(x, 1.0, np.inf) for x in jumps}


@pytest.mark.parametrize(
    "limits, duration",
    [
        ({"velocity": SPEED, "acceleration": ACCELERATION}, TRAPEZOID),
        ({"velocity": SPEED, "effort": ACCELERATION}, TRAPEZOID),  # of a mass of 1 kg
        ({"acceleration": ACCELERATION}, 2 * np.sqrt(LENGTH / ACCELERATION)),
        ({"velocity": SPEED, "acceleration": 2.0, "deceleration": 1.0}, 2.75),
        ({"velocity": SPEED, "acceleration": 1.0, "deceleration": 2.0}, 2.75),
        ({"velocity": SPEED, "acceleration": ACCELERATION, "jerk": JERK}, TRAPEZOID + ACCELERATION / JERK),
        ({"velocity": SPEED, "effort": ACCELERATION, "effort_rate": JERK}, TRAPEZOID + ACCELERATION / JERK),
        ({"jerk": JERK}, (32 * LENGTH / JERK) ** (1 / 3)),
    ],
    ids=lambda x: "-".join(x) if isinstance(x, dict) else "",
)
@pytest.mark.slow
def test_durations_are_those_of_closed_forms(limits, duration):
    found = jn.retime(cart(**limits), LINE)
    assert duration * (1 - 1e-9) < found.stop < duration * 1.003
    assert found.report.kept
    np.testing.assert_allclose(found.derivatives([0.0, found.stop], 1)[:, :, 0], [[0, 0], [LENGTH, 0]], atol=1e-9)


@pytest.mark.slow
def test_a_limit_of_jounce_rounds_the_jerk():
    robot = cart(velocity=SPEED, acceleration=ACCELERATION, jerk=JERK)
    found = jn.retime(robot, LINE, jn.planning.MotionLimits(jounce={"slide": JOUNCE}))
    duration = TRAPEZOID + ACCELERATION / JERK + JERK / JOUNCE
    assert duration * (1 - 1e-9) < found.stop < duration * 1.003
    assert np.abs(found.derivatives(np.linspace(0, found.stop, 4001), 4)[:, 4]).max() <= JOUNCE * (1 + 1e-6)
    assert [row.quantity for row in found.report.rows][-1] == "jounce"


@pytest.mark.slow
def test_the_speed_of_a_point_and_a_speed_that_depends_on_the_position():
    robot = cart(velocity=SPEED, acceleration=ACCELERATION)
    point = jn.retime(
        robot, LINE, jn.planning.MotionLimits(points=(jn.planning.PointLimits("cart", speed=0.7, acceleration=1.5),))
    )
    assert point.stop == pytest.approx(LENGTH / 0.7 + 0.7 / 1.5, rel=2e-3)
    varying = jn.planning.MotionLimits(varying={"slide": {"velocity": lambda q: 0.3 + 0.2 * (q - 1) ** 2}})
    found = jn.retime(robot, LINE, varying)
    q, v = found.derivatives(np.linspace(0, found.stop, 3001), 1)[:, :, 0].T
    assert (v / (0.3 + 0.2 * (q - 1) ** 2)).max() == pytest.approx(1.0, abs=1e-3)
    assert found.report.kept


@pytest.mark.slow
def test_rates_at_the_ends_are_kept():
    robot = cart(velocity=SPEED, acceleration=ACCELERATION)
    found = jn.retime(robot, LINE, rates=(0.25, 0.1))  # 0.5 and 0.2 m/s
    np.testing.assert_allclose(found.derivatives([0.0, found.stop], 1)[:, 1, 0], [0.5, 0.2], rtol=1e-6)
    up, down = (SPEED - 0.5) / ACCELERATION, (SPEED - 0.2) / ACCELERATION
    duration = up + down + (LENGTH - up * 0.75 - down * 0.6) / SPEED
    assert duration * (1 - 1e-9) < found.stop < duration * 1.003


def test_a_duration_is_kept_and_one_that_is_too_short_is_reported_with_the_least():
    robot = cart(velocity=SPEED, acceleration=ACCELERATION)
    slow = jn.retime(robot, LINE, duration=4.0)
    assert slow.stop == pytest.approx(4.0, rel=1e-12)
    assert slow.report.kept
    times = np.linspace(0.0, 4.0, 4001)
    q, v, a = slow.derivatives(times, 2)[:, :, 0].T
    np.testing.assert_allclose(q[[0, -1]], [0.0, LENGTH], atol=1e-9)
    assert np.abs(v).max() == pytest.approx(SPEED * TRAPEZOID / 4, rel=3e-3)  # the trapezoid, slowed evenly
    assert np.abs(a).max() == pytest.approx(ACCELERATION * (TRAPEZOID / 4) ** 2, rel=1e-2)
    with pytest.raises(TrajectoryError, match=r"duration: the least time .* is 2\.50\d* s.*2\.4"):
        jn.retime(robot, LINE, duration=2.4)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(TrajectoryError, match="duration: must be"):
            jn.retime(robot, LINE, duration=wrong)
    given = jn.JointTrajectory.point_to_point(["slide"], [0.0], [1.0], duration=2.0)
    with pytest.raises(TrajectoryError, match="duration: a repaired trajectory"):
        jn.retime(robot, given, repair=True, duration=3.0)


def test_a_duration_holds_also_with_speeds_at_the_ends_and_with_damping():
    robot = cart(velocity=SPEED, acceleration=ACCELERATION)
    found = jn.retime(robot, LINE, rates=(0.25, 0.1), duration=6.0)
    assert found.stop == pytest.approx(6.0, rel=1e-9)
    q, v, a = found.derivatives(np.linspace(0.0, found.stop, 8001), 2)[:, :, 0].T
    np.testing.assert_allclose(v[[0, -1]], [0.5, 0.2], rtol=1e-6)
    np.testing.assert_allclose(q[[0, -1]], [0.0, LENGTH], atol=1e-9)
    assert np.abs(a).max() <= ACCELERATION * (1 + 1e-6)
    assert np.all(v <= 0.5 * (1 + 1e-6))


@pytest.mark.slow
def test_limits_that_differ_by_direction():
    limits = {"slide": jn.Limits(velocity=2.0, acceleration=8.0)}
    directed = jn.planning.MotionLimits(limits, backward={"slide": jn.Limits(velocity=0.5, acceleration=2.0)})
    robot = cart()
    there, back = jn.retime(robot, LINE, directed), jn.retime(robot, LINE[::-1], directed)
    # speeds up by 8 and slows down by 2, or the other way round
    forward = LENGTH / 2 + 2 / 2 * (1 / 8 + 1 / 2)
    backward = LENGTH / 0.5 + 0.5 / 2 * (1 / 8 + 1 / 2)
    for found, expected in ((there, forward), (back, backward)):
        assert expected * (1 - 1e-9) < found.stop < expected * 1.003
        v, a = found.derivatives(np.linspace(0.0, found.stop, 8001), 2)[:, 1:, 0].T
        assert -0.5 * (1 + 1e-6) <= v.min() <= v.max() <= 2 * (1 + 1e-6)
        assert -2 * (1 + 1e-6) <= a.min() <= a.max() <= 8 * (1 + 1e-6)
        assert found.report.kept
    report = check_motion(
        robot, there, jn.planning.MotionLimits(limits, backward={"slide": jn.Limits(acceleration=1.9)})
    )
    (broken,) = report.broken
    assert (broken.quantity, broken.limit) == ("acceleration", -1.9)
    assert broken.ratio == pytest.approx(2 / 1.9, rel=2e-3)


@pytest.mark.slow
def test_a_pull_that_is_weaker_than_the_push():
    limits = jn.planning.MotionLimits(
        {"slide": jn.Limits(velocity=9.0, effort=4.0, effort_rate=80.0)},
        backward={"slide": jn.Limits(effort=1.0, effort_rate=20.0)},
    )
    found = jn.retime(cart(), LINE, limits)
    force, rate = found.derivatives(np.linspace(0.0, found.stop, 8001), 3)[:, 2:, 0].T  # of a mass of 1 kg
    assert -1 * (1 + 1e-6) <= force.min() < -0.99
    assert 3.9 < force.max() <= 4 * (1 + 1e-6)
    assert -20 * (1 + 1e-6) <= rate.min() < -19
    assert rate.max() <= 80 * (1 + 1e-6)


def test_bad_limits_by_direction_are_named():
    with pytest.raises(RobotError, match=r"backward\.slide: a range has no direction"):
        jn.planning.MotionLimits(backward={"slide": jn.Limits(upper=1.0)})
    with pytest.raises(RobotError, match="did you mean 'slide'"):
        jn.retime(cart(velocity=1.0), LINE, jn.planning.MotionLimits(backward={"slid": jn.Limits(velocity=1.0)}))


@pytest.mark.slow
def test_scaling_reversal_and_looser_limits():
    path = [[-1.0], [0.3], [1.2]]
    limits = {"velocity": 3.0, "effort": 7.0, "effort_rate": 60.0}
    found = jn.retime(pendulum(**limits), path).stop
    assert jn.retime(pendulum(**limits), path[::-1]).stop == pytest.approx(found, rel=2e-3)
    looser = jn.retime(pendulum(**limits | {"effort": 8.0}), path).stop
    assert looser < found
    kinematic = {"velocity": 1.0, "acceleration": 2.0, "jerk": 9.0}
    faster = {"velocity": 2.0, "acceleration": 8.0, "jerk": 72.0}
    slow, fast = (jn.retime(pendulum(**x), path).stop for x in (kinematic, faster))
    assert slow == pytest.approx(2 * fast, rel=2e-4)


@pytest.mark.slow
def test_torque_and_its_rate_are_kept_by_the_closed_form_of_a_pendulum():
    limits = {"velocity": 3.0, "effort": 7.0, "effort_rate": 60.0}
    found = jn.retime(pendulum(**limits), [[-1.0], [0.3], [1.2]])
    q, v, a, j = found.derivatives(np.linspace(0, found.stop, 20001), 3)[:, :, 0].T
    torque, rate = a / 3 + 9.81 / 2 * np.cos(q), j / 3 - 9.81 / 2 * np.sin(q) * v
    assert np.abs(v).max() <= 3 * (1 + 1e-6)
    assert 0.999 < np.abs(torque).max() / 7 <= 1 + 1e-6
    assert 0.99 < np.abs(rate).max() / 60 <= 1 + 1e-6


@pytest.mark.slow
def test_what_binds_has_a_price_that_a_looser_limit_earns():
    limits = {"velocity": SPEED, "acceleration": ACCELERATION, "jerk": JERK}
    found = jn.retime(cart(**limits), LINE)
    price = found.active["price"].sum("s").to_series()
    # of d/v + v/a + a/j, by a share of each limit
    expected = {
        "slide velocity": LENGTH / SPEED - SPEED / ACCELERATION,
        "slide acceleration": SPEED / ACCELERATION - ACCELERATION / JERK,
        "slide jerk": ACCELERATION / JERK,
    }
    for name, value in expected.items():
        assert price[name] == pytest.approx(value, rel=0.05)
    assert bool(found.active["binds"].sel(limit="slide velocity").any())


@pytest.mark.slow
def test_the_order_asked_for_is_that_of_the_continuity_from_rest():
    found = jn.retime(cart(velocity=SPEED, acceleration=ACCELERATION, jerk=JERK), LINE, order=4)
    np.testing.assert_allclose(found.derivatives([0.0], 4)[0, :, 0], 0.0, atol=1e-6)
    assert found.stop == pytest.approx(2.7, rel=5e-3)


@pytest.mark.slow
def test_a_result_is_a_trajectory_like_others():
    robot = cart(velocity=SPEED, acceleration=ACCELERATION)
    found = jn.retime(robot, {"slide": "2*s**2 + 0.1*sin(s)*0"})
    assert isinstance(found, jn.JointTrajectory)
    again = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(again.derivatives([0.3], 3), found.derivatives([0.3], 3))
    assert jn.check_limits(robot, found).kept
    step = 1e-4
    values = found.derivatives(0.7 + step * np.arange(-1, 2), 2)[:, :, 0]
    np.testing.assert_allclose((values[2] - values[0])[:2] / (2 * step), values[1, 1:], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    "path, message",
    [
        ([[0.0], [0.0]], "does not move"),
        ([[0.0], [1.0], [1.0], [2.0]], "waypoint 3 is the same"),
        ([[0.0], [np.nan]], "finite"),
        (np.array([[0.0], [1j]]), "path: must be waypoints of real numbers"),
        ({"slide": [0.0, 1j]}, "path: must be waypoints of real numbers"),
        ({"slide": "abs(s - 0.3)"}, "kink"),
        ({"slide": "s + q"}, "unknown name 'q'"),
        ({"slid": "s"}, "did you mean 'slide'"),
        ([[0.0, 1.0], [1.0, 1.0]], "shape"),
        ([[0.0], [9.0]], "leaves the range"),
    ],
)
def test_bad_paths_are_reported(path, message):
    with pytest.raises(JounceError, match=message):
        jn.retime(cart(velocity=SPEED, acceleration=ACCELERATION, lower=-3.0, upper=3.0), path)


@pytest.mark.slow
def test_a_jump_of_curvature_is_refused_only_where_rates_are_limited():
    bent = {"slide": jn.laws.PiecewiseMotion(["t", "t + (t - 0.5)**2"], until=[0.5])}
    assert jn.retime(cart(velocity=SPEED, acceleration=ACCELERATION), bent).report.kept
    with pytest.raises(TrajectoryError, match=r"curvature at s = 0\.5"):
        jn.retime(cart(velocity=SPEED, acceleration=ACCELERATION, jerk=JERK), bent)


def test_a_static_torque_above_its_limit_is_reported_with_its_place():
    with pytest.raises(TrajectoryError, match=r"pin: .*s = 0\.\d+ \(q = .*4\.9\d* N m.* 4 N m"):
        jn.retime(pendulum(effort=4.0, velocity=1.0), {"pin": "1.2*(1 - 2*s)"})


def test_limits_that_allow_anything_or_nothing_are_reported():
    with pytest.raises(TrajectoryError, match="nothing with a limit moves"):
        jn.retime(cart(), LINE)
    with pytest.raises(SolveError, match="rates at the ends"):
        jn.retime(cart(velocity=SPEED, acceleration=ACCELERATION), LINE, rates=(1.0, 0.0))
    with pytest.raises(RobotError, match="greater than zero"):
        jn.retime(
            cart(velocity=SPEED), LINE, jn.planning.MotionLimits(varying={"slide": {"velocity": lambda q: 1 - q}})
        )
    with pytest.raises(TrajectoryError, match="order"):
        jn.retime(cart(velocity=SPEED, jerk=JERK), LINE, order=1)


@pytest.mark.slow
def test_a_repaired_trajectory_is_nowhere_faster_and_keeps_what_kept():
    limits = {"velocity": 1.0, "acceleration": 3.0}
    given = jn.JointTrajectory.point_to_point(["slide"], [0.0], [1.0], duration=2.0)
    robot = cart(**limits)
    same = jn.retime(robot, given, repair=True)
    assert same.stop == pytest.approx(2.0, abs=1e-9)
    np.testing.assert_allclose(same.derivatives([0.3], 3), given.derivatives([0.3], 3), rtol=1e-9)
    slow = jn.retime(cart(**limits | {"velocity": 0.9}), given, repair=True)
    _, rate = np.asarray(slow.progress(jn.Jet.variable(np.linspace(0, slow.stop, 2001), 1)).derivatives())
    assert rate.max() <= 1 + 1e-9
    assert np.abs(slow.derivatives(slow.times, 1)[:, 1]).max() <= 0.9 * (1 + 1e-6)
    # the time of the stretch that is too fast, at the speed allowed
    v = given.derivatives(np.linspace(0, 2, 20001), 1)[:, 1, 0]
    assert 2.0 < slow.stop < np.sum(np.maximum(v / 0.9, 1.0)) * 1e-4 * 1.003
    with pytest.raises(TrajectoryError, match="only a trajectory"):
        jn.retime(robot, LINE, repair=True)


@pytest.mark.slow
def test_a_trajectory_gives_its_geometry():
    robot = cart(velocity=SPEED, acceleration=ACCELERATION)
    times = np.linspace(0, 3, 301)
    given = jn.JointTrajectory.from_samples(times, LENGTH * (1 - np.cos(np.pi * times / 3))[:, None] / 2, ["slide"])
    found = jn.retime(robot, given)
    assert found.stop == pytest.approx(TRAPEZOID, rel=3e-3)
    assert found.path.deviation < 1e-12


@pytest.mark.parametrize("back, slowest", [(0.3, 0.3), (2.0, 0.5)])
def test_a_limit_backward_holds_beside_that_of_a_joint_that_follows(back, slowest):
    robot = led_cart(-2.0, velocity=1.0)  # so that its leader is no faster than half of that, either way
    limits = jn.planning.MotionLimits(
        {"slide": jn.Limits(velocity=3.0, acceleration=4.0)}, backward={"slide": jn.Limits(velocity=back)}
    )
    for line, fastest in ((LINE, 0.5), (LINE[::-1], slowest)):
        found = jn.retime(robot, line, limits)
        speed = np.abs(found.derivatives(np.linspace(0.0, found.stop, 4001), 1)[:, 1, 0]).max()
        assert fastest * 0.999 < speed <= fastest * (1 + 1e-6)
        expected = LENGTH / fastest + fastest / 4
        assert expected * (1 - 1e-9) < found.stop < expected * 1.003
        assert found.report.kept
