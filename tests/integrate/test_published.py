"""Published benchmarks, simulated from their files, and the free mechanisms of the bank, against references."""

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipj

import jounce as jn
from jounce import drivers, forces
from tests.oracles.mp_andrews import NAMES, PUBLISHED_ANGLES, PUBLISHED_RATES
from tests.problems import dynamics
from tests.problems.dynamics import GRAVITY, dynamic_reference
from tests.problems.mechanisms import REFERENCES, example

PAGE = Path(__file__).parents[2] / "docs" / "andrews.md"


def simulated(mechanism, instants, order=3, step=0.05, **options):
    """Return a simulation and the indices of the instants; others between them, so that no turn is lost."""
    fine = np.arange(0.0, instants[-1], step)
    time = np.unique(np.concatenate([[0.0], fine, instants]))
    time = time[np.append(np.diff(time) > 1e-9, True)]
    motion = jn.simulate(mechanism, time, order, **options)
    return motion, np.searchsorted(time, instants - 1e-8)


def check(found, expected, tolerance):
    """Compare derivatives, (time, derivative), each by its largest value over the instants."""
    size = np.max(np.abs(expected), axis=0)
    errors = np.max(np.abs(found - expected), axis=0) / np.where(size > 0, size, 1.0)
    assert (errors < tolerance).all(), errors


def energy_kept(motion, tolerance, scale):
    """Check the energy of a conservative motion, by a typical kinetic energy, J."""
    assert np.max(np.abs(motion.energy - motion.energy[0])) < tolerance * scale


@pytest.mark.slow
def test_simple_pendulum_is_the_elliptic_function():
    """IFToMM A01, released from the horizontal: angle and velocity in closed form over 10 s, about five periods."""
    time = np.linspace(0, 10, 101)
    motion = jn.simulate(jn.load(example("simple_pendulum")), time, 2)
    frequency = math.sqrt(GRAVITY)
    _, cn, dn, _ = ellipj(frequency * time, 0.5)
    from_vertical = 2 * np.arcsin(np.sqrt(0.5) * cn / dn)  # sin of half the angle is k cd(w t)
    assert np.max(np.abs(motion.outputs["angle"][:, 0] - (1.5 * np.pi - from_vertical))) < 1e-11
    acceleration = motion.outputs["angle"][:, 2]
    assert np.max(np.abs(acceleration - GRAVITY * np.sin(from_vertical))) < 1e-10
    energy_kept(motion, 1e-12, GRAVITY)
    assert np.max(motion.drift) < 1e-13


def test_page_of_andrews_prints_the_references():
    """Every row of the tables of angles and multipliers is the rounded reference."""
    stored = json.loads((REFERENCES / "dynamics" / "andrews.json").read_text(encoding="utf-8"))["instants"]
    known = {
        float(x)
        for instant in stored
        for kind in instant.values()
        if isinstance(kind, dict)
        for row in kind.values()
        for x in row
    }
    known = np.array(sorted(known))
    text = PAGE.read_text(encoding="utf-8").partition("## At t = 0\n")[2].partition("| | test set |")[0]
    rows = re.findall(r"^\| (?:\$|`).*\|$", text, re.MULTILINE)
    assert len(rows) == 3 * 7 + 2 * 6 + 20
    for row in rows:
        for number in re.findall(r" (-?[\d.]+(?:e[+-]?\d+)?) \|", row):
            value = float(number)
            assert np.min(np.abs(known - value)) <= 1e-14 * abs(value), row


def polynomial(derivatives, instant):
    """Return the law of which these are the derivatives at an instant."""
    terms = [f"({float(d)!r})*(t - {instant!r})**{k}/{math.factorial(k)}" for k, d in enumerate(derivatives) if k]
    return " + ".join([f"({float(derivatives[0])!r})", *terms])


@pytest.mark.slow
def test_andrews_prescribed_needs_no_torque_and_has_the_reactions_of_the_reference():
    """All masses, forces and joints of the file at once: on the true motion, the crank's driver has nothing to do."""
    instants, tables = dynamic_reference("andrews")
    mechanism = jn.load(example("andrews"))
    last = {name: tables["angles"][name][-1] for name in NAMES}
    beta, theta, gamma, phi, delta, omega, epsilon = (row[0] for row in last.values())
    turned = [beta, beta + theta, gamma, phi + delta, delta, omega + epsilon, epsilon]
    bodies = zip(mechanism.bodies.items(), turned, strict=True)
    instant = float(instants[-1])
    law = drivers.CoordinateDriver(("ground", "K1"), "angle", polynomial(last["beta"], instant))
    mechanism = dataclasses.replace(
        mechanism,
        bodies={name: dataclasses.replace(body, angle=angle) for (name, body), angle in bodies},
        drivers={"crank driver": law},
        initial={},
    )
    motion = jn.solve(mechanism, [instant], order=6)
    for name in NAMES:
        np.testing.assert_allclose(motion.outputs[name][0], last[name][:7], rtol=1e-12)
    for pin in (name.removesuffix("_x") for name in tables["reactions"] if name.endswith("_x")):
        expected = np.stack([tables["reactions"][f"{pin}_{axis}"][-1, :5] for axis in "xy"], axis=-1)
        found = jn.joint_reaction(motion, pin).force.to_numpy()[0, :5]
        np.testing.assert_allclose(found, expected, rtol=1e-11)
    size = np.abs(np.max(np.abs(tables["multipliers"]["lambda1"]), axis=0)[:5]) * 0.007  # N m, at the crank's radius
    assert (np.abs(jn.driver_force(motion, "crank driver").to_numpy()[0, :5]) < 1e-11 * size).all()


@pytest.mark.slow
def test_andrews():
    """State, jerk and multipliers at 0.01, 0.02 and 0.03 s; the state of the test set to the digits that it has."""
    instants, tables = dynamic_reference("andrews")
    mechanism = jn.load(example("andrews"))
    motion, index = simulated(mechanism, instants, order=4, step=0.0005)
    for name in NAMES:
        found, expected = motion.outputs[name][index], tables["angles"][name][:, :5]
        check(found[1:, :1], expected[1:, :1], 1e-10)
        check(found[1:, 1:2], expected[1:, 1:2], 1e-9)
        check(found[1:, 2:], expected[1:, 2:], 2e-8)
    last = index[-1]
    for name, angle, rate in zip(NAMES, PUBLISHED_ANGLES, PUBLISHED_RATES, strict=True):
        # it has lost 1.5e-10 of its energy, and satisfies the constraints on its rates to 1e-9 m/s
        np.testing.assert_allclose(motion.outputs[name][last, 0], float(angle), rtol=3e-10)
        np.testing.assert_allclose(motion.outputs[name][last, 1], float(rate), rtol=6e-8)
    work = 0.033 * (motion.outputs["beta"][:, 0] - motion.outputs["beta"][0, 0])
    balance = motion.energy - work
    assert np.max(np.abs(balance - balance[0])) < 1e-11 * np.max(motion.energy)
    assert np.max(motion.drift) < 1e-13


@pytest.mark.slow
def test_double_pendulum_from_horizontal_rest():
    """Default settings, in absolute coordinates. The motion is chaotic: in 10 s it makes 1e7 times more of an error."""
    instants, tables = dynamic_reference("double_pendulum")
    motion, index = simulated(jn.load(example("double_pendulum")), instants)
    shift = np.array([np.pi / 2, 0, 0, 0])
    for name, early, late in (("a", 1e-11, 1e-7), ("b", 1e-11, 1e-7)):
        found = motion.outputs[name][index] + shift
        expected = tables["angles"][name][:, :4]
        check(found[:2], expected[:2], early)
        check(found, expected, late)
    energy_kept(motion, 1e-12, 2 * GRAVITY)
    assert np.max(motion.drift) < 1e-13


@pytest.mark.slow
def test_double_four_bar_up_to_its_singular_position():
    """Until the uprights lie level for the first time, the peer's model and the one-angle pendulum are the same."""
    one = dynamics.simple_pendulum(math.pi / 2, -1.0, length=6 / 7)  # 3 a'' = -3.5 g cos a
    time = np.linspace(0, 0.6, 13)
    expected = jn.simulate(one, time, 3).outputs["angle"]
    motion = jn.simulate(jn.load(example("double_four_bar")), time, 3)
    check(motion.outputs["angle"], expected, 1e-10)
    energy_kept(motion, 1e-12, 3.5 * GRAVITY)


@pytest.mark.slow
def test_double_four_bar():
    """Ten seconds, through the singular position and back a dozen times; each time rounding is made larger there."""
    instants, tables = dynamic_reference("double_four_bar")
    motion, index = simulated(jn.load(example("double_four_bar")), instants, order=2)
    check(motion.outputs["angle"][index], tables["angles"]["a"][:, :3], 1e-7)
    for k, axis in enumerate("xy"):
        check(motion.outputs["tip"][index][..., k], tables["tip"][axis][:, :3], 1e-6)
    energy_kept(motion, 1e-8, 3.5 * GRAVITY)
    assert np.max(motion.drift) < 1e-13


def test_derivatives_next_to_a_singular_position_of_a_simulation():
    motion = jn.simulate(jn.load(example("double_four_bar")), [0.0, 1.0], 4)
    level = brentq(lambda t: motion.at([t], 0).outputs["angle"][0, 0], 0.5, 1.0, xtol=1e-15)  # the uprights lie level
    offsets = np.array([0.0, *(sign * 10.0**-k for k in (12, 10, 8, 7, 6, 5, 4, 3) for sign in (-1, 1))])
    near = motion.at(level + offsets)
    angle, speed, *derivatives = near.outputs["angle"].T
    strength = 3.5 * 9.81 / 3.0  # 3 m l^2 times the acceleration is the torque -3.5 m g l cos(angle)
    acceleration = -strength * np.cos(angle)
    jounce = strength * (np.cos(angle) * speed**2 + np.sin(angle) * acceleration)
    assert (near.status == 0).all()
    np.testing.assert_allclose(derivatives[0], acceleration, atol=1e-8)
    np.testing.assert_allclose(derivatives[1], strength * np.sin(angle) * speed, atol=1e-5)
    np.testing.assert_allclose(derivatives[2], jounce, atol=1e-2)


def test_figures_of_the_peer_for_the_double_four_bar_are_of_ten_seconds():
    """The peer's table (second order, step 1.25e-4 s) heads its figures with the time: t = 10 s, not 4 s."""
    figures = {"x": (0.3284573768, 1.423050003), "y": (0.9445187937, -0.4948670827)}
    instants, tables = dynamic_reference("double_four_bar")
    assert instants[-1] == 10.0
    for name, (place, velocity) in figures.items():
        # the table's last halving of the step moved the figures by 2e-6 and 5e-6, a third of which is still to come
        assert abs(tables["tip"][name][-1, 0] - place) < 1e-6
        assert abs(tables["tip"][name][-1, 1] - velocity) < 2e-6


@pytest.mark.slow
def test_flyball_governor():
    """IFToMM A05: stiff, with a damper that settles in a tenth of a millisecond; to the end of its file."""
    instants, tables = dynamic_reference("flyball_governor")
    mechanism = jn.load(example("flyball_governor"))
    motion = jn.simulate(mechanism, order=2)
    assert motion.time[-1] == 0.1
    here = [np.argmin(np.abs(motion.time - instants[0]))]
    for output, name in {"turn": "shaft", "fall": "right"}.items():
        check(motion.outputs[output][here], tables["coordinates"][name][:1, :3], 1e-9)
    check(motion.outputs["place"][here, :, 2], tables["coordinates"]["s"][:1, :3], 1e-9)


@pytest.mark.slow
def test_spatial_slider_crank():
    """The spatial rigid slider-crank of IFToMM in free motion, and with a spring and a damper on its slider."""
    x, origin = [1, 0, 0], [0, 0, 0]
    spring = forces.SlideSpring(("ground", "slider"), origin, origin, x, "stiffness", 0.2, "damping")
    mechanism = jn.load(example("spatial_slider_crank_free"))
    mechanism = dataclasses.replace(
        mechanism, forces={"spring": spring}, parameters={**mechanism.parameters, "stiffness": 0.0, "damping": 0.0}
    )  # one for both, as springs of other values compile nothing anew
    for reference, stiffness, damping in (("slider_crank_spring", 200.0, 5.0), ("spatial_slider_crank", 0.0, 0.0)):
        instants, tables = dynamic_reference(reference)
        chosen = mechanism.with_parameters(stiffness=stiffness, damping=damping)
        motion, index = simulated(chosen, instants, tolerance=1e-17)
        check(motion.outputs["angle"][index], tables["coordinates"]["angle"][:, :4], 1e-9)
        check(motion.outputs["slide"][index][..., 0], tables["coordinates"]["slide"][:, :4], 1e-9)
        for k, axis in enumerate("xyz"):
            check(motion.outputs["center"][index][..., k], tables["rod"][axis][:, :4], 1e-9)
    # 3e-14 of the largest kinetic energy was measured over 96 turns; at the tolerance 1e-15 it was 5e-13
    energy_kept(motion, 1e-13, 0.468)


@pytest.mark.slow
def test_spatial_double_pendulum():
    instants, tables = dynamic_reference("spatial_double_pendulum")
    motion, index = simulated(dynamics.spatial_double_pendulum(), instants)
    for name in ("first", "second"):
        check(motion.outputs[name][index], tables["angles"][name][:, :4], 1e-11)
    for k, axis in enumerate("xyz"):
        check(motion.outputs["tip"][index][..., k], tables["tip"][axis][:, :4], 1e-11)
    energy_kept(motion, 1e-12, GRAVITY)


@pytest.mark.slow
def test_free_four_bar():
    """Angles and the force in a pin, which the constrained equations give with the accelerations."""
    instants, tables = dynamic_reference("free_four_bar")
    motion, index = simulated(dynamics.free_four_bar(), instants, order=4)
    for name in ("crank", "coupler", "rocker"):
        check(motion.outputs[name][index], tables["angles"][name][:, :5], 1e-9)
    force = jn.joint_reaction(motion, "C").force.to_numpy()[index]
    for k, axis in enumerate("xy"):
        check(force[..., :3, k], tables["multipliers"][axis][:, :3], 1e-8)
    energy_kept(motion, 1e-12, GRAVITY)


@pytest.mark.slow
def test_rolling_disc_swings_on_its_spring():
    time = np.linspace(0, 20, 41)
    motion = jn.simulate(dynamics.rolling_disc(), time, 4)
    check(motion.outputs["place"][..., 0], dynamics.rolling_motion(time, 4), 1e-11)
    check(motion.outputs["angle"][:, 1:], dynamics.rolling_motion(time, 4)[:, 1:] / 0.3, 1e-11)
    energy_kept(motion, 1e-12, 5.0)


@pytest.mark.slow
def test_gear_pair_gains_speed_evenly():
    time = np.linspace(0, 1, 5)
    motion = jn.simulate(dynamics.gear_pair(), time, 3)
    check(motion.outputs["pinion"], dynamics.gear_motion(time, 3), 1e-13)
    check(motion.outputs["wheel"], -0.4 * dynamics.gear_motion(time, 3), 1e-13)


@pytest.mark.slow
def test_stewart_platform_forces_with_rates():
    """Six actuator forces, yanks and second rates at four instants; higher ones at the pins of Andrews' mechanism."""
    instants, tables = dynamic_reference("stewart")
    motion = jn.solve(jn.load(example("stewart_forces")), order=4)
    index = [np.argmin(np.abs(motion.time - t)) for t in instants]
    np.testing.assert_allclose(motion.time[index], instants, rtol=1e-15)
    for k in range(1, 7):
        found = jn.driver_force(motion, f"leg{k}").to_numpy()[index, :3]
        check(found, tables["forces"][f"leg{k}"][:, :3], 1e-12)
    for k, axis in enumerate("xyz"):
        check(motion.outputs["center"][index][..., k], tables["center"][axis][:, :5], 1e-12)
