"""The command ``retime``: what it writes passes ``check``; what is wrong is told before anything is computed."""

import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from jounce import io
from jounce.reporting.json.result_schema import result_schema

PANDA = "examples/robots/panda.urdf"
TOO_FAST = "examples/trajectories/panda_too_fast.csv"
LIMITS = "examples/limits/franka_panda.yaml"


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--repair",)], ids=["fastest", "repaired"])
def test_a_trajectory_that_breaks_limits_comes_back_as_one_that_passes_check(run, tmp_path, options):
    out, figure = tmp_path / "fast.csv", tmp_path / "fast.png"
    given = ("--limits", LIMITS, "--out", out, "--figure", figure, "--json", *options)
    status, told, _ = run("retime", PANDA, TOO_FAST, *given)
    assert status == 0
    result = json.loads(told)
    Draft202012Validator(result_schema()["$defs"]["retime"]).validate(result)
    assert result["kept"]
    assert result["before"] == 0.2
    assert figure.stat().st_size > 10_000
    rows = io.read(out)
    np.testing.assert_allclose(np.diff(rows["time"].values), 1e-3, rtol=1e-9)
    still = 1.42e-7 if options else 1e-9  # rad/s: the spline through the rounded samples ends at 1.41e-7
    np.testing.assert_allclose(rows["panda_joint1"].values[[0, -1], 1], 0, atol=still)
    assert run("check", PANDA, out, "--limits", LIMITS)[0] == 0


def test_bad_input_is_told(run, tmp_path):
    for given, message in (
        ((PANDA,), "a robot needs a path"),
        (("examples/press.yaml",), "--limits"),
        (("examples/press.yaml", TOO_FAST), "that of its drivers"),
        ((PANDA, TOO_FAST, "--rate", "3 m"), "frequency"),
        ((PANDA, tmp_path / "none.csv"), "none.csv"),
    ):
        status, _, error = run("retime", *given)
        assert status == 2
        assert message in error
    points = tmp_path / "points.csv"
    points.write_text("panda_joint1,panda_joint9\n0,0\n1,1\n")
    status, _, error = run("retime", PANDA, points)
    assert status == 2
    assert "panda_joint9" in error


def test_paths_without_times_are_read(tmp_path):
    points, laws = tmp_path / "points.csv", tmp_path / "path.yaml"
    points.write_text("a [deg],b\n0,0\n90,1\n180,0\n")
    laws.write_text("path:\n  a: 0.8*sin(pi*s)\n  b: 2 - s\n")
    found = io.load_path(points)
    np.testing.assert_allclose(
        found.derivatives(np.array([0.0, 0.5, 1.0]), 0)[:, 0], [[0, 0], [np.pi / 2, 1], [np.pi, 0]]
    )
    values = io.load_path(laws).derivatives(np.array([0.5]), 1)[0]
    np.testing.assert_allclose(values, [[0.8, 1.5], [0.0, -1.0]], atol=1e-14)
