"""Warnings of numbers that are likely meant in another unit."""

import dataclasses
import math
import warnings
from pathlib import Path

import pytest

import jounce as jn
from jounce.io.mechanisms.overrides import override
from jounce.io.mechanisms.schema.unit_hints import warn_of_variations

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
{time}"""
PLAIN = {"AB": "4 cm", "angle": "30 deg", "motion": "30*deg + 5*t", "time": ""}


def load(folder, **changes):
    path = folder / "four_bar.yaml"
    time = {"time": f"time: {changes['time']}\n"} if "time" in changes else {}
    path.write_text(FOUR_BAR.format(**{**PLAIN, **changes, **time}))
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
    with pytest.warns(jn.errors.UnitWarning, match=words):
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


PENDULUM = """
space: planar
parameters: {{L: {L}}}
bodies:
  bar: {{position: [0, 0], angle: 30 deg}}
joints:
  A: {{type: revolute, bodies: [ground, bar], points: [[{x}, 0], [0, 0]]}}
outputs:
  tip: {{body: bar, point: [L, {y}]}}
"""


@pytest.mark.parametrize("x, y, L", [("100 mm", "0", "300"), ("0", "20 mm", "300"), ("20 mm", "3 cm", "12")])
def test_a_parameter_without_a_unit_is_compared_with_the_few_lengths_that_have_one(tmp_path, x, y, L):
    path = tmp_path / "pendulum.yaml"
    path.write_text(PENDULUM.format(x=x, y=y, L=L))
    with pytest.warns(jn.errors.UnitWarning, match=f"yaml, line 3, parameters.L: {L} m is .* a unit: {L} mm\\?"):
        jn.load(path)


@pytest.mark.parametrize(
    "x, y, L",
    [("0.1", "0", "300"), ("20 mm", "0", "0.3"), ("20 mm", "0", "300 m"), ("4 m", "0", "12")],
)
def test_a_parameter_without_a_unit_that_suits_those_with_one_is_not_doubted(tmp_path, x, y, L):
    path = tmp_path / "pendulum.yaml"
    path.write_text(PENDULUM.format(x=x, y=y, L=L))
    jn.load(path)  # warnings are errors here


@pytest.mark.parametrize("path", sorted(Path("examples").glob("*.yaml")), ids=lambda path: path.stem)
def test_no_false_alarm_in_the_examples(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        jn.load(path)


PROFILE = "{{profile: [{{profile: cycloidal, duration: 1, to: {}}}]}}"


@pytest.mark.parametrize(
    "motion, words",
    [
        ("30 + 60*sin(2*pi*t)", r"line 12, drivers.theta.motion: goes from -30 to 90 rad, 19 turns: degrees\?"),
        ("45*cos(pi*t/2) - 10", r"goes from -55 to 35 rad, 14 turns: degrees\?"),
        (PROFILE.format(90), r"goes from 0 to 90 rad, 14 turns: degrees\?"),
        (
            "{profile: [{profile: modified_sine, duration: 1, to: 30}, {profile: dwell, duration: 1}]}",
            "from 0 to 30 rad",
        ),
        ("{piecewise: [{until: 1, expression: 45*t}, {expression: 45}]}", "goes from 0 to 45 rad"),
        ("{samples: swing.csv}", r"goes from -30 to 90 rad"),
        ("{profile: [{profile: trapezoidal, duration: 1, to: 120}]}", "goes from 0 to 120 rad"),
    ],
)
def test_laws_that_take_degrees_over_the_run_are_reported(tmp_path, motion, words):
    rows = "".join(f"{k / 100},{30 + 60 * math.sin(math.pi * k / 100)}\n" for k in range(201))
    (tmp_path / "swing.csv").write_text(f"time,angle\n{rows}")
    with pytest.warns(jn.errors.UnitWarning, match=words):
        load(tmp_path, motion=motion, time="{start: 0, stop: 2, step: 0.01}")


@pytest.mark.parametrize(
    "motion",
    [
        "6000*2*pi/60*t",
        "628.3*t",
        "2*pi*10*t",
        "360*t",
        "100*(1 - exp(-t/0.2))",  # a motor runs up, and goes on
        "0.5 + 40*t + 0.1*sin(30*t)",
        "20*pi*sin(t)",  # a winch, ten turns each way
        "1000*deg*sin(t)",
        "3 + 3*sin(t)",
        "{profile: [{profile: cycloidal, duration: 1, to: 5 rev}]}",
        "{profile: [{profile: cycloidal, duration: 1, to: 1000 deg}]}",
        "{profile: [{profile: cycloidal, duration: 1, to: 1.57}, {profile: dwell, duration: 1}], beyond: advance}",
        "{piecewise: [{until: 1, expression: 3*t}, {expression: 3}]}",
        "{samples: winch.csv}",
        "{samples: shaft.csv}",
    ],
)
def test_laws_that_turn_on_or_have_units_are_not_doubted(tmp_path, motion):
    winch = "".join(f"{k / 100},{30 + 60 * math.sin(math.pi * k / 100)}\n" for k in range(201))
    (tmp_path / "winch.csv").write_text(f"time [s],angle [rad]\n{winch}")
    shaft = "".join(f"{k / 100},{k + 0.3 * math.sin(k)}\n" for k in range(201))
    (tmp_path / "shaft.csv").write_text(f"time,angle\n{shaft}")
    load(tmp_path, motion=motion, time="{start: 0, stop: 2, step: 0.01}")  # warnings are errors here


BARE = """
space: planar
parameters: {{AD: {AD}, AB: {AB}, BC: {BC}, CD: {CD}}}
bodies:
  crank: {{position: [0, 0], angle: 30 deg{crank}}}
  rocker: {{position: [AD, 0], angle: 100 deg}}
joints:
  A:  {{type: revolute, bodies: [ground, crank], points: [[0, 0], [0, 0]]}}
  D:  {{type: revolute, bodies: [ground, rocker], points: [[AD, 0], [0, 0]]}}
  BC: {{type: double_revolute, bodies: [crank, rocker], points: [[AB, 0], [CD, 0]], length: BC}}
drivers:
  theta: {{type: coordinate, bodies: [ground, crank], coordinate: angle, motion: {motion}}}
time: {{start: 0, stop: 2, step: 0.01}}
"""
MILLIMETERS = {"AD": "132.1", "AB": "40", "BC": "142.3", "CD": "203.1", "motion": "30*deg + 2*pi*t", "crank": ""}


def bare(folder, **changes):
    path = folder / "bare.yaml"
    path.write_text(BARE.format(**{**MILLIMETERS, **changes}))
    return jn.load(path)


@pytest.mark.parametrize(
    "changes, words",
    [
        ({}, r"line 3, parameters.CD: the lengths of this file go up to 203.1 m, which would move at .* m/s: millim"),
        ({"motion": "30*deg + 60*deg*sin(pi*t)"}, "millimeters"),
        ({"motion": "30*deg", "crank": ", mass: 0.2, inertia: 0.0001"}, "of masses up to 0.2 kg: millimeters"),
        ({"motion": "30*deg", "crank": ", mass: 30, inertia: 0.02"}, "an inertia of 0.02 kg m.2: millimeters"),
    ],
)
def test_a_file_in_bare_millimeters_is_reported(tmp_path, changes, words):
    with pytest.warns(jn.errors.UnitWarning, match=words):
        bare(tmp_path, **changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"AD": "132.1 m"},
        {"AD": "0.1321", "AB": "0.04", "BC": "0.1423", "CD": "0.2031"},
        {"AD": "13.21e-4", "AB": "4e-4", "BC": "14.23e-4", "CD": "20.31e-4"},  # a watch
        {"AD": "13.2", "AB": "4", "BC": "14.2", "CD": "20.3", "motion": "30*deg + 0.1*t"},  # a crane
        {"AD": "66", "AB": "20", "BC": "71", "CD": "100", "motion": "30*deg + 0.05*t",
         "crank": ", mass: 20000, inertia: 1000000"},
        {"motion": "30*deg + 20*deg*sin(0.1*t)", "crank": ", mass: 5e4, inertia: 1e7"},
    ],
)  # fmt: skip
def test_lengths_that_may_be_metres_are_not_doubted(tmp_path, changes):
    bare(tmp_path, **changes)


@pytest.mark.parametrize(
    "given, words",
    [
        ("AB=30", r"--set AB: 30 m is 800 times what it was: 30 mm\?"),
        ("amplitude=60", r"--set amplitude: 60 rad is 9.5 turns: 60 deg\?"),
        ("swing=45", r"--set: now the law of drivers.theta goes from -44.5 to 45.5 rad, 14 turns: degrees\?"),
    ],
)
def test_a_value_set_without_its_unit_is_reported(tmp_path, given, words):
    (tmp_path / "set.yaml").write_text(
        FOUR_BAR.format(**PLAIN | {"motion": "0.5 + (amplitude + swing)*sin(pi*t)", "AB": "4 cm"}).replace(
            "AD: 13.21 cm", "AD: 13.21 cm, amplitude: 0 deg, swing: 0.4"
        )
        + "time: {start: 0, stop: 2, step: 0.01}\n"
    )
    mechanism = jn.load(tmp_path / "set.yaml")
    if given.startswith("swing"):
        mechanism = dataclasses.replace(mechanism, dimensions={"AB": mechanism.dimensions["AB"]})
    with pytest.warns(jn.errors.UnitWarning, match=words):
        override(mechanism, [given])


def test_values_that_are_set_as_they_are_meant_are_not_doubted():
    mechanism = jn.load("examples/four_bar.yaml")
    for given in ("AB=0.03", "AB=30 mm", "tau=60", "BC=15 cm"):
        assert override(mechanism, [given]).parameters


@pytest.mark.parametrize(
    "section, coordinate, law, words",
    [
        ("drivers", "angle", "profile", r"profile\[2\]\.duration: 180 rad is 29 turns: 180 deg\?"),
        ("drivers", "y", "profile", r"profile\[2\]\.duration: 180 rad is 29 turns: 180 deg\?"),
        ("joints", "y", "profile", r"profile\[2\]\.duration: 180 rad is 29 turns: 180 deg\?"),
        ("joints", "angle", "piecewise", r"piecewise\[1\]\.until: 360 rad is 57 turns: 360 deg\?"),
    ],
)
def test_a_cam_law_over_degrees_without_a_unit_is_reported(tmp_path, section, coordinate, law, words):
    follower = CAM_FOLLOWER.format(coordinate=coordinate, law=CAM_LAWS[law])
    path = tmp_path / "cam.yaml"
    path.write_text(CAM.replace(f"{section}:\n", f"{section}:\n{follower}"))
    with pytest.warns(jn.errors.UnitWarning, match=rf"{section}\.table\.motion\.{words}"):
        jn.load(path)


@pytest.mark.parametrize("duration", ["120 deg", "2*pi/3", "2.1"])
def test_a_cam_law_over_angles_is_not_doubted(tmp_path, duration):
    law = f"profile: [{{profile: cycloidal, duration: {duration}, to: 0.1}}], beyond: hold"
    path = tmp_path / "cam.yaml"
    path.write_text(CAM.replace("joints:\n", "joints:\n" + CAM_FOLLOWER.format(coordinate="y", law=law)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        jn.load(path)


CAM = """
space: planar
bodies:
  shaft: {position: [0, 0]}
  table: {position: [1, 0]}
joints:
  bearing: {type: revolute, bodies: [ground, shaft], points: [[0, 0], [0, 0]]}
  pivot: {type: revolute, bodies: [ground, table], points: [[1, 0], [0, 0]]}
drivers:
  shaft: {type: coordinate, bodies: [ground, shaft], coordinate: angle, motion: 2*pi*t}
time: {start: 0, stop: 1, step: 0.01}
"""
CAM_FOLLOWER = """
  table: {{type: coordinate, bodies: [ground, table], coordinate: {coordinate}, motion: {{{law}, of: shaft}}}}
"""
CAM_LAWS = {
    "profile": "profile: [{profile: cycloidal, duration: 120, to: 0.5}, {profile: dwell, duration: 60}, "
    "{profile: cycloidal, duration: 180, to: 0}], beyond: repeat",
    "piecewise": "piecewise: [{until: 90, expression: 0}, {until: 360, expression: 0}], beyond: hold",
}


def test_files_say_what_is_beyond_samples(tmp_path):
    rows = "".join(f"{k / 10},{k / 10 * (2 - k / 10)}\n" for k in range(21))
    (tmp_path / "angle.csv").write_text(f"time,angle\n{rows}")
    for way in ("refuse", "hold", "repeat"):
        law = f"{{samples: angle.csv, degree: 3, beyond: {way}}}"
        loaded = load(tmp_path, motion=law)
        assert loaded.drivers["theta"].motion.beyond == way
        jn.write_mechanism(loaded, tmp_path / "copy.yaml")
        assert jn.load(tmp_path / "copy.yaml") == loaded
    with pytest.raises(jn.errors.MechanismFileError, match=r"drivers.theta.motion.beyond: .*did you mean 'hold'"):
        load(tmp_path, motion="{samples: angle.csv, beyond: hld}")


@pytest.mark.parametrize(
    "form, words",
    [
        ("200:400", "--vary BC: 200 m is 1000 times what it is: 200 mm\\?"),
        ("0.14:150:3", "150 m is 1000 times"),
        ("normal:0.1", "a spread of 0.1 m about 0.1423 m: 0.1 mm\\?"),
        ("uniform:200", "a spread of 200 m"),
    ],
)
def test_ranges_of_parameters_without_a_unit_are_compared_with_their_values(tmp_path, form, words):
    with pytest.warns(jn.errors.UnitWarning, match=words) as caught:
        warn_of_variations(load(tmp_path), {"BC": form}, "--vary")
    assert len(caught) == 1


@pytest.mark.parametrize("form", ["0.1:0.2", "20 cm:40 cm", "normal:0.1 mm", "uniform:0.001", "1:2"])
def test_ranges_of_parameters_that_suit_their_values_are_not_doubted(tmp_path, form):
    warn_of_variations(load(tmp_path), {"BC": form, "nothing": "200:400"}, "--vary")  # warnings are errors here


SLIDER = """
space: planar
parameters: {{x0: 50 mm, L: {L}}}
bodies:
  slide: {{position: [x0, 0]}}
joints:
  guide: {{type: prismatic, bodies: [ground, slide], points: [[0, 0], [0, 0]], vectors: [[1, 0], [1, 0]]}}
drivers:
  push: {{type: coordinate, bodies: [ground, slide], coordinate: x, motion: {motion}}}
outputs:
  edge: {{body: slide, point: [120 mm, 0]}}
time: {{start: 0, stop: {stop}, step: 0.1}}
"""


def slider(folder, motion, L="300", stop="1"):
    path = folder / "slider.yaml"
    path.write_text(SLIDER.format(motion=motion, L=L, stop=stop))
    return jn.load(path)


@pytest.mark.parametrize(
    "motion, farthest, fastest",
    [("x0 + L*t**2", "300", "59[89]"), ("x0 + 300*t**2", "300", "59[89]"), ("L*sin(2*pi*t)", "300", "1.88e.03"),
     ("{profile: [{profile: cycloidal, duration: 1, to: 250}]}", "250", "500")],
)  # fmt: skip
def test_a_law_of_a_length_in_millimeters_is_reported(tmp_path, motion, farthest, fastest):
    """Speeds by hand: 300 (2 - 1/200) m/s of the squares, on a grid of 201 instants; 2 (250) of the cycloid."""
    words = f"line 9, drivers.push.motion: goes to {farthest} m at up to {fastest} m/s, .* about 0.085 m: millimeters"
    with pytest.warns(jn.errors.UnitWarning, match=words):
        slider(tmp_path, motion)


@pytest.mark.parametrize(
    "motion, L, stop",
    [
        ("x0 + L*t**2", "0.3", "1"),
        ("x0 + L*t**2", "300 m/s^2", "1"),  # a unit was thought of
        ("x0 + L*t", "25", "10"),  # a vehicle with small wheels
        ("x0 + L*t", "2e6", "1"),  # 2 km of which 1/1000 is no length of these
    ],
)
def test_a_law_of_a_length_as_it_is_meant_is_not_doubted(tmp_path, motion, L, stop):
    slider(tmp_path, motion, L, stop)  # warnings are errors here
