"""Gears: what teeth exert on bearings and planet pins, how trains turn, and what is told of gears that do not mesh."""

import dataclasses
import math

import mpmath
import numpy as np
import pytest

import jounce as jn
from jounce import drivers, forces, planar, spatial
from jounce.mechanism import build
from jounce.mechanism.transmissions.axis_angles import AttitudeHistory, lost_count
from jounce.reporting.facts.mechanism.mechanism_facts import inspected
from jounce.reporting.text.summaries import start_summary

ZERO, X, Y, Z = [0.0, 0.0], [1, 0, 0], [0, 1, 0], [0, 0, 1]
ORDER = 6  # of motions: rates of forces to order 4
SLOPE = math.tan(math.radians(20))


def rates(function, t, count=5):
    with mpmath.workdps(40):
        return np.array([float(mpmath.diff(function, mpmath.mpf(t), k)) for k in range(count)])


def planetary(load):
    """Sun, planet and a ring that is held; the load is on the carrier."""
    return jn.Mechanism(
        space="planar",
        bodies={"sun": jn.Body(ZERO), "carrier": jn.Body(ZERO), "planet": jn.Body([0.042, 0])},
        joints={
            "S": planar.Revolute(("ground", "sun"), ZERO, ZERO),
            "C": planar.Revolute(("ground", "carrier"), ZERO, ZERO),
            "P": planar.Revolute(("carrier", "planet"), [0.042, 0], ZERO),
            "sp": planar.Gear(("sun", "planet"), None, None, ZERO, ZERO, 0.024, 0.018, math.radians(20)),
            "pr": planar.Gear(("planet", "ground"), None, None, ZERO, ZERO, 0.018, -0.060, math.radians(20)),
        },
        drivers={"m": drivers.CoordinateDriver(("ground", "sun"), "angle", "20*t + 3*sin(6*t)")},
        forces={"load": forces.Torque(("ground", "carrier"), load)},
    )


@pytest.mark.slow
def test_a_planetary_gear_loads_its_pins_and_bearings_as_its_free_bodies_say():
    """Willis: the carrier turns 24/84 as fast as the sun. Half the pin force at each mesh, of radii 24 and 18 mm."""
    time = [0.1, 0.9]
    motion = jn.solve(planetary("-7 - 2*sin(5*t)"), time, ORDER)

    def sun(t):
        return 20 * t + 3 * mpmath.sin(6 * t)

    def carrier(t):
        return sun(t) * 24 / 84

    def tooth(t):  # along the common tangent
        return (7 + 2 * mpmath.sin(5 * t)) / (2 * mpmath.mpf("0.042"))

    # what the bearing does to the sun: the planet pushes it back along the tangent, and inward
    bearing = [
        lambda t: -tooth(t) * mpmath.sin(carrier(t)) + tooth(t) * mpmath.tan(mpmath.pi / 9) * mpmath.cos(carrier(t)),
        lambda t: tooth(t) * mpmath.cos(carrier(t)) + tooth(t) * mpmath.tan(mpmath.pi / 9) * mpmath.sin(carrier(t)),
    ]
    pin = [lambda t: 2 * tooth(t) * mpmath.sin(carrier(t)), lambda t: -2 * tooth(t) * mpmath.cos(carrier(t))]
    for k, t in enumerate(time):
        np.testing.assert_allclose(motion.angle("carrier")[k, :5], rates(carrier, t), rtol=1e-12)
        np.testing.assert_allclose(
            motion.angle("planet")[k, 1:5], rates(lambda t: sun(t) * 24 / 84 * (1 - 60 / 18), t)[1:], rtol=1e-12
        )
        found = jn.driver_force(motion, "m").values[k]
        np.testing.assert_allclose(found, rates(lambda t: 2 * tooth(t) * mpmath.mpf("0.012"), t), rtol=1e-11)
        for name, body, exact in (("S", "sun", bearing), ("P", "planet", pin)):
            force = jn.joint_reaction(motion, name, body).force.values[k]
            size = np.abs(force).max(axis=1, keepdims=True)
            expected = np.stack([rates(part, t) for part in exact], axis=1)
            assert (np.abs(force - expected) <= 1e-10 * size).all(), (name, force, expected)


@pytest.mark.slow
@pytest.mark.parametrize("turned", [None, 1.3], ids=["as guessed", "given"])
def test_gears_on_welded_parts_turn_and_load_their_pins_as_on_one_part(turned):
    """The planet on a plate that is welded to the carrier, the sun on a shaft: Willis, and the load on the pin."""
    train = planetary(-7.0)
    c, s = math.cos(1.3), math.sin(1.3)
    plate, pin = [0.02 - 0.01 * c, -0.01 * s], [0.01 + 0.022 * c, -0.022 * s]  # the weld is at [0.01, 0] of the plate
    train = dataclasses.replace(
        train,
        bodies={**train.rigid_bodies, "plate": jn.Body(plate, 1.3), "shaft": jn.Body(ZERO, -0.4)},
        joints={
            **train.joints,
            "weld": planar.Fixed(("carrier", "plate"), [0.02, 0], [0.01, 0], turned),
            "P": planar.Revolute(("plate", "planet"), pin, ZERO),
            "key": planar.Fixed(("sun", "shaft"), ZERO, ZERO),
            "S": planar.Revolute(("ground", "shaft"), ZERO, ZERO),
        },
    )
    time = np.array([0.0, 0.1, 0.9])
    motion = jn.solve(train, time, 2)
    carrier = (20 * time + 3 * np.sin(6 * time)) * 24 / 84
    np.testing.assert_allclose(motion.angle("carrier").values[:, 0], carrier, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(motion.angle("planet").values[:, 0], -carrier * 42 / 18, rtol=1e-12, atol=1e-13)
    force = jn.joint_reaction(motion, "P", "planet").force.values[:, 0]
    along = np.stack([np.sin(carrier), -np.cos(carrier)], axis=-1)  # the load holds the carrier back
    np.testing.assert_allclose(force, 7 / 0.042 * along, rtol=1e-11, atol=1e-9)


@pytest.mark.slow
def test_where_the_load_passes_zero_rates_of_what_the_teeth_press_apart_are_not_reported():
    motion = jn.solve(planetary("-7 + 20*t"), [0.0, 0.35, 0.7], ORDER)
    reaction = jn.joint_reaction(motion, "S", "sun").force
    radial = {}
    for k in (0, 2):
        angle = float(motion.angle("carrier")[k, 0])
        x, y = reaction.values[k, 0]
        radial[k] = x * math.cos(angle) + y * math.sin(angle)
    # the separating force is inward on the sun on either flank: its bearing presses outward
    np.testing.assert_allclose([radial[0], radial[2]], 7 / 0.084 * SLOPE * np.ones(2), rtol=1e-12)
    assert np.abs(reaction.values[1, 0]).max() < 1e-9
    assert np.isnan(reaction.values[1, 1:]).all()
    assert np.isfinite(reaction.values[[0, 2]]).all()
    assert "changes flanks at t = 0.35 s" in reaction.attrs["comment"]
    assert np.isfinite(jn.driver_force(motion, "m").values).all()
    assert np.isnan(jn.joint_reaction(motion, "sp").force.values[1, 1:]).all()


@pytest.mark.slow
def test_a_load_that_touches_zero_has_the_rates_of_its_flank():
    """The square of a sine never reverses: the absolute value is the load itself."""
    motion = jn.solve(planetary("-7*(t - 0.35)**2"), [0.35], ORDER)
    found = jn.joint_reaction(motion, "S", "sun").force.values[0]
    assert np.isfinite(found).all()
    angle = float(motion.angle("carrier")[0, 0])
    assert found[2] @ [math.cos(angle), math.sin(angle)] == pytest.approx(14 / 0.084 * SLOPE, rel=1e-10)


def rack(load, height=0.05):
    return jn.Mechanism(
        space="planar",
        bodies={"pinion": jn.Body(ZERO), "rack": jn.Body([0, 0.05])},
        joints={
            "A": planar.Revolute(("ground", "pinion"), ZERO, ZERO),
            "guide": planar.Prismatic(("ground", "rack"), [0, height], ZERO, [1, 0], [1, 0]),
            "mesh": planar.Rolling(("rack", "pinion"), ZERO, ZERO, [1, 0], 0.05, None, math.radians(20)),
        },
        drivers={"motor": drivers.CoordinateDriver(("ground", "pinion"), "angle", "0.1*t")},
        forces={"load": forces.PointForce("rack", ZERO, [load, "0"])},
    )


@pytest.mark.parametrize("load", [100.0, pytest.param(-100.0, marks=pytest.mark.slow)])
def test_a_rack_presses_its_pinion_away_whichever_way_it_is_loaded(load):
    motion = jn.solve(rack(repr(load)), [0.0, 1.0], 3)
    bearing = jn.joint_reaction(motion, "A", "ground").force.values[:, 0]
    np.testing.assert_allclose(bearing, [[load, -100 * SLOPE]] * 2, rtol=1e-12)
    np.testing.assert_allclose(jn.joint_reaction(motion, "guide", "ground").force.values[:, 0, 1], 100 * SLOPE)
    np.testing.assert_allclose(jn.driver_force(motion, "motor").values[:, 0], 0.05 * load, rtol=1e-12)


@pytest.mark.slow
def test_a_pinion_off_the_pitch_line_of_its_rack_is_reported_with_how_far():
    with pytest.raises(jn.errors.MechanismError, match=r"-0\.052 m to the left of the line.*-0\.05 m"):
        jn.driver_force(jn.solve(rack("100", height=0.052), [0.0], 3), "motor")


def wolfrom():
    """A stepped planet between a sun, a ring that is held and a ring that turns: 42 turns of the sun for one."""
    return jn.Mechanism(
        space="planar",
        bodies={name: jn.Body(ZERO) for name in ("sun", "carrier", "ring")} | {"planet": jn.Body([0.03, 0])},
        joints={
            "S": planar.Revolute(("ground", "sun"), ZERO, ZERO),
            "C": planar.Revolute(("sun", "carrier"), ZERO, ZERO),
            "R": planar.Revolute(("ground", "ring"), ZERO, ZERO),
            "P": planar.Revolute(("carrier", "planet"), [0.03, 0], ZERO),
            "sp": planar.Gear(("sun", "planet"), None, None, ZERO, ZERO, 0.012, 0.018),
            "held": planar.Gear(("ground", "planet"), None, None, ZERO, ZERO, -0.048, 0.018),
            "out": planar.Gear(("ring", "planet"), None, None, ZERO, ZERO, -0.046, 0.016),
        },
        drivers={"m": drivers.CoordinateDriver(("ground", "sun"), "angle", "300*t + 5*sin(40*t)")},
    )


@pytest.mark.slow
def test_a_wolfrom_train_counts_its_turns():
    motion = jn.solve(wolfrom(), [0.0, 0.9, 2.0], 4)
    ratio = 12 / (12 + 48) * (1 - 48 * 16 / (18 * 46))
    law = motion.angle("sun").values
    np.testing.assert_allclose(motion.angle("ring").values, ratio * law, atol=1e-12 * np.abs(law).max())


@pytest.mark.slow
def test_gradients_by_pitch_radii_count_all_turns():
    import jax

    def ring(step):
        gears = wolfrom()
        out = dataclasses.replace(gears.joints["out"], radius_i=-0.046 + step, radius_j=0.016 - step)
        moved = dataclasses.replace(
            gears, joints={**gears.joints, "out": out}, outputs={"ring": jn.outputs.AngleOutput("ring")}
        )
        return jn.solve(moved, [0.0, 2.0], 1).outputs["ring"][1, 0]

    slope = 12 / 60 * mpmath.diff(lambda x: 1 - 48 * (0.016 - x) / (18 * (0.046 - x)), 0)
    assert float(jax.grad(ring)(0.0)) == pytest.approx(float(slope) * (600 + 5 * math.sin(80)), rel=1e-9)


def test_centers_that_are_not_at_the_sum_of_radii_are_reported_with_the_gap():
    gears = planetary("1")
    wide = dataclasses.replace(gears.joints["sp"], radius_j=0.019)
    for change, words in (
        ({"sp": wide}, r"0.042 m apart on 'carrier'.*0.043 m.*-0.001 m"),
        ({"pr": dataclasses.replace(gears.joints["pr"], radius_j=0.06)}, "0.042 m apart.*together are 0.078"),
        ({"sp": dataclasses.replace(gears.joints["sp"], radius_i=-0.1, radius_j=-0.1)}, "at most one of two gears"),
        ({"sp": dataclasses.replace(gears.joints["sp"], radius_i=-0.018)}, "a ring must be larger"),
        ({"P": planar.Revolute(("carrier", "planet"), [0.042, 0], [1e-3, 0])}, "no body carries both gears"),
        ({"sp": dataclasses.replace(gears.joints["sp"], pressure_angle=20.0)}, "from 0 to 45 deg"),
        ({"sp": dataclasses.replace(gears.joints["sp"], radius_i=0.0)}, "must not be zero"),
    ):
        with pytest.raises(jn.errors.MechanismError, match=words):
            jn.solve(dataclasses.replace(gears, joints={**gears.joints, **change}), [0.0], 1)


@pytest.mark.parametrize(
    "values, words",
    [
        ({"ratio": 2.0}, "the third body is the frame"),
        ({}, "either a ratio, or points and radii"),
        ({"ratio": 2.0, "radius_i": 1.0}, "either a ratio, or points and radii"),
        ({"point_i": ZERO, "radius_i": 1.0, "radius_j": 1.0}, "two points"),
    ],
)
def test_a_gear_has_one_of_two_forms(values, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        planar.Gear(("a", "b"), **values)


def worm(ratio=-1 / 40, **joints):
    hinges = {
        "a": spatial.Revolute(("ground", "worm"), [0, 0, 0], [0, 0, 0], X, X),
        "b": spatial.Revolute(("ground", "wheel"), [0, 0, 0.1], [0, 0, 0], Y, Y),
    }
    return jn.Mechanism(
        space="spatial",
        bodies={
            "worm": jn.Body([0, 0, 0], mass=1.0, inertia=[1e-4] * 3),
            "wheel": jn.Body([0, 0, 0.1], mass=5.0, inertia=[0.02] * 3),
        },
        joints={**hinges, "mesh": spatial.Gear(("worm", "wheel", "ground"), X, Y, ratio), **joints},
        drivers={"motor": drivers.RotationDriver(("ground", "worm"), X, "100*t + 300*t**2")},
        forces={"load": forces.SpatialTorque(("ground", "wheel"), Y, "-10 - 0.5*v")},
        outputs={"wheel": jn.outputs.RelativeAngleOutput(("ground", "wheel"), Y)},
    )


@pytest.mark.slow
def test_a_worm_needs_its_axes_and_its_ratio_alone():
    """The motor: its own inertia, and a fortieth of what the wheel takes."""
    time = np.array([0.0, 0.4, 1.0])
    motion = jn.solve(worm(), time, ORDER)
    law = np.stack([100 * time + 300 * time**2, 100 + 600 * time, 600 + 0 * time], axis=1)
    np.testing.assert_allclose(motion.outputs["wheel"][:, :3], -law / 40, rtol=1e-12, atol=1e-12)
    torque = jn.driver_force(motion, "motor").values
    wheel = 0.02 * 600 / 1600 + (10 - 0.5 * law[:, 1] / 40) / -40
    np.testing.assert_allclose(torque[:, 0], 1e-4 * 600 + wheel, rtol=1e-10)
    np.testing.assert_allclose(torque[:, 1], 0.5 * 600 / 1600 + 0 * time, rtol=1e-10)
    assert np.abs(torque[:, 2:]).max() < 1e-9


@pytest.mark.slow
def test_what_carries_shafts_is_reported_where_it_does_not():
    for mechanism, words in (
        (
            worm(mesh=spatial.Gear(("worm", "wheel", "ground"), Z, Y, 0.5)),
            "the first gear does not turn about this axis",
        ),
        (worm(mesh=spatial.Gear(("worm", "wheel", "ground"), X, [0, 1, 0.1], 0.5)), "the second gear does not turn"),
        (worm(math.sqrt(2)), "whole numbers up to 1000"),
    ):
        with pytest.raises(jn.errors.MechanismError, match=words):
            jn.solve(mechanism, [0.0], 1)


@pytest.mark.slow
def test_shafts_on_parts_that_are_welded_to_their_frame_turn_in_the_ratio():
    """A wheel on a cap that is welded to a housing that turns, and a worm whose shaft is a part of its own."""
    origin, cap = [0, 0, 0], [0.3, -0.5, 0.2]
    bodies = dict.fromkeys(("housing", "cap", "worm", "shaft", "wheel"), jn.Body(origin))
    worms = jn.Mechanism(
        space="spatial",
        bodies={**bodies, "cap": jn.Body(cap)},
        joints={
            "H": spatial.Revolute(("ground", "housing"), origin, origin, Y, Y),
            "weld": spatial.Fixed(("housing", "cap"), cap, origin, [1, 1, 0], [1, 1, 0], Z, Z),
            "A": spatial.Revolute(("housing", "shaft"), origin, origin, X, X),
            "key": spatial.Fixed(("shaft", "worm"), origin, origin, [0, 1, 2], [0, 1, 2], X, X),
            "B": spatial.Revolute(("cap", "wheel"), [-0.3, 0.5, -0.2], origin, Y, Y),
            "mesh": spatial.Gear(("worm", "wheel", "housing"), X, Y, 3 / 40),
        },
        drivers={
            "turn": drivers.RotationDriver(("ground", "housing"), Y, "2*t"),
            "motor": drivers.RotationDriver(("housing", "worm"), X, "90*t + sin(t)"),
        },
        outputs={"wheel": jn.outputs.RelativeAngleOutput(("ground", "wheel"), Y)},
    )
    time = np.array([0.0, 0.4, 2.0])
    found = jn.solve(worms, time, 1).outputs["wheel"]
    np.testing.assert_allclose(found[:, 0], 2 * time + (90 * time + np.sin(time)) * 3 / 40, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found[:, 1], 2 + (90 + np.cos(time)) * 3 / 40, rtol=1e-12)


def differential():
    """Two wheels of a car, whose planet is on a cage that turns, driven through a crown pair."""
    origin = [0, 0, 0]
    places = {"cage": origin, "pin": [0.06, 0, 0], "left": [0, 0.04, 0], "right": [0, -0.04, 0], "shaft": [-0.2, 0, 0]}
    hinges = {
        name: spatial.Revolute(("ground", name), places[name], origin, axis, axis)
        for name, axis in (("cage", Y), ("left", Y), ("right", Y), ("shaft", X))
    }
    return jn.Mechanism(
        space="spatial",
        bodies={name: jn.Body(place) for name, place in places.items()},
        joints={
            **{f"of_{name}": hinge for name, hinge in hinges.items()},
            "of_pin": spatial.Revolute(("cage", "pin"), [0.06, 0, 0], origin, X, X),
            "crown": spatial.Gear(("shaft", "cage", "ground"), X, Y, 10 / 37),
            "first": spatial.Gear(("left", "pin", "cage"), Y, X, 1.5),
            "second": spatial.Gear(("right", "pin", "cage"), Y, X, -1.5),
        },
        drivers={
            "engine": drivers.RotationDriver(("ground", "shaft"), X, "74*t + 20*t**2"),
            "bend": drivers.RotationDriver(("right", "left"), Y, "3*t**3 - 1.5*t**4"),
        },
        forces={name: forces.SpatialTorque(("ground", name), Y, -180.0) for name in ("left", "right")},
        outputs={
            "left": jn.outputs.RelativeAngleOutput(("ground", "left"), Y),
            "right": jn.outputs.RelativeAngleOutput(("ground", "right"), Y),
            "planet": jn.outputs.RelativeAngleOutput(("cage", "pin"), X),
        },
    )


@pytest.mark.slow
def test_a_bevel_differential_turns_as_willis_says_over_many_turns():
    """Both wheels together turn as far as twice the cage, and share its torque."""
    motion = jn.solve(differential(), [0.0, 0.45, 1.0], 4)
    time = motion.time
    cage = (74 * time + 20 * time**2) / 3.7
    bend = 3 * time**3 - 1.5 * time**4
    np.testing.assert_allclose(motion.outputs["left"][:, 0], cage + bend / 2, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(motion.outputs["right"][:, 0], cage - bend / 2, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(motion.outputs["planet"][:, 0], 1.5 * bend / 2, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(jn.driver_force(motion, "engine").values[:, 0], 360 / 3.7, rtol=1e-12)


@pytest.mark.slow
def test_shafts_that_lose_count_are_found_along_their_attitudes():
    """Two pairs that agree in every instant up to whole turns: one follows, one slips by a tooth on the way."""
    turns = np.linspace(0.0, 2.0, 81)  # of the worm
    for slipped in (0.0, 1.0):
        wheel = -2 * np.pi * (turns + slipped * (turns > 1.02)) / 40
        quaternion = np.zeros((4, 3, len(turns)))
        quaternion[0, 0] = 1.0
        quaternion[0, 1], quaternion[1, 1] = np.cos(np.pi * turns), np.sin(np.pi * turns)
        quaternion[0, 2], quaternion[2, 2] = np.cos(wheel / 2), np.sin(wheel / 2)
        history = AttitudeHistory(quaternion, turns)
        found = lost_count(build(worm()).system.groups, history)
        if slipped:
            assert found is not None
            assert found[1:] == (0, pytest.approx(1.025))
        else:
            assert found is None


def test_the_ratios_of_a_train_are_those_of_willis():
    """Sun of 24 teeth, ring of 60: the ring by the sun with the carrier held, and by the carrier with the sun held."""
    facts = inspected(jn.load("examples/epicyclic.yaml"))
    found = {(x["body"], x["driver"]): (x["ratio"], x["fraction"]) for x in facts["trains"]}
    for body, sun, carrier in (("ring", -24 / 60, 84 / 60), ("planet", -24 / 18, 42 / 18)):
        assert found[body, "sun_drive"][0] == pytest.approx(sun, rel=1e-12)
        assert found[body, "carrier_drive"][0] == pytest.approx(carrier, rel=1e-12)
    assert found["ring", "carrier_drive"][1] == "7/5"
    assert "ring -0.4 = -2/5" in start_summary(facts)
