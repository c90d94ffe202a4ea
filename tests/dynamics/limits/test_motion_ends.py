"""Ends of trajectories: what does not rest there, and which limits a jump from rest, or to it, breaks."""

import numpy as np
import pytest

import jounce as jn
from jounce.dynamics.limits.motion_ends import trajectory_ends
from jounce.planning.retiming.quantities.motion_limits_check import check_motion

ROD = jn.Inertia(1.0, center_of_mass=[0.2, 0, 0], tensor=[0.02, 0.03, 0.04])


def arm(**limits):
    joints = [
        jn.Joint("a", "base", "upper", limits=jn.Limits(**limits)),
        jn.Joint("b", "upper", "lower", position=[0.4, 0, 0], limits=jn.Limits(**limits)),
    ]
    return jn.Robot("arm", [jn.Link("base"), jn.Link("upper", ROD), jn.Link("lower", ROD)], joints)


def motion(law, stop=1.0):
    return jn.JointTrajectory({"a": law, "b": 0.0}, 0.0, stop)


LINE = jn.laws.HermiteMotion([0.0, 1.0], [[0.0], [1.57]])
RISE = jn.laws.HermiteMotion([0.0, 1.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    "law, start, stop",
    [
        (LINE, ({"a": 1.57}, {}), ({"a": 1.57}, {})),  # positions alone; the last instant belongs to it
        ("sin(t)", ({"a": 1.0}, {}), ({"a": np.cos(1)}, {"a": -np.sin(1)})),
        ("t**2", ({}, {"a": 2.0}), ({"a": 2.0}, {"a": 2.0})),
        ("t**3", ({}, {}), ({"a": 3.0}, {"a": 6.0})),
        (RISE, ({}, {}), ({}, {})),
        ("0.3", ({}, {}), ({}, {})),
    ],
)
def test_what_is_met_at_the_ends(law, start, stop):
    for found, (velocities, accelerations) in zip(trajectory_ends(arm(), motion(law)), (start, stop), strict=True):
        assert found.velocities == pytest.approx(velocities, rel=1e-8)
        assert found.accelerations == pytest.approx(accelerations, rel=1e-8)
        assert found.at_rest == (not velocities and not accelerations)


def test_samples_end_at_rest_up_to_what_splines_make_of_their_errors():
    t = np.linspace(0.0, 1.0, 501)
    rise = t**3 * (10 - 15 * t + 6 * t**2)
    for digits in (3, 4, 6, 9, 15):
        for speed in (0.0, 0.7):
            values = np.round(rise + speed * t, digits)
            ends = trajectory_ends(arm(), jn.JointTrajectory.from_samples(t, values[:, None], ["a"]))
            for end in ends:
                assert end.velocities == pytest.approx({"a": speed} if speed else {}, rel=0.2)
                assert end.accelerations == {}


def broken(report, end):
    return {(owner, quantity) for x in report.ends if x.end == end for owner, quantity in x.breaks}


EVERY = {"velocity": 9.0, "acceleration": 99.0, "jerk": 999.0, "effort": 99.0, "effort_rate": 9999.0}
FORCES = {("a", "acceleration"), ("a", "jerk"), *((x, y) for x in "ab" for y in ("torque", "torque rate"))}
RATES = {("a", "jerk"), ("a", "torque rate"), ("b", "torque rate")}


@pytest.mark.parametrize(
    "law, start, stop",
    [(LINE, FORCES, FORCES), ("t**2", RATES, FORCES), ("t**3", set(), FORCES), (RISE, set(), set())],
)
def test_what_is_infinite_by_a_jump_at_an_end_is_not_kept(law, start, stop):
    report = jn.check_limits(arm(**EVERY), motion(law))
    assert (broken(report, "start"), broken(report, "stop")) == (start, stop)
    assert report.broken == ()  # within the motion nothing is
    assert report.kept == (not start and not stop)
    handed = jn.check_limits(arm(**EVERY), motion(law), hand_over=True)
    assert handed.kept
    assert [x.velocities for x in handed.ends] == [x.velocities for x in report.ends]


def test_only_limits_there_are_can_be_broken():
    assert jn.check_limits(arm(velocity=9.0), motion(LINE)).kept
    assert broken(jn.check_limits(arm(acceleration=9.0), motion(LINE)), "start") == {("a", "acceleration")}
    slowing = jn.check_limits(arm(deceleration=9.0), motion(LINE))
    assert (broken(slowing, "start"), broken(slowing, "stop")) == (set(), {("a", "acceleration")})


@pytest.mark.slow
def test_limits_of_other_kinds_are_broken_too():
    limits = jn.planning.MotionLimits(
        points=(
            jn.planning.PointLimits("upper", acceleration=99.0, point=(0.3, 0.0, 0.0)),
            jn.planning.PointLimits("base", speed=1.0),
        ),
        jounce={"a": 1e6},
        varying={"a": {"jerk": lambda q: 1e6 + 0 * q}},
    )
    point = ("upper", "acceleration of the point")
    for law, found in (
        (LINE, {("a", "jerk"), ("a", "jounce"), point}),
        (RISE, {("a", "jounce")}),
        ("t**4*(1 - t)**4", set()),
    ):
        report = check_motion(arm(), motion(law), limits)
        assert (broken(report, "start"), broken(report, "stop")) == (found, found)
        assert report.kept == (not found)
        assert check_motion(arm(), motion(law), limits, hand_over=True).kept


@pytest.mark.slow
def test_what_is_retimed_rests_unless_rates_are_given():
    robot = arm(velocity=2.0, acceleration=5.0, jerk=50.0)
    path = {"a": "s", "b": "0.3*sin(s)"}
    found = jn.retime(robot, path)
    assert found.report.kept
    assert all(end.at_rest for end in found.report.ends)
    assert jn.check_limits(robot, found).kept
    moving = jn.retime(robot, path, rates=(0.2, 0.0))
    assert (moving.report.kept, moving.report.hand_over) == (True, True)
    assert moving.report.ends[0].velocities == pytest.approx({"a": 0.2, "b": 0.06}, rel=1e-6)
    assert not jn.check_limits(robot, moving).kept


def test_a_trajectory_that_starts_in_motion_is_repaired_only_if_it_is_handed_over():
    robot = arm(velocity=2.0, acceleration=5.0)
    with pytest.raises(jn.errors.TrajectoryError, match=r"does not rest at its start.*acceleration of a is infinite"):
        jn.retime(robot, motion("1.9*t"), repair=True)
    assert jn.retime(robot, motion("1.9*t"), repair=True, hand_over=True).report.kept


def test_doubts_about_degrees_are_reported_once():
    swing = jn.JointTrajectory.from_samples(
        np.linspace(0, 1, 50), 45 * np.sin(3 * np.linspace(0, 1, 50))[:, None], ["a"]
    )
    with pytest.warns(jn.errors.UnitWarning) as caught:
        check_motion(arm(), swing, jn.planning.MotionLimits(jounce={"a": 1e9}))
    assert len(caught) == 1
