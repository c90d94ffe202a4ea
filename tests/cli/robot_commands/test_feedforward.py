"""The command ``feedforward``: files against a closed form, its exit status, what it refuses."""

import functools
import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from jounce import io
from jounce.reporting.json.result_schema import result_schema
from tests.cli.robot_commands.test_check import PENDULUM
from tests.cli.robot_commands.test_torques import LAW, closed_form

DRIVES = "joints: {pin: {stiffness: 50 N*m/rad, rotor_inertia: 1 kg*cm^2, gear_ratio: 40, deflection_limit: %s}}\n"


@pytest.fixture
def run(run):
    return functools.partial(run, "feedforward")


@pytest.fixture
def files(tmp_path):
    paths = [tmp_path / name for name in ("pendulum.urdf", "law.yaml", "drives.yaml")]
    for path, text in zip(paths, (PENDULUM, LAW, DRIVES % "0.3 rad"), strict=True):
        path.write_text(text)
    return paths


def test_the_file_holds_motors_and_springs(run, files, tmp_path):
    robot, law, drives = files
    out = tmp_path / "ff.csv"
    status, printed, _ = run(robot, law, "--drives", drives, "--out", out)
    assert status == 0
    assert "pin" in printed
    found = io.read(out)
    t = found["time"].values
    tau = closed_form(t)[:, 0]
    np.testing.assert_allclose(found["pin_spring_torque"].values[:, 0], tau, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found["pin_theta"].values[:, 0], 0.5 * np.sin(2 * t) + tau / 50, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found["pin_motor"].values, 40 * found["pin_theta"].values, rtol=0, atol=1e-12)
    np.testing.assert_allclose(40 * found["pin_motor_torque"].values, found["pin_torque"].values, rtol=1e-14)
    inertia = found["pin_torque"].values - found["pin_spring_torque"].values
    np.testing.assert_allclose(inertia, 1e-4 * 40 * found["pin_motor_acceleration"].values, rtol=0, atol=1e-12)


def test_a_broken_limit_is_reported_and_the_status_is_1(run, files):
    robot, law, drives = files
    drives.write_text(DRIVES % "1 mrad")
    status, printed, _ = run(robot, law, "--drives", drives)
    assert status == 1
    assert "1 of 1 limit broken" in printed
    assert "pin deflection" in printed


def test_json(run, files):
    robot, law, drives = files
    status, printed, _ = run(robot, law, "--drives", drives, "--json")
    record = json.loads(printed)
    Draft202012Validator(result_schema()).validate(record)
    assert (status, record["command"], record["kept"], record["simulated"]) == (0, "feedforward", True, None)
    assert record["drives"][0]["expansion_errors"] == [0.0, 0.0, 0.0]
    deflection = next(row for row in record["limits"] if row["quantity"] == "deflection")
    t = np.linspace(0, 1, 100_001)
    assert abs(deflection["worst"]) == pytest.approx(np.abs(closed_form(t)[:, 0]).max() / 50, rel=1e-8)


def test_bad_input(run, files, tmp_path):
    robot, law, drives = files
    for words, message in (
        ((robot, "--drives", drives), ("trajectory",)),
        ((robot, law), ("--drives",)),
        ((robot, law, "--drives", drives, "--rates", -1), ("--rates", "-1")),
        ((robot, law, "--drives", drives, "--set", "a=1"), ("--set", "mechanism")),
        ((robot, law, "--drives", tmp_path / "none.yaml"), ("none.yaml",)),
        ((robot, law, "--drives", drives, "--out", drives), ("drives.yaml",)),
        (("examples/four_bar.yaml", law, "--drives", drives), ("four_bar.yaml", "leave the trajectory out")),
        (("examples/four_bar.yaml", "--drives", drives), ("drivers",)),
    ):
        status, printed, complaint = run(*words)
        assert (status, printed) == (2, "")
        assert all(word in complaint for word in message), complaint


@pytest.mark.slow
def test_it_simulates_and_draws(run, files, tmp_path):
    robot, law, drives = files
    picture = tmp_path / "elastic.png"
    status, printed, _ = run(robot, law, "--drives", drives, "--figure", picture, "--json")
    (link,) = json.loads(printed)["simulated"]
    assert (status, link["name"], link["unit"]) == (0, "pin", "rad")
    assert link["error"] < 1e-12 < 1e-6 < link["error_without_springs"]
    assert picture.stat().st_size > 10_000
