"""Loads that links carry during parts of a motion, against a pendulum with a point mass on paper."""

import numpy as np
import pytest

import jounce as jn
from jounce.errors import TrajectoryError
from jounce.robot import CarriedLoad

G = 9.81
TIP = jn.Inertia(0.5, center_of_mass=[1.0, 0, 0])


def pendulum(**limits):
    rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0], limits=jn.Limits(**limits))
    return jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin])


def moment(t, carried):
    """Torque and its rate for the angle t^3 / 3."""
    q, q1, q2, q3 = t**3 / 3, t**2, 2 * t, 2.0
    inertia, weight = 1 / 3 + 0.5 * carried, (0.5 + 0.5 * carried) * G
    return np.stack([inertia * q2 + weight * np.cos(q), inertia * q3 - weight * np.sin(q) * q1], axis=-1)


def test_torques_follow_what_is_carried():
    trajectory = jn.JointTrajectory({"pin": "t**3/3"}, 0.0, 2.0)
    loads = [CarriedLoad("rod", TIP, 0.5, 1.5), CarriedLoad("rod", TIP, 1.0)]
    times = np.linspace(0.0, 2.0, 41)
    found = jn.dynamics.trajectory_torques(pendulum(), trajectory, rates=1, times=times, loads=loads)["pin"].values
    carried = 1.0 * ((times >= 0.5) & (times < 1.5)) + (times >= 1.0)
    np.testing.assert_allclose(found, moment(times, carried), rtol=1e-12)


def test_both_sides_of_a_change_are_compared_with_limits_and_the_step_is_reported():
    trajectory, load = jn.JointTrajectory({"pin": "t**3/3"}, 0.0, 2.0), CarriedLoad("rod", TIP, 0.8, 1.2)
    whole = jn.check_limits(pendulum(effort=50.0, effort_rate=100.0), trajectory, loads=[load], hand_over=True)
    torque, rate = (next(row for row in whole.rows if row.quantity == word) for word in ("torque", "torque rate"))
    at, free = np.linspace(0.8, 1.2, 400_001), np.linspace(0.0, 2.0, 400_001)
    free = free[(free < 0.8) | (free > 1.2)]
    for row, level in ((torque, 0), (rate, 1)):
        most = max(np.abs(moment(at, 1.0)[:, level]).max(), np.abs(moment(free, 0.0)[:, level]).max())
        assert abs(row.value) == pytest.approx(most, rel=1e-9)
    up, down = whole.loads
    assert (up.time, up.masses["rod"], down.masses["rod"]) == (0.8, 0.5, -0.5)
    assert up.speed == pytest.approx(0.8**2, rel=1e-12)
    assert down.steps["pin"] == pytest.approx(moment(1.2, 0.0)[0] - moment(1.2, 1.0)[0], rel=1e-12)


def test_what_cannot_be_is_reported():
    trajectory = jn.JointTrajectory({"pin": "t**3/3"}, 0.0, 2.0)
    for loads, words in (
        ([CarriedLoad("rod", TIP, 0.5, 3.0)], "outside of the motion"),
        ([CarriedLoad("hand", TIP, 0.5, 1.0)], "hand"),
        ([CarriedLoad("rod", TIP, 2, by="waypoint")], "instants, not by waypoint"),
    ):
        with pytest.raises(TrajectoryError, match=words):
            jn.check_limits(pendulum(effort=50.0), trajectory, loads=loads)
    for wrong in ({"start": 1.0, "stop": 1.0}, {"start": np.nan}, {"start": 1.5, "by": "waypoint"}):
        with pytest.raises(TrajectoryError):
            CarriedLoad("rod", TIP, **wrong)
