"""Friction of joints in files: read, written again, and refused with the line where it cannot be."""

import pytest

import jounce as jn

TEXT = """
space: planar
gravity: [0, -9.81]
parameters: {r: 12 mm, mu: 0.1}
bodies: {crank: {mass: 2, inertia: 0.1}}
joints:
  O:
    type: revolute
    bodies: [ground, crank]
    points: [[0, 0], [0, 0]]
    friction: FRICTION
drivers: {turn: {type: coordinate, bodies: [ground, crank], coordinate: angle, motion: 2*t}}
outputs: {torque: {driver: turn, quantity: torque}}
time: {stop: 1, step: 0.5}
"""
PIN = "{coefficient: mu, radius: r, speed: 1 mm/s}"


def written(tmp_path, friction=PIN, **changes):
    text = TEXT.replace("FRICTION", friction)
    for old, new in changes.items():
        text = text.replace(old, new)
    path = tmp_path / "crank.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("ending", ["yaml", "toml", "json"])
def test_what_is_written_is_read_again(tmp_path, ending):
    mechanism = jn.load(written(tmp_path))
    friction = mechanism.joints["O"].friction
    assert (friction.speed, str(friction.radius)) == (1e-3, "r")
    assert jn.solve(mechanism, order=1).outputs["torque"][1, 0] == pytest.approx(0.1 * 0.012 * 2 * 9.81, rel=1e-12)
    jn.write_mechanism(mechanism, tmp_path / f"again.{ending}")
    again = jn.load(tmp_path / f"again.{ending}")
    assert again == mechanism
    twice = again.with_parameters(mu=0.2)
    assert jn.solve(twice, order=1).outputs["torque"][1, 0] == pytest.approx(0.2 * 0.012 * 2 * 9.81, rel=1e-12)


@pytest.mark.parametrize(
    "friction, words",
    [
        ("{coefficient: -0.1, radius: r, speed: 1 mm/s}", "must not be negative"),
        ("{coefficient: mu, radius: r}", r"speed: is missing: give \{coefficient: ..., speed: ...\}"),
        ("{coefficient: mu, speed: 1 mm/s}", "radius: is missing: the bodies turn"),
        ("{coefficient: mu, radius: 0, speed: 1 mm/s}", "must be greater than zero"),
        ("{coefficient: mu, radius: r, speed: 0}", "must be greater than zero"),
        (
            "{coefficient: mu, radius: r, speed: 1 mm}",
            "expected a speed, such as 1 mm/s, but the unit of '1 mm' is a length",
        ),
        ("{coefficient: mu, radius: r, speed: 1, viscous: 3}", "no key has this name"),
        ("0.1", r"must be a mapping, as \{coefficient"),
    ],
)
def test_bad_friction_is_refused_with_its_line(tmp_path, friction, words):
    with pytest.raises(jn.errors.MechanismFileError, match=rf"crank\.yaml, line 11, .*friction.*{words}"):
        jn.load(written(tmp_path, friction))


def test_a_guide_has_no_radius_and_a_rod_no_friction(tmp_path):
    guide = {"type: revolute": "type: prismatic", "[[0, 0], [0, 0]]": "[[0, 0], [0, 0]]\n    vectors: [[1, 0], [1, 0]]"}
    with pytest.raises(jn.errors.MechanismFileError, match="radius: is none of a guide"):
        jn.load(written(tmp_path, PIN, **guide))
    rod = {"type: revolute": "type: double_revolute", "[[0, 0], [0, 0]]": "[[0, 0], [1, 0]]\n    length: 1"}
    with pytest.raises(jn.errors.MechanismFileError, match="friction"):
        jn.load(written(tmp_path, PIN, **rod))
