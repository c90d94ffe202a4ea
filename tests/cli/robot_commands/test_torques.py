"""The command ``torques``: files against the closed form of a pendulum, what it prints, bad input."""

import functools
import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from jounce import io
from jounce.reporting.json.result_schema import result_schema
from tests.cli.robot_commands.test_check import PENDULUM

LAW = "joints: {pin: 0.5*sin(2*t)}\ntime: {start: 0, stop: 1, step: 0.1}\n"
MASS, ARM, INERTIA, GRAVITY = 2.0, 0.5, 0.01 + 2.0 * 0.5**2, 9.81


@pytest.fixture
def run(run):
    return functools.partial(run, "torques")


@pytest.fixture
def files(tmp_path):
    robot, law = tmp_path / "pendulum.urdf", tmp_path / "law.yaml"
    robot.write_text(PENDULUM)
    law.write_text(LAW)
    return robot, law


def closed_form(t):
    """Return the torque of the pendulum, which rises with its angle, and its rate."""
    q, v, a, j = 0.5 * np.sin(2 * t), np.cos(2 * t), -2 * np.sin(2 * t), -4 * np.cos(2 * t)
    weight = MASS * GRAVITY * ARM
    return np.stack([INERTIA * a + weight * np.cos(q), INERTIA * j - weight * np.sin(q) * v], axis=1)


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_the_file_holds_torques_and_rates(run, files, tmp_path, suffix):
    out = tmp_path / f"tau{suffix}"
    status, printed, _ = run(*files, "--rates", 1, "--out", out)
    assert status == 0
    assert "pin" in printed
    assert "torque rate" in printed
    found = io.read(out)
    np.testing.assert_allclose(found["time"], np.linspace(0, 1, 11), rtol=0, atol=1e-15)
    np.testing.assert_allclose(found["pin"].values, closed_form(found["time"].values), rtol=0, atol=1e-12)
    if suffix == ".csv":
        assert out.read_text().splitlines()[0] == "time,pin,pin_d1"
    else:
        assert found["pin"].attrs["units"] == "N*m"


def test_a_payload_adds_its_weight(run, files, tmp_path):
    out = tmp_path / "tau.csv"
    assert run(*files, "--rates", 0, "--out", out, "--payload", "tip=3 kg")[0] == 0
    found = io.read(out)
    t = found["time"].values
    q, a = 0.5 * np.sin(2 * t), -2 * np.sin(2 * t)
    expected = closed_form(t)[:, 0] + 3.0 * (a + GRAVITY * np.cos(q))
    np.testing.assert_allclose(found["pin"].values[:, 0], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("part", ["", "@0.35 s:750 ms"])
def test_a_payload_that_is_likely_in_grams_is_warned_of(run, files, part):
    """With a unit, or lighter than the robot, it may be any."""
    for payload in ("tip=500 kg", "tip=0.5"):
        assert "warning" not in run(*files, "--rates", 0, "--payload", payload + part)[2]
    status, _, messages = run(*files, "--rates", 0, "--payload", "tip=500" + part)
    assert status == 0
    assert "--payload: 500 kg, more than the robot, which has 2 kg; grams need their unit: 500 g" in messages


def test_a_payload_is_carried_for_a_part_of_the_motion(run, files, tmp_path):
    out = tmp_path / "tau.csv"
    status, printed, _ = run(*files, "--rates", 0, "--out", out, "--payload", "tip=3 kg@0.35 s:750 ms")
    assert status == 0
    assert "tip carries 3 kg from 0.35 s to 0.75 s" in printed
    found = io.read(out)
    t = found["time"].values
    q, a, carried = 0.5 * np.sin(2 * t), -2 * np.sin(2 * t), 3.0 * ((t > 0.35) & (t < 0.75))
    expected = closed_form(t)[:, 0] + carried * (a + GRAVITY * np.cos(q))
    np.testing.assert_allclose(found["pin"].values[:, 0], expected, rtol=0, atol=1e-12)


def test_json(run, files):
    status, printed, _ = run(*files, "--json")
    record = json.loads(printed)
    Draft202012Validator(result_schema()).validate(record)
    assert (status, record["command"], record["rates"], record["held"]) == (0, "torques", 2, [])
    first = record["peaks"][0]
    assert (first["joint"], first["derivative"], first["unit"]) == ("pin", "torque", "N*m")
    assert first["maximum"] == pytest.approx(closed_form(np.array([first["maximum_at"]]))[0, 0], rel=1e-12)


def test_peaks_between_few_instants_are_found(run, files):
    """The torque is least at a quarter period, and its rate at the start; the instants are 0, 0.5 and 1 s."""
    files[1].write_text(LAW.replace("0.1", "0.5"))
    status, printed, _ = run(*files, "--json", "--rates", 1)
    torque, rate = json.loads(printed)["peaks"]
    least = MASS * GRAVITY * ARM * np.cos(0.5) - 2 * INERTIA
    assert status == 0
    assert torque["minimum"] == pytest.approx(least, rel=1e-6)
    assert torque["minimum_at"] == pytest.approx(np.pi / 4, abs=1e-3)
    dense = closed_form(np.linspace(0.0, 1.0, 100_001))
    assert [rate["minimum"], rate["maximum"]] == pytest.approx([dense[:, 1].min(), dense[:, 1].max()], abs=1e-5)
    assert "t = 0 s to 1 s, 3 instants and the peaks between them\n" in run(*files)[1]


@pytest.mark.parametrize(
    "change, words",
    [
        (("--rates", -1), ("--rates", "-1")),
        (("--rates", 29), ("--rates", "28")),
        (("--out", "tau.txt"), ("tau.txt", ".csv")),
        (("--payload", "tipp=3 kg"), ("tipp", "tip")),
    ],
)
def test_bad_options(run, files, change, words):
    status, printed, complaint = run(*files, *change)
    assert (status, printed) == (2, "")
    assert all(word in complaint for word in words)


def test_bad_files(run, files, tmp_path):
    robot, law = files
    law.write_text(LAW.replace("pin", "pim"))
    status, _, complaint = run(robot, law)
    assert status == 2
    assert all(word in complaint for word in ("law.yaml", "pim", "pin"))
    law.write_text(LAW)
    assert run(robot, law, "--out", tmp_path / "missing" / "tau.csv")[0] == 2
    samples = tmp_path / "samples.csv"
    samples.write_text("time,pin\n" + "".join(f"{k},{k * k}\n" for k in range(9)))
    before = samples.read_text()
    status, _, complaint = run(robot, samples, "--out", samples)
    assert (status, samples.read_text()) == (2, before)
    assert "samples.csv" in complaint


@pytest.mark.parametrize("trajectory", ["joints: {pin: 30 mm}\n", "joints: {pin: {samples: s.csv, value: pin}}\n"])
def test_a_length_is_no_coordinate_of_a_joint_that_turns(run, files, trajectory):
    """It was taken for as many rad."""
    robot, law = files
    law.write_text(trajectory + "time: {stop: 0.5, step: 0.1}\n")
    (law.parent / "s.csv").write_text("time,pin [mm]\n" + "".join(f"{k},{k}\n" for k in range(9)))
    status, _, complaint = run(robot, law)
    assert status == 2
    assert all(word in complaint for word in ("law.yaml", "pin", "turns", "length"))
