"""The command ``jounce simulate`` for robot files: what it prints and writes, and bad input."""

import functools
import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from jounce.reporting.json.result_schema import result_schema

PENDULUM = """<robot name="pendulum"><link name="base"/>
<link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"""
INERTIA = 0.01 + 2 * 0.5**2


@pytest.fixture
def run(run, tmp_path):
    path = tmp_path / "pendulum.urdf"
    path.write_text(PENDULUM)
    return functools.partial(run, "simulate", path)


def test_a_pendulum_swings_with_its_energy(run, tmp_path):
    out = tmp_path / "motion.csv"
    options = ("--until", "500 ms", "--instants", 6, "--start", "pin=30 deg", "--order", 2, "--out", out, "--json")
    status, printed, _ = run(*options)
    record = json.loads(printed)
    Draft202012Validator(result_schema()).validate(record)
    assert (status, record["command"], record["robot"], record["ok"]) == (0, "simulate", "pendulum", True)
    assert record["backend"] in ("llvm", "xla")
    weight = -2 * 9.81 * 0.5
    np.testing.assert_allclose(record["energy_at_start"], weight * np.cos(np.pi / 6), rtol=1e-13)
    np.testing.assert_allclose(record["energy_at_stop"], record["energy_at_start"], rtol=1e-12)
    table = np.genfromtxt(out, delimiter=",", names=True)
    angle, rate, acceleration = (table[name] for name in table.dtype.names[1:4])
    np.testing.assert_allclose(acceleration, weight * np.sin(angle) / INERTIA, rtol=1e-9)
    np.testing.assert_allclose(INERTIA * rate**2 / 2 + weight * np.cos(angle), record["energy_at_start"], rtol=1e-9)


@pytest.mark.slow
def test_torques_by_name(run):
    status, printed, _ = run("--until", "0.1", "--torque", "pin=-9.81*sin(-pin) + 2", "--order", 2, "--json")
    (peak,) = [x for x in json.loads(printed)["peaks"] if x["unit"] == "rad/s^2"]
    assert status == 0
    np.testing.assert_allclose([peak["minimum"], peak["maximum"]], 2 / INERTIA, rtol=1e-9)  # weight is held


@pytest.mark.parametrize(
    "options, says",
    [
        ((), "--until: a robot needs the end of its motion"),
        (("--until", "2 kg"), "--until"),
        (("--until", "0 s"), "--until: must be greater than zero"),
        (("--until", "1", "--start", "pn=3"), "--start: no moving joint has this name"),
        (("--until", "1", "--start", "pin=3 m"), "--start"),
        (("--until", "1", "--torque", "pn=3"), "no moving joint has this name"),
        (("--until", "1", "--set", "a=3"), "--set: is for mechanism files"),
    ],
)
def test_bad_input(run, options, says):
    status, _, printed = run(*options)
    assert status == 2
    assert says in printed
