"""Warnings of numbers that are likely meant in another unit."""

import warnings
from pathlib import Path

import pytest

import jounce as jn

FOUR_BAR = """
space: planar
parameters: {{AD: 13.21 cm, AB: {AB}, BC: 14.23 cm, CD: 20.31 cm}}
bodies:
  crank: {{position: [0, 0], angle: {angle}}}
  rocker: {{position: [AD, 0], angle: 100 deg}}
joints:
  A:  {{type: revolute, bodies: [ground, crank], points: [[0, 0], [0, 0]]}}
  D:  {{type: revolute, bodies: [ground, rocker], points: [[AD, 0], [0, 0]]}}
  BC: {{type: double_revolute, bodies: [crank, rocker], points: [[AB, 0], [CD, 0]], length: BC}}
drivers:
  theta: {{type: coordinate, bodies: [ground, crank], coordinate: angle, motion: {motion}}}
"""
PLAIN = {"AB": "4 cm", "angle": "30 deg", "motion": "30*deg + 5*t"}


def load(folder, **changes):
    path = folder / "four_bar.yaml"
    path.write_text(FOUR_BAR.format(**{**PLAIN, **changes}))
    return jn.load(path)


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"motion": "60 + 360*t"}, "line 12, drivers.theta.motion: 60 rad is 9.5 turns: 60 deg\\?"),
        ({"motion": "{expression: 45}"}, "drivers.theta.motion.expression: 45 rad is 7.2 turns: 45 deg\\?"),
        ({"angle": "10"}, "line 5, bodies.crank.angle: 10 rad is 1.6 turns: 10 deg\\?"),
        ({"angle": "-45"}, "-45 rad is 7.2 turns: -45 deg\\?"),
        ({"AB": "40"}, "line 3, parameters.AB: 40 m is 300 times the others: 40 mm\\?"),
    ],
)
def test_what_may_be_meant_is_said(tmp_path, changes, words):
    with pytest.warns(jn.UnitWarning, match=words):
        load(tmp_path, **changes)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"motion": "7.5 + t"},
        {"motion": "5400*deg + t"},
        {"motion": "360*t"},
        {"angle": "60 rad"},
        {"angle": "6"},
        {"AB": "0.04"},
        {"AB": "40 m"},
        {"AB": "10000"},  # an arm so long that its end moves on a line: 10 m is no link of these either
    ],
)
def test_what_is_meant_as_it_stands_is_not_doubted(tmp_path, changes):
    load(tmp_path, **changes)  # warnings are errors here


@pytest.mark.parametrize("path", sorted(Path("examples").glob("*.yaml")), ids=lambda path: path.stem)
def test_no_false_alarm_in_the_examples(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        jn.load(path)


def test_files_say_what_is_beyond_samples(tmp_path):
    rows = "".join(f"{k / 10},{k / 10 * (2 - k / 10)}\n" for k in range(21))
    (tmp_path / "angle.csv").write_text(f"time,angle\n{rows}")
    for way in ("refuse", "hold", "repeat"):
        law = f"{{samples: angle.csv, degree: 3, beyond: {way}}}"
        loaded = load(tmp_path, motion=law)
        assert loaded.drivers["theta"].motion.beyond == way
        jn.write_mechanism(loaded, tmp_path / "copy.yaml")
        assert jn.load(tmp_path / "copy.yaml") == loaded
    with pytest.raises(jn.MechanismFileError, match=r"drivers.theta.motion.beyond: .*did you mean 'hold'"):
        load(tmp_path, motion="{samples: angle.csv, beyond: hld}")
