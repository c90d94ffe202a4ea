"""The command that smooths logs."""

import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import jounce as jn
from jounce.cli import main
from jounce.cli.robot_commands.retiming import deviation_of
from jounce.errors import UnitWarning
from jounce.reporting.json.result_schema import result_schema


def test_a_log_is_smoothed_written_and_read(tmp_path, capsys):
    times = np.linspace(0, 2, 401)
    clean = np.sin(2 * times)
    values = clean + 1e-5 * np.random.default_rng(0).normal(size=401)
    log, out = tmp_path / "log.csv", tmp_path / "smooth.csv"
    rows = [f"{t:.9g},{q:.12g}" for t, q in zip(times, values, strict=True)]
    log.write_text("\n".join(["time,elbow_joint", *rows]) + "\n")
    robot = "examples/robots/ur5.urdf"
    assert main(["smooth", robot, str(log), "--deviation", "6e-5", "--out", str(out), "--rate", "200Hz"]) == 0
    said = capsys.readouterr().out
    assert "401 rows from 0 s to 2 s, within 6e-05 rad or m of each sample" in said
    assert "second torque rates with them, are not known" in said
    again = jn.load_trajectory(out)
    jerk = again.derivatives(np.linspace(0, 2, 201), 3)[:, 3, 0]
    assert abs(np.abs(jerk).max() / 8 - 1) < 0.2
    assert np.abs(again.derivatives(times, 0)[:, 0, 0] - values).max() <= 6e-5
    assert main(["torques", robot, str(log), "--deviation", "6e-5", "--rates", "1"]) == 0
    assert "smoothed within 6e-05 rad or m of each of 401 samples, at most " in capsys.readouterr().out
    assert main(["smooth", robot, str(log), "--deviation", "-1", "--out", str(tmp_path / "none.csv")]) == 2
    assert not (tmp_path / "none.csv").exists()
    for command in (["smooth", "--rate", "200Hz"], ["torques"], ["check"]):
        capsys.readouterr()
        assert main([command[0], robot, str(log), "--deviation", "0.1mm", *command[1:]]) == 2
        assert "--deviation: must be an angle, such as 0.1deg: all joints turn, got '0.1mm'" in capsys.readouterr().err


def test_deviations_that_are_likely_in_degrees_are_warned_of():
    for text, value in (("5 deg", np.pi / 36), ("300mm", 0.3), ("0.05", 0.05)):
        assert np.isclose(deviation_of(text), value, rtol=1e-15)
    with pytest.warns(UnitWarning, match=r"--deviation: 5 rad or m, since .*; write a unit, such as 5deg or 5mm"):
        assert deviation_of("5") == 5.0
    with pytest.warns(UnitWarning, match=r"0.5 rad, since .*; write a unit, such as 0.5deg$"):
        deviation_of("0.5", jn.load_robot("examples/robots/ur5.urdf"))


def test_a_smoothed_log_is_reported_as_json_and_drawn(tmp_path, capsys):
    times = np.linspace(0, 3, 601)
    u = np.clip(times - 1, 0, 1)
    values = u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3) + 2e-5 * np.random.default_rng(5).normal(size=601)
    log, figure = tmp_path / "log.csv", tmp_path / "smooth.png"
    rows = [f"{t:.9g},{q:.12g}" for t, q in zip(times, values, strict=True)]
    log.write_text("\n".join(["time,elbow_joint", *rows]) + "\n")
    asked = ["smooth", "examples/robots/ur5.urdf", str(log), "--deviation", "1e-4", "--json", "--figure", str(figure)]
    assert main(asked) == 0
    record = json.loads(capsys.readouterr().out)
    Draft202012Validator(result_schema()).validate(record)
    (joint,) = record["joints"]
    assert (record["follows_noise"], record["written"], record["figure"]) == ([], None, str(figure))
    assert 1.5e-5 < joint["noise"] < 2.5e-5
    assert joint["farthest"] <= 1e-4
    first, last = joint["dwells"]
    assert first[0] == 0.0
    assert last[1] == 3.0
    assert 0.8 < first[1] < 1.15
    assert figure.read_bytes()[:4] == b"\x89PNG"


@pytest.mark.slow
def test_joints_of_a_log_that_are_read_are_chosen_and_unknown_ones_named(tmp_path, capsys):
    times = np.linspace(0, 2, 201)
    log, out = tmp_path / "log.csv", tmp_path / "smooth.csv"
    rows = [f"{t:.9g},{np.sin(t):.12g},{np.cos(t):.12g},{t:.12g}" for t in times]
    log.write_text("\n".join(["time,elbow_joint,gripper,wrist_1_joint", *rows]) + "\n")
    robot, chosen = "examples/robots/ur5.urdf", ["--joints", "wrist_1_joint,elbow_joint"]
    assert main(["torques", robot, str(log)]) == 2
    assert "gripper" in capsys.readouterr().err
    for command in (
        ["torques", "--rates", "1"],
        ["check"],
        ["smooth", "--deviation", "1e-6", "--out", str(out)],
    ):
        assert main([command[0], robot, str(log), *command[1:], *chosen]) in (0, 1)
        assert "gripper" not in capsys.readouterr().out
    read = jn.load_trajectory(out)
    assert set(read.names) == {"elbow_joint", "wrist_1_joint"}
    values = read.part(("elbow_joint", "wrist_1_joint")).derivatives(times, 0)[:, 0]
    np.testing.assert_allclose(values, np.stack([np.sin(times), times], axis=1), atol=2e-6)
    assert main(["check", robot, str(log), "--joints", "elbow_joint,wirst_1_joint"]) == 2
    assert "did you mean 'wrist_1_joint'" in capsys.readouterr().err
