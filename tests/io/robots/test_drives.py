"""Files of drives: units of what turns and what slides, defaults, and the messages about what they may not say."""

import math

import pytest

import jounce as jn


@pytest.fixture(scope="module")
def crane():
    """Return a carriage that slides, with a rod that turns and a finger that follows it."""
    body = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    links = [jn.Link(name, body) for name in ("base", "carriage", "rod", "finger", "plate")]
    joints = [
        jn.Joint("slide", "base", "carriage", "prismatic"),
        jn.Joint("pin", "carriage", "rod"),
        jn.Joint("finger", "rod", "finger", mimic=jn.robot.Mimic("pin")),
        jn.Joint("plate", "rod", "plate", "fixed"),
    ]
    return jn.Robot("crane", links, joints)


@pytest.fixture
def read(crane, tmp_path):
    def call(text, system=crane):
        path = tmp_path / "drives.yaml"
        path.write_text(text, encoding="utf-8")
        return jn.io.load_drives(path, system)

    return call


def test_units_are_those_of_what_turns_and_what_slides(read):
    drives = read(
        "joints:\n"
        "  pin: {stiffness: 2 kN*m/rad, damping: 3 N*m*s/rad, rotor_inertia: 5 kg*cm^2, gear_ratio: 100,\n"
        "        deflection_limit: 1 deg, torque_limit: 2 N*m, velocity_limit: 3000 rpm}\n"
        "  slide: {stiffness: 50 N/mm, damping: 20 N*s/m, rotor_inertia: 2e-5 kg*m^2, lead: 5 mm/rev,\n"
        "          deflection_limit: 1 mm, torque_limit: 0.2 N*m, velocity_limit: 100 rad/s}\n"
    )
    pin, slide = drives["pin"], drives["slide"]
    assert (pin.stiffness, pin.damping, pin.gear_ratio, pin.torque_limit) == (2000.0, 3.0, 100.0, 2.0)
    assert pin.rotor_inertia == pytest.approx(5e-4)
    assert pin.deflection_limit == math.radians(1)
    assert pin.velocity_limit == pytest.approx(100 * math.pi)
    assert (slide.stiffness, slide.damping, slide.torque_limit) == (5e4, 20.0, 0.2)
    assert slide.lead == pytest.approx(0.005, rel=1e-15)
    assert slide.reflected_inertia == pytest.approx(2e-5 * (2 * math.pi / 0.005) ** 2)


def test_defaults_are_for_the_kind_that_their_units_say(read):
    assert set(read("default: {stiffness: 10 N*m/rad}")) == {"pin"}
    assert set(read("default: {stiffness: 10 N/m}")) == {"slide"}
    assert set(read("default: {stiffness: 10}")) == {"pin", "slide"}
    assert set(read("default: {stiffness: 10}\njoints: {pin: null}")) == {"slide"}
    own = read("default: {stiffness: 10, damping: 1}\njoints: {pin: {stiffness: 20, damping: null}}")
    assert (own["pin"].stiffness, own["pin"].damping) == (20.0, 0.0)


@pytest.mark.parametrize(
    "text, words",
    [
        ("joints: {pim: {stiffness: 1}}", ("line 1", "joints.pim", "pin")),
        ("joints: {finger: {stiffness: 1}}", ("follows pin",)),
        ("joints: {plate: {stiffness: 1}}", ("fixed",)),
        ("drivers: {pin: {stiffness: 1}}", ("'joints'",)),
        ("title: none", ("'joints', 'default'",)),
        ("joints:\n  pin:\n    stiffness: 1 N/m", ("line 3", "joints.pin.stiffness", "N*m/rad")),
        ("joints: {slide: {stiffness: 1 N*m/rad}}", ("N/m",)),
        ("joints: {slide: {stiffness: 1, rotor_inertia: 1 kg*m^2}}", ("motor that slides", "kg")),
        ("joints: {pin: {stiffness: 1, gear_ratio: 5 mm}}", ("gear_ratio", "no unit")),
        ("joints: {pin: {stiffness: 1, lead: 5 mm}}", ("gear_ratio",)),
        ("joints: {pin: {stiffness: -1}}", ("joints.pin.stiffness", "greater than zero")),
        ("joints: {pin: {damping: 1}}", ("spring",)),
        ("joints: {pin: {stifness: 1}}", ("stiffness",)),
        ("joints: {pin: {stiffness: 1, lead: 1, gear_ratio: 2}}", ("lead",)),
        ("default: {stiffness: 5 kg}", ("stiffness", "a mass")),
        ("joints: {pin: {stiffness: .inf}}", ("finite",)),
    ],
)
def test_mistakes_are_reported_with_place_and_advice(read, text, words):
    with pytest.raises(jn.errors.RobotError) as raised:
        read(text)
    message = str(raised.value)
    assert "drives.yaml" in message
    assert all(word in message for word in words), message


def test_drives_of_a_mechanism_are_by_its_drivers(read):
    platform = jn.load("examples/sea_platform.yaml")
    drives = jn.io.load_drives("examples/drives/sea_platform.yaml", platform)
    assert list(drives) == [f"leg{k}" for k in range(1, 7)]
    assert (drives["leg1"].stiffness, drives["leg2"].stiffness, drives["leg2"].lead) == (55e3, 50e3, 0.005)
    with pytest.raises(jn.errors.RobotError, match="'drivers'"):
        read("joints: {leg1: {stiffness: 1}}", platform)


def test_a_rotor_that_is_likely_in_kg_cm2_is_reported(read):
    """A servo motor of 0.6 kg cm^2, given as 0.6, has ten thousand times its inertia."""
    says = r"line 2, joints.pin.rotor_inertia: a rotor of 0.6 kg\*m\^2 is 6e\+03 kg\*m\^2 .* of 100: 0.6 kg\*cm\^2\?"
    with pytest.warns(jn.errors.UnitWarning, match=says):
        read("joints:\n  pin: {stiffness: 2 kN*m/rad, rotor_inertia: 0.6, gear_ratio: 100}\n")
    for rotor in ("0.6 kg*m^2, gear_ratio: 100", "0.6", "6e-5, gear_ratio: 100"):  # warnings are errors here
        read(f"joints:\n  pin: {{stiffness: 2 kN*m/rad, rotor_inertia: {rotor}}}\n")


def test_a_lead_that_is_likely_in_millimeters_is_reported(read):
    """A ball screw of 20 mm, given as 20: the motor would turn a thousandth of what it does."""
    with pytest.warns(jn.errors.UnitWarning, match=r"line 2, joints.slide.lead: a lead of 20 m .*: 20 mm\?"):
        given = read("joints:\n  slide: {stiffness: 50 N/mm, lead: 20}\n")["slide"]
    assert given.ratio == pytest.approx(2 * math.pi / 20)
    for lead, factor in (("20 mm", 100 * math.pi), ("0.02", 100 * math.pi), ("1.9", 2 * math.pi / 1.9)):
        drive = read(f"joints:\n  slide: {{stiffness: 50 N/mm, lead: {lead}}}\n")["slide"]  # warnings are errors here
        assert drive.ratio == pytest.approx(factor)
    assert read("joints:\n  slide: {stiffness: 50 N/mm, lead: 3 m}\n")["slide"].lead == 3.0
