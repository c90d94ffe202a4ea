"""Paths of trajectories that turn back, or stop at corners: they go where the trajectories go."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.planning.paths.paths import path_of
from jounce.planning.paths.trajectory_paths import Ramps
from jounce.trajectory.law_checks.smoothness import knots

THERE, BACK = jn.laws.Segment("cycloidal", 1.0, to=0.5), jn.laws.Segment("cycloidal", 1.3, to=0.0)


def places(path, count=20001):
    return path.derivatives(np.linspace(path.start, path.stop, count), 3)


@pytest.mark.parametrize(
    "law, stop",
    [
        ("0.5*sin(3*t)**2", np.pi / 3),
        ("0.5*sin(3*t)**2", np.pi),  # back and forth, again and again
        (jn.laws.SegmentedMotion([THERE, BACK]), 2.3),
        (jn.laws.SegmentedMotion([THERE, jn.laws.Segment("dwell", 0.4), BACK]), 2.7),
    ],
    ids=["squared sine", "three turns", "segments", "a stay"],
)
def test_a_turning_point_belongs_to_the_path(law, stop):
    path = path_of(jn.JointTrajectory({"j": law, "k": 0.0}, 0.0, stop))
    values = places(path)[:, :, 0]
    assert values[:, 0].max() == pytest.approx(0.5, abs=1e-7)  # the turn is between two of the places
    assert path.deviation < 1e-9 * np.abs(np.diff(values[:, 0])).sum()
    turns = np.flatnonzero(np.diff(np.sign(values[:, 1])))
    assert len(turns) % 2 == 1
    # over the parameter the positions are smooth, and their second derivative does not vanish where they turn
    assert np.abs(values[turns, 2]).min() > 0.5
    assert np.abs(np.diff(values[:, 2])).max() < 0.1 * np.abs(values[:, 2]).max()


def test_joints_that_turn_together_stay_on_their_line():
    path = path_of(jn.JointTrajectory({"j": "0.5*sin(3*t)**2", "k": "-0.3*sin(3*t)**2"}, 0.0, 2 * np.pi / 3))
    j, k = places(path)[:, 0].T
    np.testing.assert_allclose(k, -0.6 * j, atol=1e-9)
    assert j.max() == pytest.approx(0.5, abs=1e-7)
    assert path.deviation < 1e-9


@pytest.mark.parametrize("order", [1, pytest.param(2, marks=pytest.mark.slow), 3])
def test_a_corner_at_which_a_trajectory_stands_still_is_kept(order):
    first = jn.laws.SegmentedMotion([THERE, jn.laws.Segment("dwell", 1.3)])
    second = jn.laws.SegmentedMotion([jn.laws.Segment("dwell", 1.0), jn.laws.Segment("cycloidal", 1.3, to=0.4)])
    path = path_of(jn.JointTrajectory({"j": first, "k": second}, 0.0, 2.3), order=order)
    j, k = places(path)[:, 0].T
    assert np.minimum(np.abs(k), np.abs(j - 0.5)).max() < 1e-9  # on one side of the corner, or on the other
    corner = path.start + (path.stop - path.start) * np.argmin(np.abs(j - 0.5) + np.abs(k)) / 20000
    there, elsewhere = path.derivatives(np.array([corner]), order)[0], np.abs(places(path)).max(axis=(0, 2))
    assert (np.abs(there).max(axis=1) < 1e-2 * elsewhere[: order + 1])[1:].all()
    # one joint moves until the stop and the other from it on, also where the length changes by less than its rounding
    stop = knots(path.laws["j"], path.start, path.stop)
    stop = stop[np.argmin(np.abs(path.derivatives(stop, 1)[:, 1]).max(axis=1))]
    beside = np.geomspace(1e-9, 1e-3, 13)
    before, after = (np.abs(path.derivatives(stop + side * beside, 1)[:, 1].T) for side in (-1, 1))
    assert (before[1] <= 1e-6 * before[0]).all()
    assert (after[0] <= 1e-6 * after[1]).all()


def test_a_path_that_bends_is_followed_closely():
    circle = {"j": "0.3*cos(2*pi*(10*t**3 - 15*t**4 + 6*t**5))", "k": "0.3*sin(2*pi*(10*t**3 - 15*t**4 + 6*t**5))"}
    path = path_of(jn.JointTrajectory(circle, 0.0, 1.0))
    values = places(path)
    off = np.abs(np.linalg.norm(values[:, 0], axis=1) - 0.3).max()
    assert off <= path.deviation < 1e-8


@pytest.mark.parametrize("power", [2, 3, 4])
def test_a_ramp_and_its_motion_are_inverse(power):
    ramps = Ramps(np.array([0.3, 0.7]), np.array([0.1, 0.15]), power)
    lengths = np.linspace(0.0, 1.0, 1001)
    motion = ramps.motion(1.0)
    found = np.asarray(motion(jn.Jet.variable(ramps.parameter(lengths), 0)).derivatives()[0])
    np.testing.assert_allclose(found, lengths, atol=1e-12)


@pytest.mark.slow
def test_a_motion_there_and_back_takes_as_long_as_its_closed_form_says():
    robot = jn.Robot(
        "p", [jn.Link("base"), jn.Link("a", jn.Inertia(1.0))], [jn.Joint("j", "base", "a", "prismatic", axis=[1, 0, 0])]
    )
    path = jn.JointTrajectory({"j": "0.5*sin(3*t)**2"}, 0.0, np.pi / 3)
    found = jn.retime(robot, path, {"j": jn.Limits(acceleration=5.0)})
    assert 4 * np.sqrt(0.5 / 5.0) * (1 - 1e-9) < found.stop < 4 * np.sqrt(0.5 / 5.0) * 1.003
    assert found.report.kept
    assert found.derivatives(np.linspace(0.0, found.stop, 20001), 0)[:, 0, 0].max() == pytest.approx(0.5, abs=1e-8)


def test_what_does_not_move_is_reported():
    with pytest.raises(TrajectoryError, match="does not move"):
        path_of(jn.JointTrajectory({"j": 1.0}, 0.0, 1.0))


@pytest.mark.slow
def test_a_stop_at_a_corner_keeps_limits_of_jerk():
    limits = jn.Limits(velocity=2.0, acceleration=8.0, jerk=200.0)
    links = [jn.Link("base"), jn.Link("a", jn.Inertia(1.0)), jn.Link("b", jn.Inertia(1.0))]
    j = jn.Joint("j", "base", "a", "prismatic", axis=[1, 0, 0], limits=limits)
    k = jn.Joint("k", "a", "b", "prismatic", axis=[0, 1, 0], limits=limits)
    first = jn.laws.SegmentedMotion([jn.laws.Segment("cycloidal", 1.0, to=0.7), jn.laws.Segment("dwell", 1.3)])
    second = jn.laws.SegmentedMotion([jn.laws.Segment("dwell", 1.0), jn.laws.Segment("cycloidal", 1.3, to=0.3)])
    trajectory = jn.JointTrajectory({"j": first, "k": second}, 0.0, 2.3)
    fast = jn.retime(jn.Robot("gantry", links, [j, k]), trajectory, cells=40)
    assert fast.report.kept
    # of each way alone: 0.7 m reaches all limits, 0.3 m does not reach the velocity
    peak = 4 * (np.sqrt(0.04**2 + 0.3 / 2) - 0.04)
    least = 0.7 / 2 + 2 / 8 + 8 / 200 + 2 * 0.3 / peak
    assert least < fast.stop < 1.03 * least
    times, step = np.linspace(0.0, fast.stop, 2001, retstep=True)
    differences = np.asarray(fast.derivatives(times, 0)).reshape(-1, 2)
    for limit in (2.0, 8.0, 200.0):
        differences = np.diff(differences, axis=0) / step
        assert 0.9 * limit < np.abs(differences).max() < limit * (1 + 1e-4)
