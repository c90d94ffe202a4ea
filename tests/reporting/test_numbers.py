"""Instants of logs, which may be counted from 1970, are told apart in all tables."""

import pytest

import jounce as jn
from jounce.dynamics.limits.trajectories import trajectory_torques
from jounce.reporting.peaks import table_peaks
from jounce.reporting.text.tables import limits_table, peaks_table
from jounce.units.instants import time_text

EPOCH = 1732686000.0


@pytest.mark.parametrize(
    "time, text",
    [(-0.5, "-0.5"), (9999.5, "9999.5"), (12345.678, "12345.678"), (-EPOCH, "-1732686000"), (2e4, "20000")],
)
def test_digits_of_instants(time, text):
    assert time_text(time) == text


def test_tables_of_a_log_name_its_instants():
    rod = jn.Inertia(1.0, center_of_mass=[0.2, 0, 0], tensor=[0.02, 0.03, 0.04])
    joint = jn.Joint("j", "base", "a", "revolute", limits=jn.Limits(velocity=4.0))
    robot = jn.Robot("arm", [jn.Link("base"), jn.Link("a", rod)], [joint], gravity=[0, 0, 0])
    law = f"sin(pi*(t - {EPOCH:.0f} - 1/4))"  # s, fastest at 0.25 s and, backward, at 1.25 s
    trajectory = jn.JointTrajectory({"j": law}, EPOCH, EPOCH + 1.0)
    (velocity,) = (row for row in limits_table(jn.check_limits(robot, trajectory)).rows if row[1] == "velocity")
    assert float(velocity[-1]) - EPOCH == 0.25
    torque = peaks_table(table_peaks(trajectory_torques(robot, trajectory))).rows[0]
    assert torque[0] == "j"
    for k in (4, 6):  # of a sine, at an end or where it is slowest
        assert float(torque[k]) - EPOCH in (0.0, 0.75)
