"""Laws of segments and of pieces in files, and laws of the coordinate of another driver."""

import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.io.mechanisms.writing.writer import write_mechanism

FILE = """
space: planar
parameters: {lift: 20 mm, speed: 60 rpm}
bodies: {shaft: {position: [0, 0]}, follower: {position: [0, 50 mm]}, table: {position: [1, 0]}}
joints:
  O: {type: revolute, bodies: [ground, shaft], points: [[0, 0], [0, 0]]}
  guide: {type: prismatic, bodies: [ground, follower], points: [[0, 0], [0, 0]], vectors: [[0, 1], [0, 1]]}
  T: {type: revolute, bodies: [ground, table], points: [[1, 0], [0, 0]]}
drivers:
  shaft_angle: {type: coordinate, bodies: [ground, shaft], coordinate: angle, motion: speed*t}
  cam:
    type: coordinate
    bodies: [ground, follower]
    coordinate: y
    motion:
      profile:
        - {profile: dwell, duration: 60 deg}
        - {profile: modified_sine, duration: 120 deg, by: lift}
        - {profile: polynomial_3_4_5, duration: 180 deg, to: 50 mm}
      initial: 50 mm
      beyond: repeat
      of: shaft_angle
  index:
    type: coordinate
    bodies: [ground, table]
    coordinate: angle
    motion: {piecewise: [{until: 0.5 s, expression: t^2}, {expression: t - 0.25}]}
outputs:
  y: {body: follower, quantity: angle}
"""


def loaded(tmp_path, text):
    path = tmp_path / "cam.yaml"
    path.write_text(text.replace("t^2", "t**2"))
    return jn.load(path)


def values(law, parameters, instants):
    jet = law.resolved(parameters)(jn.Jet.variable(np.asarray(instants, float), 3))
    return np.asarray(jet.derivatives())


def with_end(derivatives):
    """The last segment, and what ends with derivatives in its place."""
    return "polynomial_3_4_5, duration: 180 deg", f"polynomial, duration: 180 deg, end: [{derivatives}]"


def test_derivatives_of_a_law_of_an_angle_are_by_that_angle(tmp_path):
    """2 mm/deg at the end, 360 deg/s: 0.72 m/s."""
    for end in ("2 mm/deg", "0.36/pi"):
        law = loaded(tmp_path, FILE.replace(*with_end(end)).replace("beyond: repeat", ""))
        found = values(law.drivers["cam"].motion, law.parameter_values, [1.0 - 1e-14])
        assert found[1, 0] == pytest.approx(0.72)


def test_files_hold_them_and_are_the_same_after_they_were_written(tmp_path):
    mechanism = loaded(tmp_path, FILE)
    parameters, instants = mechanism.parameter_values, [0.1, 1 / 3, 0.4, 0.9, 7.4]
    lift = values(mechanism.drivers["cam"].motion, parameters, instants)
    assert lift[0, 1] == pytest.approx(0.06)  # half of the rise, at 120 degrees
    assert lift[1, 1] == pytest.approx(1.7596 * 0.02 / (1 / 3), rel=1e-4)
    assert values(mechanism.drivers["cam"].motion, parameters | {"lift": 0.03}, [0.5])[0] == pytest.approx(0.08)
    np.testing.assert_allclose(values(mechanism.drivers["index"].motion, {}, [0.4, 0.6])[:2], [[0.16, 0.35], [0.8, 1]])
    write_mechanism(mechanism, tmp_path / "again.yaml")
    again = jn.load(tmp_path / "again.yaml")
    assert "of: shaft_angle" in (tmp_path / "again.yaml").read_text()
    for name in ("cam", "index"):
        before, after = (values(m.drivers[name].motion, parameters, instants) for m in (mechanism, again))
        np.testing.assert_array_equal(before, after)


def test_samples_may_be_those_of_a_cam(tmp_path):
    angle = np.linspace(0, 2 * np.pi, 37)
    rows = "".join(f"{x!r},{float(0.01 * (1 - np.cos(x)))!r}\n" for x in angle.tolist())
    (tmp_path / "cam.csv").write_text(f"angle,lift\n{rows}")
    start, stop = FILE.index("    motion:\n      profile"), FILE.index("  index:")
    law = "    motion: {samples: cam.csv, time: angle, value: lift, beyond: repeat, of: shaft_angle}\n"
    mechanism = loaded(tmp_path, FILE[:start] + law + FILE[stop:])
    found = values(mechanism.drivers["cam"].motion, mechanism.parameter_values, [2.3])
    turn = 2 * np.pi
    expected = [0.01 * (1 - np.cos(turn * 2.3)), 0.01 * turn * np.sin(turn * 2.3)]
    np.testing.assert_allclose(found[:2, 0], expected, rtol=1e-5)


@pytest.mark.parametrize(
    "old, new, name, words",
    [
        ("profile: modified_sine", "profile: modified_sin", "drivers.cam.motion.profile[1].profile", "modified_sine"),
        ("duration: 60 deg", "duration: 60 deg, too: 1", "drivers.cam.motion.profile[0].too", "unknown key"),
        ("of: shaft_angle", "of: shaft", "drivers.cam.motion.of", "shaft"),
        ("motion: speed*t", "motion: {profile: [{profile: dwell, duration: 1 mm}], of: cam}", "drivers", "in a circle"),
        ("to: 50 mm", "to: 51 mm", "drivers.cam.motion", "do not end where they begin"),
        ("duration: 60 deg", "duration: 60 s", "drivers.cam.motion.profile[0].duration", "an angle"),
        ("duration: 60 deg", "duration: 60 mm", "drivers.cam.motion.profile[0].duration", "an angle"),
        ("beyond: repeat", "start: 1 s", "drivers.cam.motion.start", "an angle"),
        (*with_end("2 mm/s"), "drivers.cam.motion.profile[2].end[0]", "must be length per rad, got '2 mm/s'"),
        (*with_end("0, 2 mm/s^2"), "drivers.cam.motion.profile[2].end[1]", r"must be length per rad\^2"),
        ("by: lift", "by: 20 deg", "drivers.cam.motion.profile[1].by", "a length"),
        ("until: 0.5 s", "until: 0.5 m", "drivers.index.motion.piecewise[0].until", "a time"),
        ("until: 0.5 s, ", "", "drivers.index.motion.piecewise[0]", "expression and until"),
        ("beyond: repeat", "beyond: again", "drivers.cam.motion.beyond", "unknown way"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, old, new, name, words):
    assert old in FILE
    with pytest.raises(jn.errors.MechanismFileError, match=words) as caught:
        loaded(tmp_path, FILE.replace(old, new))
    assert caught.value.line is not None
    assert caught.value.name.startswith(name)


def test_a_driver_that_has_the_law_of_an_output_is_not_followed(tmp_path):
    text = FILE.replace("motion: speed*t", "motion: {output: y, law: 0.1*t}")
    assert text != FILE
    with pytest.raises(jn.errors.MechanismFileError, match=r"output y, .*none of its own, got .shaft_angle.") as e:
        loaded(tmp_path, text)
    assert e.value.line is not None
    assert e.value.name == "drivers.cam.motion.of"


def test_the_law_of_an_output_is_read_and_written(tmp_path):
    press = jn.load("examples/servo_press.yaml")
    write_mechanism(press, tmp_path / "again.yaml")
    again = jn.load(tmp_path / "again.yaml")
    before, after = (m.drivers["motor"].motion for m in (press, again))
    assert before.output == after.output == "ram_y"
    instants = [0.0, 0.2, 0.44, 0.9]
    found = [values(law.law, press.parameter_values, instants) for law in (before, after)]
    np.testing.assert_array_equal(*found)
    assert found[0][1, 2] == pytest.approx(-0.06)  # while it forms
    law = jn.laws.HermiteMotion([0.0, 1.0], [[0.0], [1.0]])
    with pytest.raises(jn.errors.MechanismError, match="through derivatives has no form in a file"):
        write_mechanism(jn.load("examples/four_bar.yaml").__class__(
            space="planar", bodies={"a": jn.Body([0, 0])}, joints={},
            drivers={"d": jn.drivers.CoordinateDriver(("ground", "a"), "angle", law)},
        ), tmp_path / "no.yaml")  # fmt: skip


@pytest.mark.parametrize(
    "old, new, name, words",
    [
        ("output: ram_y", "output: ram_z", "drivers.motor.motion.output", "did you mean 'ram_"),
        ("output: ram_y", "output: rame", "drivers.motor.motion.output", "no output has this name"),
        ("output: ram_y", "output: torque", "drivers.motor.motion.output", "cannot be held to a law"),
        ("by: -12 mm", "by: -12 deg", "drivers.motor.motion.law.profile[2].by", "a length"),
        ("      law:", "      lawe: 1\n      law:", "drivers.motor.motion.lawe", "unknown key"),
    ],
)
def test_what_is_wrong_with_the_law_of_an_output_is_named(tmp_path, old, new, name, words):
    text = pathlib.Path("examples/servo_press.yaml").read_text()
    assert old in text
    (tmp_path / "press.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(jn.errors.MechanismFileError, match=words) as caught:
        jn.load(tmp_path / "press.yaml")
    assert caught.value.line is not None
    assert caught.value.name == name
