"""Trajectories as controllers take them: written, read back and compared; what does not fit is told."""

import json
import re

import numpy as np
import pytest
import yaml

import jounce as jn
from tests.problems.robots import robot_named

UR5 = tuple(f"{part}_joint" for part in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"))
PANDA = tuple(f"panda_joint{k}" for k in range(1, 8))


def rest_to_rest(names, duration, start=0.5):
    generator = np.random.default_rng(0)
    ends = generator.uniform(-1, 1, (2, len(names)))
    return jn.JointTrajectory.point_to_point(names, *ends, "polynomial_4_5_6_7", duration, start)


@pytest.mark.parametrize("name, file, joints", [("ur5", "ur", UR5), ("panda", "franka", PANDA), ("ur5", "ros", UR5)])
def test_what_is_written_is_read_back(tmp_path, name, file, joints):
    robot, motion = robot_named(name), rest_to_rest(joints, 0.2)
    path = tmp_path / ("motion.yaml" if file == "ros" else "motion.csv")
    times = jn.io.export_trajectory(robot, motion, path, file, torques=True)
    again = jn.load_trajectory(path, joints=joints)
    assert again.names == joints
    since = 0.5 if file == "ros" else 0.0  # a message counts from its own start
    assert np.allclose(again.times + since, times, rtol=0, atol=1e-15)
    exact = motion.derivatives(times, 2)
    scale = np.abs(exact).max(axis=(0, 2))
    assert (np.abs(again.derivatives(again.times, 2) - exact).max(axis=(0, 2)) <= 1e-13 * scale).all()
    between = 0.5 * (times[:-1] + times[1:])
    apart = np.abs(again.derivatives(between - since, 2) - motion.derivatives(between, 2)).max(axis=(0, 2))
    assert (apart <= 1e-3 * scale).all()
    if file == "ros":
        message = yaml.safe_load(path.read_text())
        assert message["joint_names"] == list(joints)
        assert all(isinstance(x, float) for point in message["points"] for x in point["effort"])
        assert message["points"][3]["time_from_start"] == {"sec": 0, "nanosec": 30_000_000}
        tau = np.array([point["effort"] for point in message["points"]])
        felt, drives = robot, True
    else:
        with path.open() as stream:
            heading = stream.readline().strip().split(",")
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        level = {"ur": "target_moment", "franka": "tau_J_d"}[file]
        tau = table[:, [heading.index(f"{level}_{k}") for k in range(len(joints))]]
        felt, drives = (robot, True) if file == "ur" else (robot.with_gravity([0, 0, 0]), False)
        assert np.allclose(np.diff(table[:, 0]), {"ur": 0.002, "franka": 0.001}[file], rtol=1e-12)
    q = np.zeros((len(times), 4, len(robot.joint_names)))
    q[..., [robot.joint_names.index(n) for n in joints]] = motion.derivatives(times, 3)
    needed = jn.inverse_dynamics(felt, q, drives=drives)[..., [robot.joint_names.index(n) for n in joints]]
    assert np.allclose(tau, needed[:, 0], rtol=0, atol=1e-12 * np.abs(needed[:, 0]).max())
    if file == "franka":
        rates = table[:, [heading.index(f"dtau_J_d_{k}") for k in range(7)]]
        assert np.allclose(rates, needed[:, 1], rtol=0, atol=1e-12 * np.abs(needed[:, 1]).max())


def test_a_period_that_does_not_divide_the_duration(tmp_path):
    robot, path = robot_named("ur5"), tmp_path / "motion.csv"
    motion = rest_to_rest(UR5, 0.2031)
    times = jn.io.export_trajectory(robot, motion, path, "ur", 125.0)
    assert times[-2] < motion.stop < times[-1]
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.array_equal(table[-1, 1:7], motion.derivatives([motion.stop], 0)[0, 0])
    assert np.allclose(table[-1, 7:], 0.0, atol=1e-9)
    moving = jn.JointTrajectory(dict.fromkeys(UR5, "t"), 0.0, 0.2031)
    with pytest.raises(jn.errors.TrajectoryError, match="does not divide the duration"):
        jn.io.export_trajectory(robot, moving, path, "ur")
    times = jn.io.export_trajectory(robot, moving, tmp_path / "motion.yaml", "ros", 100.0)
    assert times[-1] == 0.2031
    assert len(times) == 22
    assert jn.load_trajectory(tmp_path / "motion.yaml").names == UR5


def test_order_and_names_of_joints(tmp_path):
    robot, path = robot_named("ur5"), tmp_path / "motion.csv"
    laws = {name: float(k) for k, name in enumerate(UR5)}
    motion = jn.JointTrajectory(dict(reversed(laws.items())), 0.0, 0.1)
    jn.io.export_trajectory(robot, motion, path, "ur", header_units=True)
    assert path.read_text().startswith("timestamp [s],target_q_0 [rad],target_q_1 [rad]")
    found = jn.load_trajectory(path)
    assert found.names == tuple(f"joint_{k}" for k in range(6))
    assert found.derivatives([0.0], 0)[0, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    jn.io.export_trajectory(robot, motion, path, "ur", joints=UR5[::-1])
    assert jn.load_trajectory(path, joints=UR5[::-1]).derivatives([0.0], 0, UR5)[0, 0].tolist() == list(range(6))


@pytest.mark.parametrize(
    "settings, words",
    [
        ({"format": "abb"}, "no controller format"),
        ({"format": "franka"}, "has 7 joints"),
        ({"rate": 300.0}, "takes 125 or 250 or 500 or 1000 rows"),
        ({"format": "ros", "path": "x.csv"}, r"\.yaml"),
        ({"rate": -1.0, "format": "ros", "path": "x.yaml"}, "greater than zero"),
        ({"joints": ["elbow"]}, "elbow_joint"),
        ({"joints": ["elbow_joint"] * 6}, "named twice"),
        ({"path": "none/x.csv"}, "folder"),
    ],
)
def test_what_does_not_fit_is_reported(tmp_path, settings, words):
    settings = {"format": "ur", "path": "x.csv", **settings}
    path = tmp_path / settings.pop("path")
    with pytest.raises(jn.errors.JounceError, match=words):
        jn.io.export_trajectory(robot_named("ur5"), rest_to_rest(UR5, 0.1), path, **settings)
    assert not path.exists()


POINT = "- positions: [1.0]\n  time_from_start: {sec: 0, nanosec: 0}\n"


@pytest.mark.parametrize(
    "text, words",
    [
        ("joint_names: [a]\npoints: []\n", "two points"),
        ("joint_names: a\npoints: []\n", "list of names"),
        (
            f"joint_names: [a]\npoints:\n{POINT}{POINT.replace('1.0', '2.0')}",
            "after that of the point before, which is",
        ),
        (f"joint_names: [a]\npoints:\n{POINT}- positions: [1.0, 2.0]\n", "1 finite numbers"),
        (
            f"joint_names: [a]\npoints:\n{POINT}- positions: [2.0]\n",
            r"line 5, points\[1\]\.time_from_start: is missing",
        ),
        (
            f"joint_names: [a]\npoints:\n{POINT}- positions: [2.0]\n  time_from_start: 1 s\n",
            "must be a time, as {sec: 1",
        ),
        (
            f"joint_names: [a]\npoints:\n{POINT}- positions: [2.0]\n  time_from_start: -1\n",
            "must be a time, as {sec: 1",
        ),
        (f"joint_names: [a]\npoints:\n{POINT}- positions: [2.0]\n  time_from_start: {{sec: 1.5}}\n", "whole number"),
        ("joint_names: [a]\npoints:\n- velocities: [0.0]\n- velocities: [0.0]\n", "positions are missing"),
    ],
)
def test_faults_of_messages_are_reported_with_their_line(tmp_path, text, words):
    path = tmp_path / "message.yaml"
    path.write_text(text)
    with pytest.raises(jn.errors.TrajectoryError, match=words) as caught:
        jn.load_trajectory(path)
    assert re.match(r".*message\.yaml", str(caught.value))


@pytest.mark.parametrize("listed", [False, True])
def test_times_of_points_may_be_numbers_of_seconds_and_a_list_may_hold_one_message(tmp_path, listed):
    points = [{"positions": [x], "time_from_start": t} for t, x in ((0, 1.0), (0.5, 2.0), (1.25, 2.5))]
    message = {"joint_names": ["a"], "points": points}
    path = tmp_path / "message.json"
    path.write_text(json.dumps([message] if listed else message))
    values = jn.load_trajectory(path).derivatives([0.0, 0.25, 0.5, 1.25], 0, ["a"])
    np.testing.assert_allclose(np.ravel(values), [1.0, 1.5, 2.0, 2.5], rtol=1e-14)


def test_faults_of_tables_are_reported(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("timestamp,target_q_0,target_qd_0\n0,1,0\n0,2,0\n")
    with pytest.raises(jn.errors.TrajectoryError, match="line 3, time: must come after"):
        jn.load_trajectory(path)
    path.write_text("timestamp,target_q_0,actual_q_0\n0,1,x\n0.5,2,y\n")
    with pytest.warns(jn.errors.RecordingWarning, match=r"line 1: measured positions are left out \(actual_q_0 and"):
        commanded = jn.load_trajectory(path, joints=["a"], as_controller=True)
    assert commanded.derivatives([0.25], 0)[0, 0, 0] == 1.5
    path.write_text("timestamp,target_q_0\n0,1\n0.5,2\n")
    with pytest.raises(jn.errors.TrajectoryError, match="as many different names"):
        jn.load_trajectory(path, joints=["a", "b"])
    path.write_text("time,elbow\n" + "".join(f"{k},{k}\n" for k in range(8)))
    with pytest.raises(jn.errors.TrajectoryError, match="names its joints"):
        jn.load_trajectory(path, joints=["a"])
