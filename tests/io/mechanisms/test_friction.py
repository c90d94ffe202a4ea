"""Friction of joints in files: read, written again, and refused with the line where it cannot be."""

import pytest

import jounce as jn

pytestmark = pytest.mark.long

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
    with pytest.raises(jn.errors.MechanismFileError, match="radius: does not apply to a guide"):
        jn.load(written(tmp_path, PIN, **guide))
    rod = {"type: revolute": "type: double_revolute", "[[0, 0], [0, 0]]": "[[0, 0], [1, 0]]\n    length: 1"}
    with pytest.raises(jn.errors.MechanismFileError, match="friction"):
        jn.load(written(tmp_path, PIN, **rod))


GEARS = """
space: planar
parameters: {eta: 0.9, slow: 10 rpm}
bodies: {a: {}, b: {position: [0.3, 0]}}
joints:
  A: {type: revolute, bodies: [ground, a], points: [[0, 0], [0, 0]]}
  B: {type: revolute, bodies: [ground, b], points: [[0.3, 0], [0, 0]]}
  mesh:
    type: gear
    bodies: [a, b]
    points: [[0, 0], [0, 0]]
    radii: [0.1, 0.2]
    friction: FRICTION
forces: {load: {type: torque, bodies: [ground, b], law: 8*eta}}
drivers: {turn: {type: coordinate, bodies: [ground, a], coordinate: angle, motion: 200*t}}
outputs: {torque: {driver: turn, quantity: torque}}
time: {stop: 1, step: 0.5}
"""


def gears(tmp_path, friction):
    path = tmp_path / "gears.yaml"
    path.write_text(GEARS.replace("FRICTION", friction))
    return path


@pytest.mark.parametrize("ending", ["yaml", "toml", "json"])
@pytest.mark.parametrize(
    "friction, torque",
    [
        ("{efficiency: eta, speed: slow}", 4.0),
        pytest.param("{efficiency: eta, backward: 0.1, speed: slow}", 4.0, marks=pytest.mark.slow),
        ("{coefficient: eta - 0.8, lead_angle: 45 deg, speed: slow}", 3.6 * 1.1 / 0.9),
    ],
)
def test_friction_of_gears_that_is_written_is_read_again(tmp_path, friction, torque, ending):
    mechanism = jn.load(gears(tmp_path, friction))
    found = jn.solve(mechanism, order=1).outputs["torque"][1, 0]
    assert found == pytest.approx(torque, rel=1e-9)  # 4 N m of the load, which the gears pass on backward or forward
    jn.write_mechanism(mechanism, tmp_path / f"again.{ending}")
    assert jn.load(tmp_path / f"again.{ending}") == mechanism


@pytest.mark.parametrize(
    "friction, words",
    [
        ("{efficiency: 0, speed: slow}", r"friction\.efficiency: must be above 0 and at most 1"),
        ("{efficiency: 0.9}", r"friction\.speed: is missing: give \{speed: ...\}"),
        ("{speed: slow}", "gears have either an efficiency, or a coefficient"),
        ("{efficiency: 0.9, speed: 1 mm/s}", "expected an angular speed, such as 10 rpm, but the unit of '1 mm/s' is"),
        ("{coefficient: 0.1, radius: 5 mm, speed: slow}", "no key has this name"),
    ],
)
def test_bad_friction_of_gears_is_refused_with_its_line(tmp_path, friction, words):
    with pytest.raises(jn.errors.MechanismFileError, match=rf"gears\.yaml, line 13, .*{words}"):
        jn.solve(jn.load(gears(tmp_path, friction)), order=1)


def test_a_worm_that_cannot_drive_its_wheel_is_refused(tmp_path):
    with pytest.raises(jn.errors.MechanismError, match=r"joints\.mesh\.friction: the worm cannot drive its wheel"):
        jn.solve(jn.load(gears(tmp_path, "{coefficient: 0.3, lead_angle: 80 deg, speed: slow}")), order=1)


def test_inspect_tells_efficiencies_and_what_locks_itself(tmp_path, capsys):
    from jounce.cli import main

    for friction, words in (
        ("{efficiency: eta, backward: 0.8, speed: slow}", "mesh: efficiency 0.9 from a to b, 0.8 from b to a"),
        ("{efficiency: 0.4, backward: -0.5, speed: slow}", "0.4 from a to b; locks itself: b does not drive a"),
    ):
        assert main(["inspect", str(gears(tmp_path, friction))]) == 0
        assert words in " ".join(capsys.readouterr().out.split())
