"""Every way a mechanism file can be wrong ends in one message with file, line, name and value, never in a traceback."""

import pathlib
import subprocess
import sys

import pytest
from ruamel.yaml import YAML

from jounce.errors import MechanismFileError
from jounce.io import load
from jounce.io.mechanisms.schema.key_check import check_keys

ROOT = pathlib.Path(__file__).resolve().parents[3]
PLANAR = """\
title: Planar four-bar
space: planar
gravity: [0, -9.81]
parameters: {AD: 13.21 cm, AB: 4.00 cm, BC: 14.23 cm, CD: 20.31 cm, tau: 2 s}
bodies:
  crank:  {position: [0, 0], angle: 30 deg}
  rocker: {position: [AD, 0], angle: 100 deg}
joints:
  A:  {type: revolute, bodies: [ground, crank], points: [[0, 0], [0, 0]]}
  D:  {type: revolute, bodies: [ground, rocker], points: [[AD, 0], [0, 0]]}
  BC: {type: double_revolute, bodies: [crank, rocker], points: [[AB, 0], [CD, 0]], length: BC}
drivers:
  theta: {type: coordinate, bodies: [ground, crank], coordinate: angle, motion: 30*deg + 60*deg*sin(2*pi*t/tau)}
outputs:
  psi: {body: rocker, quantity: angle}
  C: {body: rocker, point: [CD, 0]}
time: {start: 0, stop: 2, step: 0.01}
"""
PLANAR_FORCES = (
    PLANAR
    + """\
forces:
  pull: {type: spring, bodies: [ground, rocker], points: [[0, 0], [CD, 0]], stiffness: 500 N/m, length: 5 cm}
  push: {type: point_force, body: crank, point: [AB, 0], law: [-2*vx, 3 N]}
  brake: {type: torque, bodies: [ground, crank], law: -0.1*v}
initial:
  start: {type: coordinate, bodies: [ground, rocker], coordinate: angle, motion: 2*t}
"""
)
SPATIAL = """\
space: spatial
parameters: {L: 10 cm}
bodies:
  crank:
    position: [0, 0, 0]
    orientation: {axis: [0, 0, 1], angle: 30 deg}
joints:
  O: {type: revolute, bodies: [ground, crank], points: [[0, 0, 0], [0, 0, 0]], axes: [[0, 0, 1], [0, 0, 1]]}
drivers:
  theta: {type: rotation, bodies: [ground, crank], axis: [0, 0, 1], motion: 2*pi*t}
outputs:
  tip: {body: crank, point: [L, 0, 0]}
  turn: {bodies: [ground, crank], quantity: angle, axis: [0, 0, 1], vectors: [[1, 0, 0], [1, 0, 0]]}
"""
SPATIAL_FORCES = (
    SPATIAL
    + """\
forces:
  twist: {type: torsional_spring, bodies: [ground, crank], axis: [0, 0, 1], stiffness: 2 N*m/rad, angle: 10 deg}
  spin: {type: moment, body: crank, law: [-wx, 0, 1 N*m], frame: body}
"""
)
FILES = {"planar": PLANAR, "planar forces": PLANAR_FORCES, "spatial": SPATIAL, "spatial forces": SPATIAL_FORCES}
CASES = YAML(typ="safe").load(pathlib.Path(__file__).with_name("bad_input.yaml"))


def found_early(path):
    """Return what is found before JAX is imported; None where nothing is."""
    try:
        check_keys(path)
    except MechanismFileError as error:
        return str(error)


@pytest.mark.parametrize(
    "space, what", [pytest.param(space, what, id=f"{space}-{what}") for space in CASES for what in CASES[space]]
)
def test_file_with_one_mistake(tmp_path, space, what):
    case, text = CASES[space][what], FILES[space]
    assert case["instead_of"] in text
    path = tmp_path / "file.yaml"
    path.write_text(text.replace(case["instead_of"], case["text"], 1))
    with pytest.raises(MechanismFileError) as caught:
        load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}, line {case['line']}, {case['name']}: ")
    assert case["says"] in message
    assert message.isprintable()
    assert found_early(path) in (None, message)


@pytest.mark.parametrize("text", FILES.values(), ids=FILES)
def test_the_files_without_mistakes_are_read(tmp_path, text):
    path = tmp_path / "good.yaml"
    path.write_text(text)
    assert load(path).bodies


@pytest.mark.parametrize("text, words", [("- a\n", "got ['a']"), ("hello", "got 'hello'")])
def test_a_file_that_is_no_mapping(tmp_path, text, words):
    path = tmp_path / "list.yaml"
    path.write_text(text)
    with pytest.raises(MechanismFileError, match="mapping with the keys space, bodies, joints") as caught:
        load(path)
    assert words in str(caught.value)


def test_a_file_of_comments_only_is_empty(tmp_path):
    path = tmp_path / "list.yaml"
    path.write_text("# nothing")
    with pytest.raises(MechanismFileError, match=r"list\.yaml: the file is empty"):
        load(path)


@pytest.mark.parametrize("file", sorted((ROOT / "examples").glob("*.yaml")), ids=lambda file: file.stem)
def test_the_early_look_passes_what_is_right_and_that_alone(tmp_path, file):
    check_keys(file)
    path = tmp_path / "misspelled.yaml"
    path.write_text(file.read_text().replace("bodies:", "bodis:", 1))
    with pytest.raises(MechanismFileError, match="'bodis'"):
        check_keys(path)


def test_a_misspelling_is_reported_without_jax(tmp_path):
    path = tmp_path / "typo.yaml"
    path.write_text(PLANAR.replace("angle: 30", "angel: 30"))
    command = [sys.executable, "-X", "importtime", "-m", "jounce", "inspect", path]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    imported = [line.rpartition("|")[2].strip() for line in done.stderr.splitlines() if line.startswith("import time:")]
    assert "ruamel.yaml" in imported
    assert not {"jax", "numpy", "pydantic"} & set(imported)
    assert "line 6, bodies.crank.angel: unknown key 'angel'; did you mean 'angle'?" in done.stderr
    assert done.returncode == 2


def test_a_misspelled_key_is_named_rather_than_the_key_that_misses(tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text("space: planar\nbodies:\n  a: {}\njoints:\n  A:\n    type: double_revolute\n    lenght: 1\n")
    with pytest.raises(MechanismFileError, match=r"line 7, joints.A.lenght: unknown key 'lenght'"):
        load(path)


@pytest.mark.parametrize(
    "spaces, words",
    [(3, "further than the entries beside it (3 spaces, not 2)"), (1, "less than those before it (1 space, not 2)")],
)
def test_a_line_that_is_indented_otherwise_is_reported_with_its_column(tmp_path, spaces, words):
    path = tmp_path / "indent.yaml"
    path.write_text(f"space: planar\nbodies:\n  a: {{position: [0, 0]}}\n{' ' * spaces}b: {{position: [1, 0]}}\n")
    with pytest.raises(MechanismFileError, match="indented") as error:
        load(path)
    assert f"line 4: the YAML cannot be read: the line is indented {words}" in str(error.value)


def test_a_colon_without_a_space_is_reported(tmp_path):
    path = tmp_path / "glued.yaml"
    path.write_text("space: planar\nbodies: {a: {}}\njoints:\n  A: {type:revolute, bodies: [ground, a]}\n")
    with pytest.raises(MechanismFileError, match=r"line 4, .* a colon must be followed by a space: write type: r"):
        load(path)


@pytest.mark.parametrize(
    "joint, words",
    [
        ("{type: double_revolute, bodies: [a, b], points: [[0, 0], [0, 0]], length: 4,5 mm}", "such as 4.5 mm"),
        ("{type: gear, bodies: [a, b], points: [[0, 0], [0, 0]], radii: [100, 200]}", "is in m: write mm"),
    ],
)
def test_a_decimal_comma_between_braces_and_radii_in_millimeters_are_recognized(tmp_path, joint, words):
    path = tmp_path / "pair.yaml"
    path.write_text(
        "space: planar\nbodies: {a: {}, b: {position: [0.3, 0]}}\njoints:\n"
        "  A: {type: revolute, bodies: [ground, a], points: [[0, 0], [0, 0]]}\n"
        "  B: {type: revolute, bodies: [ground, b], points: [[0.3, 0], [0, 0]]}\n"
        f"  C: {joint}\n"
    )
    with pytest.raises(MechanismFileError, match=words):
        load(path)
