"""``jounce modes``: what it prints and writes, against closed forms; bad input."""

import csv
import json
import pathlib

import numpy as np
import pytest

from jounce.reporting.json.result_schema import result_schema

EXAMPLES = pathlib.Path(__file__).resolve().parents[3] / "examples"
PENDULUM = EXAMPLES / "double_pendulum.yaml"
FREQUENCIES = np.sqrt(9.81 * (2 + np.sqrt(2) * np.array([-1, 1]))) / (2 * np.pi)


def test_the_json_is_that_of_the_schema_and_the_file_holds_the_shapes(run, tmp_path):
    from jsonschema import Draft202012Validator

    out = tmp_path / "modes.csv"
    status, printed, err = run("modes", PENDULUM, "--json", "--out", out)
    assert (status, err) == (0, "")
    found = json.loads(printed)
    Draft202012Validator(result_schema()).validate(found)
    assert np.allclose([mode["frequency"] for mode in found["modes"]], FREQUENCIES, rtol=1e-12)
    assert found["equilibrium"]["stability"] == "stable"
    assert found["coordinates"] == ["upper.angle", "lower.angle"]
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert np.allclose([float(row["frequency_hz"]) for row in rows], FREQUENCIES, rtol=1e-12)
    shapes = [[float(row[f"{body}.angle_re"]) for body in ("upper", "lower")] for row in rows]
    assert np.allclose(np.abs(shapes[0][1] / shapes[0][0]), np.sqrt(2))
    assert shapes[0][0] * shapes[0][1] > 0 > shapes[1][0] * shapes[1][1]


def test_the_table_tells_where_it_stands_and_what_moves(run):
    status, printed, _ = run("modes", PENDULUM)
    assert status == 0
    assert "equilibrium at t = 0 s: stable (energy rises in all directions)" in printed
    assert "0.381526" in printed
    assert "lower, 85 %" in printed


@pytest.mark.slow
def test_a_mode_becomes_an_animation(run, tmp_path):
    out = tmp_path / "second.gif"
    status, printed, _ = run("modes", PENDULUM, "--animation", out, "--mode", "2")
    assert status == 0
    assert out.read_bytes()[:4] == b"GIF8"
    assert "1.84 times slower" in printed


@pytest.mark.slow
def test_a_driver_is_left_out_or_released(run):
    status, printed, _ = run("modes", EXAMPLES / "press.yaml", "--without", "motor", "--json")
    found = json.loads(printed)
    assert status == 0
    assert found["equilibrium"]["without"] == ["motor"]
    assert "torque" not in found["equilibrium"]["outputs"]
    status, printed, _ = run("modes", EXAMPLES / "press.yaml", "--release", "motor", "--json")
    assert json.loads(printed)["coordinates"] == ["motor"]


@pytest.mark.slow
def test_a_robot_hangs_and_swings(run):
    status, printed, err = run("modes", EXAMPLES / "robots" / "planar_arm.xml", "--hold", "ram", "--json")
    assert (status, err) == (0, "")
    found = json.loads(printed)
    assert found["coordinates"] == ["shoulder", "elbow"]
    assert len(found["modes"]) == 2


@pytest.mark.slow
def test_bad_input_is_named(run):
    for arguments, message in (
        ((EXAMPLES / "press.yaml",), "release it (motor)"),
        ((EXAMPLES / "four_bar.yaml",), "no body has one"),
        ((PENDULUM, "--without", "motor"), "--without"),
        ((PENDULUM, "--coordinate", "upper.angel"), "--coordinate"),
        ((PENDULUM, "--mode", "3", "--animation", "a.gif"), "--mode"),
        ((PENDULUM, "--out", "modes.nc"), ".csv"),
        ((EXAMPLES / "none.yaml",), "none.yaml"),
        ((PENDULUM, "--hold", "A"), "--hold"),
        ((EXAMPLES / "robots" / "planar_arm.xml", "--hold", "wrist"), "--hold"),
        ((EXAMPLES / "robots" / "planar_arm.xml", "--without", "ram"), "--without"),
    ):
        status, _, err = run("modes", *arguments)
        assert status == 2, arguments
        assert message in err
