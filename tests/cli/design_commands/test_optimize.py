"""The command ``optimize``: what it prints and writes, and what it says where it cannot."""

import json
import pathlib

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import jounce as jn
from jounce.cli import main
from jounce.reporting.json.result_schema import result_schema

TEXT = """\
# A crank whose law is a cubic.
space: planar
parameters: {a: 0.1, b: 0.1, c: 5.7 deg, r: 300 mm}   # to be found
bodies: {crank: {position: [0, 0]}}
joints: {O: {type: revolute, bodies: [ground, crank], points: [[0, 0], [0, 0]]}}
drivers:
  theta: {type: coordinate, bodies: [ground, crank], coordinate: angle, motion: t**3 + a*t + b*t**2 + c}
outputs: {angle: {body: crank, quantity: angle}, tip: {body: crank, point: [r, 0]}}
time: {start: -1, stop: 1, step: 0.05}
"""
VARY = ("--vary", "a=-2:2", "--vary", "b=-2:2", "--vary", "c=-2 rad:2 rad")


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "crank.yaml"
    path.write_text(TEXT)
    return path


def shown(capsys, *arguments):
    status = main(["optimize", *map(str, arguments)])
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.mark.slow
def test_a_better_design_is_reported_and_written_in_the_units_of_the_file(capsys, file):
    out = file.with_name("better.yaml")
    status, printed, _ = shown(capsys, file, "--minimize", "peak(angle)", *VARY, "--starts", 1, "--out", out, "--json")
    assert status == 0
    found = json.loads(printed)
    Draft202012Validator(result_schema()).validate(found)
    assert (found["command"], found["status"]) == ("optimize", "optimal")
    assert found["objective"] == pytest.approx(0.25, abs=1e-9)
    better = jn.load(out)
    assert better.parameters["a"] == pytest.approx(-0.75, abs=1e-7)
    changed = [(a, b) for a, b in zip(TEXT.splitlines(), out.read_text().splitlines(), strict=True) if a != b]
    ((_, line),) = changed
    assert " deg, r: 300 mm}   # to be found" in line


@pytest.mark.slow
def test_points_of_a_file_are_gone_through(capsys, file):
    points, radii = file.with_name("points.csv"), np.array([0.2, 0.3, 0.55])
    rows = "".join(
        f"{float(r * np.cos(a))!r},{float(r * np.sin(a))!r}\n"
        for r, a in zip(radii.tolist(), (-0.5, 0.1, 0.4), strict=True)
    )
    points.write_text(f"tip_x,tip_y\n{rows}")
    arguments = ("--vary", "r=100mm:1m", "--curve", f"ring={points}", "--starts", 1)
    status, printed, _ = shown(capsys, file, "--minimize", "path_error(tip, ring)", *arguments)
    assert status == 0
    assert "optimal" in printed
    assert f"{radii.mean():.7g}" in printed


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("--minimize", "peak(phi)", *VARY), "--minimize: unknown name 'phi'"),
        (("--minimize", "peak(angle)", "--vary", "a=1"), "NAME=LOW:HIGH"),
        (("--minimize", "peak(angle)", *VARY, "--seed", -1), "--seed: must be a whole number, 0 or greater, got -1"),
        (("--minimize", "peak(angle)", *VARY, "--clearance", -1), "--clearance: must be a number, zero or greater"),
        (("--minimize", "peak(angle)", *VARY, "--iterations", 0), "--iterations: must be a whole number, 1 or greater"),
        (("--minimize", "peak(angle)", "--vary", "a=2:1"), "--vary a: bounds"),
        (("--minimize", "peak(angle)", "--vary", "r=1s:2s"), "--vary r: no mechanism can have this bound"),
        (("--minimize", "peak(angle)", *VARY, "--subject-to", "span(angle) <= 1 mm"), "--subject-to: span(angle)"),
        (("--minimize", "path_error(tip, x)", *VARY, "--curve", "x=none.csv"), "--curve x"),
        (("--minimize", "peak(angle)", *VARY, "--assemblies", "first"), "--assemblies"),
        (("--minimize", "peak(angle)", *VARY, "--out", "better.csv"), "better.csv"),
    ],
)
def test_bad_input_is_reported_by_the_option(capsys, file, arguments, words):
    status, _, message = shown(capsys, file, *arguments)
    assert status == 2
    assert words in message


def test_the_file_that_is_read_is_not_replaced_unasked(capsys, file):
    status, _, message = shown(capsys, file, "--minimize", "peak(angle)", *VARY, "--out", file)
    assert status == 2
    assert "--overwrite" in message
    assert pathlib.Path(file).read_text() == TEXT


def test_a_minus_before_an_expression_needs_no_equals_sign(file, capsys):
    status, _, err = shown(capsys, file, "--minimize", "-span(nothing)", *VARY)
    assert status == 2
    assert "unknown name 'nothing' in '-span(nothing)'" in err  # it was read as an expression
    assert "a minus sign maximizes" in " ".join(_help(capsys).split())


def _help(capsys):
    assert main(["optimize", "--help"]) == 0
    return capsys.readouterr().out
