"""Plate cams from files: the command, its table and its figure, and what is wrong with a file."""

import csv
import json
import math
import pathlib
import re

import numpy as np
import pytest

import jounce as jn
from jounce.cli import main

INTAKE = "examples/cams/intake.yaml"


@pytest.mark.slow
def test_the_table_has_the_units_of_the_file_and_reads_back_as_samples(tmp_path, capsys):
    out = tmp_path / "cam.csv"
    assert main(["cam", INTAKE, "--count", "91", "--out", str(out), "--figure", str(tmp_path / "cam.png")]) == 0
    assert "not undercut" in capsys.readouterr().out
    assert (tmp_path / "cam.png").stat().st_size > 10_000
    with out.open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows[0][:4] == ["angle [deg]", "lift [mm]", "x [mm]", "y [mm]"]
    assert len(rows) == 92
    cam = jn.cams.load_cam(INTAKE, count=91)
    np.testing.assert_allclose(float(rows[46][0]), 180.0)
    np.testing.assert_allclose([float(x) for x in rows[46][1:4]], 1e3 * np.array([0.009, *cam.table.profile[:, 45]]))
    text = pathlib.Path(INTAKE).read_text()
    again = text[: text.index("law:")] + "law: {samples: cam.csv, time: angle, value: lift}\n"
    (tmp_path / "again.yaml").write_text(again)
    sampled = jn.cams.load_cam(tmp_path / "again.yaml")  # degrees and millimeters, as the heading says
    assert sampled.table.lift.max() == pytest.approx(0.009, rel=1e-12)
    np.testing.assert_allclose(sampled.at(2.5).profile, cam.at(2.5).profile, atol=1e-6)


@pytest.mark.slow
def test_an_undercut_cam_is_reported_and_the_status_says_so(capsys):
    assert main(["cam", INTAKE, "--set", "roller=25 mm", "--json"]) == 1
    record = json.loads(capsys.readouterr().out)
    assert record["undercut"]
    assert record["least_radius"]["value"] < 0
    assert all(math.radians(120) < part["angle"] < math.radians(240) for part in record["undercuts"])
    assert record["continuous_to"] == 3
    assert main(["cam", INTAKE, "--set", "roller=25 mm", "--units", "angle=rad"]) == 1
    assert "UNDERCUT from 2." in capsys.readouterr().out


@pytest.mark.slow
def test_a_flat_face_is_pressed_straight_and_no_rounding_is_reported(tmp_path, capsys):
    text = pathlib.Path(INTAKE).read_text().replace("shape: roller, radius: roller, offset: -2 mm", "shape: flat_face")
    file = tmp_path / "flat.yaml"
    file.write_text(text)
    main(["cam", str(file), "--set", "lift=1 mm"])
    printed = capsys.readouterr().out
    assert "largest pressure angle: zero throughout" in printed
    assert re.search(r"jounce jumps by 698\.\d+ mm/rad\^4 at 120 deg", printed)  # a ninth of that of 9 mm


@pytest.mark.parametrize(
    "old, new, name, words",
    [
        ("base_radius: 18 mm", "base_radius: 18 deg", "cam.base_radius", "a length"),
        ("sense: clockwise", "sense: left", "cam.sense", "unknown sense"),
        ("type: translating", "type: sliding", "follower.type", "translating"),
        ("shape: roller", "shape: wheel", "follower.shape", "unknown shape"),
        ("offset: -2 mm", "arm: 2 mm", "follower.arm", "unknown key"),
        ("offset: -2 mm", "offset: -60 mm", "follower.offset", "misses the cam"),
        ("duration: 60 deg, to: lift", "duration: 60 s, to: lift", "law.profile[1].duration", "an angle"),
        (
            "_4_5_6_7, duration: 60 deg, to: 0}",
            ", duration: 60 deg, to: 0, end: [1 mm/s]}",
            "law.profile[2].end[0]",
            "per rad",
        ),
        ("to: lift", "to: 9 deg", "law.profile[1].to", "a length"),
        ("to: 0}", "to: 1 mm}", "law", "do not end where they begin"),
        ("duration: 120 deg}\n  beyond", "duration: 100 deg}\n  beyond", "law", "period"),
        ("length: mm", "length: deg", "units.length", "not a length"),
        ("lift: 9 mm", "lift: 9 mmm", "parameters.lift", "unknown unit"),
        ("lift: 9 mm", "lift: 9 mm\n  if: 1", "parameters.if", "the word 'if' cannot be a name in expressions"),
        ("lift: 9 mm", "lift: 9 mm\n  t: 1", "parameters.t", "the name 't' is reserved for expressions"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, old, new, name, words):
    text = pathlib.Path(INTAKE).read_text()
    assert old in text
    (tmp_path / "cam.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(jn.errors.MechanismFileError, match=words) as caught:
        jn.cams.load_cam(tmp_path / "cam.yaml")
    assert caught.value.line is not None
    assert caught.value.name == name


def test_files_of_other_kinds_are_reported(capsys):
    assert main(["run", INTAKE]) == 2
    assert f"jounce cam {INTAKE}" in capsys.readouterr().err
    assert main(["cam", "examples/four_bar.yaml"]) == 2
    assert "is a mechanism" in capsys.readouterr().err
