"""The command ``export``: what it writes and says, and bad input."""

import functools

import numpy as np
import pytest
import yaml

import jounce as jn
from tests.cli.robot_commands.test_check import PENDULUM

LAW = "joints: {pin: 0.5*sin(2*t)**4}\ntime: {start: 0, stop: 1, step: 0.1}\n"


@pytest.fixture
def run(run):
    return functools.partial(run, "export")


@pytest.fixture
def files(tmp_path):
    robot, law = tmp_path / "pendulum.urdf", tmp_path / "law.yaml"
    robot.write_text(PENDULUM)
    law.write_text(LAW)
    return robot, law


def test_a_message_is_written_and_read_back(run, files, tmp_path):
    out = tmp_path / "motion.yaml"
    status, output, _ = run(*files, "--format", "ros", "--rate", "20Hz", "--out", out)
    assert status == 0
    assert "21 rows from 0 s to 1 s" in output
    t = np.linspace(0, 1, 21)
    found = jn.load_trajectory(out).derivatives(t, 1, ["pin"])[:, :, 0]
    exact = np.stack([0.5 * np.sin(2 * t) ** 4, 4 * np.sin(2 * t) ** 3 * np.cos(2 * t)], axis=1)
    assert np.abs(found - exact).max() <= 1e-14
    assert set(yaml.safe_load(out.read_text())["points"][0]) == {
        "positions",
        "velocities",
        "accelerations",
        "time_from_start",
    }


def test_a_law_file_is_written_to_its_stop_though_its_step_does_not_divide_the_time(run, files, tmp_path):
    robot, law = files
    law.write_text("joints: {pin: 0.5*t**4}\ntime: {stop: 1 s, step: 30 ms}\n")
    out = tmp_path / "motion.yaml"
    status, output, _ = run(robot, law, "--format", "ros", "--rate", "20Hz", "--out", out)
    assert (status, "21 rows from 0 s to 1 s" in output) == (0, True)
    assert yaml.safe_load(out.read_text())["points"][-1]["positions"] == [0.5]


@pytest.mark.parametrize(
    "options, words",
    [
        (("--format", "franka", "--out", "x.csv"), "has 7 joints"),
        (("--format", "ros", "--out", "x.csv"), ".yaml"),
        (("--format", "ros", "--rate", "5 m", "--out", "x.yaml"), "frequency"),
        (("--format", "ros", "--joints", "elbow", "--out", "x.yaml"), "elbow"),
    ],
)
def test_bad_input_is_reported(run, files, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    status, _, message = run(*files, *options)
    assert status == 2
    assert words in message
    assert not list(tmp_path.glob("x.*"))


def test_a_disk_that_fills_while_a_table_is_written_is_no_bad_input(run, files, tmp_path):
    resource = pytest.importorskip("resource")
    out = tmp_path / "motion.yaml"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        status, _, err = run(*files, "--format", "ros", "--rate", "1kHz", "--out", out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (status, out.exists()) == (1, False)
    assert "motion.yaml: cannot be written: File too large" in err
    missing = tmp_path / "none" / "motion.yaml"
    status, _, err = run(*files, "--format", "ros", "--out", missing)
    assert (status, "does not exist" in err) == (2, True)
