"""What commands say of the ends of trajectories, and of positions alone; and the deviation of ``retime``."""

import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from jounce.reporting.json.result_schema import result_schema
from tests.cli.robot_commands.test_check import PENDULUM

POINTS = """joint_names: [pin]
points:
- {positions: [0.0], time_from_start: {sec: 0, nanosec: 0}}
- {positions: [0.8], time_from_start: {sec: 1, nanosec: 0}}
"""
ALONE = "positions alone: straight lines between 2 points"
STARTS, STOPS = (
    "starts in motion: pin 0.8, rad/s or m/s, at t = 0 s",
    "stops in motion: pin 0.8, rad/s or m/s, at t = 1 s",
)


@pytest.fixture
def files(tmp_path):
    robot, motion = tmp_path / "pendulum.urdf", tmp_path / "motion.yaml"
    robot.write_text(PENDULUM)
    motion.write_text(POINTS)
    return robot, motion


def result(command, text):
    found = json.loads(text)
    Draft202012Validator(result_schema()["$defs"][command]).validate(found)
    return found


def test_a_jump_from_rest_is_reported_and_not_kept_unless_it_is_handed_over(run, files):
    status, out, _ = run("check", *files)
    assert status == 1
    assert "all limits kept" not in out.lower()
    assert all(line in out for line in (ALONE, STARTS, STOPS))
    assert "infinite by the jump from rest at the start: torque of pin" in out
    assert max(map(len, out.splitlines())) <= 80
    status, out, _ = run("check", *files, "--hand-over")
    assert status == 0
    assert STARTS in out
    status, out, _ = run("check", *files, "--json")
    record = result("check", out)
    assert (status, record["kept"], record["broken"], record["hand_over"]) == (1, False, 0, False)
    start = record["ends"][0]
    assert (start["at_rest"], start["velocities"]) == (False, {"pin": pytest.approx(0.8)})
    assert start["breaks"] == [{"name": "pin", "quantity": "torque"}]
    assert record["between"]["words"] == ALONE


def test_torques_and_exports_tell_the_same(run, files, tmp_path):
    _, out, _ = run("torques", *files)
    assert all(line in out for line in (ALONE, STARTS, STOPS))
    _, text, _ = run("torques", *files, "--json")
    record = result("torques", text)
    assert record["ends"][1]["velocities"] == {"pin": pytest.approx(0.8)}
    assert record["between"]["words"] == ALONE
    _, out, _ = run("export", *files, "--format", "ros", "--out", tmp_path / "out.yaml")
    assert all(line in out for line in (ALONE, STARTS, STOPS))


def test_how_far_splines_are_from_straight_lines_is_reported(run, files, tmp_path):
    few = tmp_path / "few.csv"
    few.write_text("time,pin\n" + "".join(f"{t},{x}\n" for t, x in enumerate([0, 0, 0, 0.5, 0.5, 0.5])))
    _, text, _ = run("check", files[0], few, "--json")
    record = json.loads(text)["between"]
    t = np.linspace(0, 5, 20001)
    q = np.polyval(np.polyfit(np.arange(6), [0, 0, 0, 0.5, 0.5, 0.5], 5), t)
    assert record["deviation"] == pytest.approx(max(-q.min(), q.max() - 0.5), rel=1e-2)
    _, out, _ = run("check", files[0], few)
    assert f"at most {record['deviation']:.2g} rad or m from straight lines, pin" in out


@pytest.mark.slow
def test_a_path_stays_as_close_to_samples_as_reported(run, files, tmp_path):
    limits, given, out = tmp_path / "limits.yaml", tmp_path / "dwells.csv", tmp_path / "fast.csv"
    limits.write_text("joints: {pin: {velocity: 2, acceleration: 10, jerk: 500}}")
    t = np.linspace(0.0, 4.0, 201)
    x = np.clip((t - 1) / 2, 0, 1)
    rise = np.round(0.9 * x**3 * (10 - 15 * x + 6 * x**2), 4)
    given.write_text("time,pin\n" + "".join(f"{a:g},{b:g}\n" for a, b in zip(t, rise, strict=True)))
    status, text, _ = run(
        "retime", files[0], given, "--limits", limits, "--out", out, "--deviation", "0.02deg", "--json"
    )
    record = result("retime", text)
    assert (status, record["kept"]) == (0, True)
    assert record["deviation"] <= record["deviation_allowed"] == pytest.approx(np.radians(0.02))
    assert record["path"].startswith("within 0.000349 rad or m of each of 201 samples")
    q = np.loadtxt(out, delimiter=",", skiprows=1)[:, 1]
    assert (q[0], q[-1]) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.9, abs=1e-12))
    assert (np.diff(q) >= -1e-12).all()
    assert run("check", files[0], out, "--limits", limits)[0] == 0


@pytest.mark.parametrize(
    "text, words", [("0", "greater than zero"), ("3 s", "an angle or a length"), ("x", "--deviation")]
)
def test_a_deviation_that_is_none_is_reported(run, files, text, words):
    status, _, error = run("retime", *files, "--deviation", text)
    assert status == 2
    assert words in error
