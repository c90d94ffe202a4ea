"""Trajectories and paths that people asked about in public, with values that do not come from this library.

Each test names its source, and says what is right and how that is known.
"""

import json

import numpy as np
import pytest

import jounce as jn
from jounce.cli import main

pytestmark = pytest.mark.slow  # `.ci/run` runs them all, as users do

DISC = jn.Inertia(1.0, center_of_mass=[0, 0, 0], tensor=[0.1, 0.1, 0.1])
LIMITS = jn.Limits(velocity=3.0, acceleration=4.0, jerk=200.0)
URDF = (
    '<robot name="r"><link name="base"/><link name="l"><inertial><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="j" type="revolute"><parent link="base"/><child link="l"/><axis xyz="0 0 1"/>'
    '<limit lower="-20" upper="20" effort="100" velocity="3"/></joint></robot>'
)


@pytest.fixture
def axis():
    """Return a robot of one joint without load."""
    return jn.Robot("axis", [jn.Link("base"), jn.Link("disc", DISC)], [jn.Joint("j", "base", "disc", axis=[0, 0, 1])])


@pytest.fixture
def files(tmp_path):
    """Return a folder with the robot, its limits, and what is written into it."""
    (tmp_path / "r.urdf").write_text(URDF)
    (tmp_path / "limits.yaml").write_text("joints:\n  j: {velocity: 3, acceleration: 10, jerk: 500}\n")
    return tmp_path


def positions(trajectory, name="j", count=4001):
    """Return the positions of a joint at many instants of a trajectory."""
    times = np.linspace(trajectory.start, trajectory.stop, count)
    return trajectory.derivatives(times, order=0)[:, 0, list(trajectory.names).index(name)]


def test_one_joint_through_0_1_10_never_turns_back(axis):
    """TOPP-RA issue 9: a path 0, 1, 10 of one joint went to -0.5 first, through the cubic spline.

    A joint alone has one way between two positions; the fastest motion stays within 0 and 10 and never turns back.
    """
    with pytest.warns(jn.errors.UnitWarning, match="10 rad"):  # of a hinge
        found = positions(jn.retime(axis, {"j": [0.0, 1.0, 10.0]}, {"j": LIMITS}))
    assert found.min() >= -1e-9
    assert found.max() <= 10 + 1e-9
    assert np.diff(found).min() >= -1e-9


def test_a_retimed_path_begins_and_ends_at_rest(axis):
    """TOPP-RA issue 29: velocities at start and end are not zero. Rest is the default, and both ends are reached."""
    found = jn.retime(axis, {"j": [0.2, 0.9, 2.0]}, {"j": LIMITS})
    ends = found.derivatives([found.start, found.stop], order=1)[:, :, 0]
    np.testing.assert_allclose(ends, [[0.2, 0.0], [2.0, 0.0]], atol=1e-9)


def test_an_encoder_that_stands_still_stands_still(axis):
    """MoveIt issue 2183 and TOPP-RA issue 13: splines through dense samples swing where the samples do not.

    An encoder of 0.01 rad reads 0 for a second, a cosine rise of 1 rad, 1 for a second: no motion leaves 0 to 1 rad by
    more than the step of the encoder.
    """
    t = np.linspace(0.0, 3.0, 151)
    rise = 0.5 * (1 - np.cos(np.pi * np.clip(t - 1.0, 0.0, 1.0)))
    log = jn.JointTrajectory.from_samples(t, np.round(rise, 2)[:, None], ["j"])
    try:
        with pytest.warns(jn.errors.RecordingWarning, match="j: .* below three times the noise of the samples"):
            found = positions(jn.retime(axis, log, {"j": LIMITS}))
    except jn.errors.TrajectoryError as error:
        assert "j" in str(error)  # noqa: PT017 - refused by the name of the joint is right, too
    else:
        assert found.min() >= -0.01
        assert found.max() <= 1.01


def test_limits_between_the_points_of_a_driver_are_found(axis):
    """universal_robot issue 207: cubics between points with velocities go over the limits of the robot.

    The cubic from 0 to 1 rad in 1 s with velocities 0 at both ends: 1.5 rad/s in the middle, 6 rad/s^2 at the ends.
    """
    law = jn.laws.HermiteMotion([0.0, 1.0], [[0.0, 0.0], [1.0, 0.0]])
    limits = {"j": jn.Limits(velocity=1.4, acceleration=5.0)}
    report = jn.check_limits(axis, jn.JointTrajectory({"j": law}, start=0.0, stop=1.0), limits)
    rows = {row.quantity: row for row in report.rows}
    assert abs(rows["velocity"].value) == pytest.approx(1.5, rel=1e-9)
    assert abs(rows["acceleration"].value) == pytest.approx(6.0, rel=1e-9)
    assert not report.kept


def goal(*points):
    """Return a trajectory file of positions alone, as a controller's goal."""
    lines = [f"- {{positions: [{q}], time_from_start: {{sec: {s}, nanosec: 0}}}}" for s, q in enumerate(points)]
    return "joint_names: [j]\npoints:\n" + "\n".join(lines) + "\n"


def test_two_points_without_velocities_begin_with_a_jump(files, capsys):
    """ros2_controllers issue 669, ros_controllers issue 626: positions alone are joined by straight lines.

    From 0 to 1.57 rad in 1 s the joint starts at 1.57 rad/s: a controller at rest meets a jump, which no limit of
    acceleration allows.
    """
    (files / "goal.yaml").write_text(goal(0.0, 1.57))
    command = ["check", f"{files}/r.urdf", f"{files}/goal.yaml", "--limits", f"{files}/limits.yaml"]
    status = main(command)
    printed = capsys.readouterr()
    printed = (printed.out + printed.err).lower()
    assert "positions" in printed
    assert "velocity" in printed
    assert "all limits kept" not in printed
    assert status == 1


def test_the_last_hundredth_of_a_second_is_looked_at(files, capsys):
    """Choreo pull 277 and others: the end point of a trajectory is left out.

    1.2 t^2 to 1 s in steps of 30 ms: 2.4 rad/s at the end, over a limit of 2.39 that all multiples of 30 ms keep.
    """
    (files / "law.yaml").write_text('joints: {j: "1.2*t**2"}\ntime: {start: 0 s, stop: 1 s, step: 30 ms}\n')
    (files / "tight.yaml").write_text("joints:\n  j: {velocity: 2.39, acceleration: 10, jerk: 500}\n")
    command = ["check", f"{files}/r.urdf", f"{files}/law.yaml", "--limits", f"{files}/tight.yaml", "--json"]
    status = main(command)
    assert status == 1
    rows = json.loads(capsys.readouterr().out)
    assert "2.4" in json.dumps(rows)


def test_degrees_where_radians_are_meant_are_reported(files, capsys):
    """scikit-robot pull 150, dm_control issue 331: joint angles in degrees, used as radians.

    -90 for a joint is 14 turns.
    """
    (files / "log.csv").write_text("time,j\n" + "".join(f"{0.1 * k:.1f},{-3.0 * k}\n" for k in range(31)))
    main(["torques", f"{files}/r.urdf", f"{files}/log.csv"])
    printed = capsys.readouterr()
    assert "degree" in (printed.out + printed.err).lower()
