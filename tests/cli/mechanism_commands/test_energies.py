"""The command ``energies`` against the closed forms of one axis, and bad input."""

import functools

import numpy as np
import pytest

import jounce as jn
from tests.cli.robot_commands.test_check import PENDULUM
from tests.problems.mechanisms import example

LAW = "joints: {pin: 0.5*sin(2*t)}\ntime: {start: 0, stop: 1, step: 0.25}\n"


@pytest.fixture
def run(run):
    return functools.partial(run, "energies")


@pytest.fixture
def files(tmp_path):
    robot, law = tmp_path / "pendulum.urdf", tmp_path / "law.yaml"
    robot.write_text(PENDULUM)
    law.write_text(LAW)
    return robot, law


def test_a_robot_on_one_axis(run, files, tmp_path):
    """Negrean 2025, 141: 2 E_1 / I = a^2 + w^4, and its first rate 2 a j + 4 w^3 a."""
    out = tmp_path / "energies.csv"
    status, output, _ = run(*files, "--order", "1", "--rates", "1", "--out", out)
    assert status == 0
    assert "Acceleration energy of order 1, t = 0 s to 1 s, at 5 instants and between them" in output
    table = np.genfromtxt(out, delimiter=",", names=True)
    t = np.linspace(0, 1, 5)
    w, a, j = np.cos(2 * t), -2 * np.sin(2 * t), -4 * np.cos(2 * t)
    robot = jn.load_robot(files[0])
    inertia = float(jn.mass_matrix(robot, [0.0], drives=False)[0, 0])
    energy, rate = (a**2 + w**4) * inertia / 2, (a * j + 2 * w**3 * a) * inertia
    assert run(*files, "--order", "1", "--rates", "1", "--no-drives", "--out", out)[0] == 0
    table = np.genfromtxt(out, delimiter=",", names=True)
    np.testing.assert_allclose(table["energy"], energy, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(table["energy_d1"], rate, rtol=1e-12, atol=1e-13)


@pytest.mark.slow
def test_a_mechanism(run, tmp_path):
    out = tmp_path / "energies.csv"
    file = example("double_pendulum")
    assert run(file, "--order", "0", "--rates", "1", "--out", out)[0] == 0
    table = np.genfromtxt(out, delimiter=",", names=True)
    motion = jn.simulate(jn.load(file), order=2)
    np.testing.assert_array_equal(table["energy"], jn.energy.kinetic_energy(motion).total.values[:, 0])


def test_bad_input(run, files):
    for arguments, words in (
        ((files[0],), "a robot needs a trajectory"),
        ((example("double_pendulum"), files[1]), "a mechanism file has its motion"),
        ((*files, "--order", "29"), "--order: must be a whole number from 0 to 28, got 29"),
        ((*files, "--order", "20", "--rates", "9"), "--rates: must be a whole number from 0 to 8, got 9"),
    ):
        status, _, message = run(*arguments)
        assert status == 2
        assert words in " ".join(message.split())


def test_json(run, files):
    import json

    from jsonschema import Draft202012Validator

    from jounce.reporting.json.result_schema import result_schema

    status, output, _ = run(*files, "--order", "1", "--rates", "1", "--no-drives", "--json")
    assert status == 0
    found = json.loads(output)
    Draft202012Validator(result_schema()).validate(found)
    assert (found["command"], found["order"], found["rates"], found["time"]["count"]) == ("energies", 1, 1, 5)
    energy, rate = (row for row in found["peaks"] if row["body"] is None)
    inertia = float(jn.mass_matrix(jn.load_robot(files[0]), [0.0], drives=False)[0, 0])
    # with s = sin(2 t), w^4 + a^2 = (1 + s^2)^2, which is largest between the instants
    np.testing.assert_allclose([energy["minimum"], energy["maximum"]], [inertia / 2, 2 * inertia], rtol=1e-6)
    assert abs(energy["maximum_at"] - np.pi / 4) < 1e-3
    slope = 4 * (1 + np.sin(2 * (t := np.linspace(0, 1, 100_001))) ** 2) * np.sin(2 * t) * np.cos(2 * t) * inertia
    np.testing.assert_allclose([rate["minimum"], rate["maximum"]], [slope.min(), slope.max()], rtol=1e-6)
    assert (energy["unit"], rate["unit"]) == ("J/s^2", "J/s^3")
