"""Peaks between the instants of a motion."""

import dataclasses
import json

import numpy as np
import pytest
import xarray

import jounce as jn
from jounce.reporting.peaks import Peak, derivative_name, peaks, table_peaks
from jounce.reporting.text.tables import peaks_table

CRANK = jn.Mechanism(
    space="planar",
    parameters={"w": 3.0},
    bodies={"a": jn.Body([0, 0], mass=1.0, inertia=0.5)},
    joints={"O": jn.planar.Revolute(("ground", "a"), [0, 0], [0, 0])},
    drivers={"turn": jn.drivers.CoordinateDriver(("ground", "a"), "angle", motion="sin(w*t) + 0.25*sin(2*w*t)")},
    outputs={"angle": jn.outputs.AngleOutput("a")},
)
FINE = np.linspace(0.0, 4.0, 400_001)


def curve(order):
    """Derivatives of the law in closed form, on a grid so fine that its maximum is exact to 1e-9."""
    shift = order * np.pi / 2
    return 3.0**order * np.sin(3 * FINE + shift) + 0.25 * 6.0**order * np.sin(6 * FINE + shift)


@pytest.mark.parametrize("count", [2, 4, 21, 201])
def test_peaks_do_not_depend_on_the_instants(count):
    motion = jn.solve(CRANK, np.linspace(0.0, 4.0, count), order=4)
    for order, peak in enumerate(peaks(motion)):
        true = curve(order)
        assert peak.maximum == pytest.approx(true.max(), rel=1e-8)
        assert peak.minimum == pytest.approx(true.min(), rel=1e-8)
        at = np.array([peak.minimum_at, peak.maximum_at])
        shift = order * np.pi / 2
        there = 3.0**order * np.sin(3 * at + shift) + 0.25 * 6.0**order * np.sin(6 * at + shift)
        np.testing.assert_allclose(there, [peak.minimum, peak.maximum], rtol=1e-12)
    assert peaks(motion) is peaks(motion)


KNOT = 1 / 3
# from rest by t^4, then on with what its velocity and acceleration are at the knot: jerk and jounce end there
BRAKED = f"{KNOT}**4 + 4*{KNOT}**3*(t - {KNOT}) + 6*{KNOT}**2*(t - {KNOT})**2"


KINKED = jn.laws.ExpressionMotion(
    jn.laws.Expression("abs(t - a)**3*(1 - abs(t - a))/6"), {"a": KNOT}
)  # sign (1 - 4 |t - a|)


@pytest.mark.parametrize(
    "law, order, value",
    [
        (jn.laws.PiecewiseMotion(["t**4", BRAKED], until=[KNOT]), 3, 24 * KNOT),
        (KINKED, 3, 1.0),
        (KINKED, 3, -1.0),
    ],
)
@pytest.mark.parametrize("count", [4, 14, 301])
def test_a_peak_at_a_knot_is_the_limit_from_its_side(law, order, value, count):
    driver = dataclasses.replace(CRANK.drivers["turn"], motion=law)
    motion = jn.solve(dataclasses.replace(CRANK, drivers={"turn": driver}), np.linspace(0.0, 0.5, count), order=4)
    peak = peaks(motion)[order]
    found, at = (peak.maximum, peak.maximum_at) if value > 0 else (peak.minimum, peak.minimum_at)
    assert found == pytest.approx(value, rel=1e-9)
    assert at == pytest.approx(KNOT, abs=1e-11)


RISING = f"2 + 6*(t - {KNOT}) + 4*(t - {KNOT})**2"  # a force that ends at the knot
JUMPING = f"({RISING})*(1 - sign(t - {KNOT}))/2 + (1 + sign(t - {KNOT}))/2"
TORQUES = [
    jn.laws.PiecewiseMotion([RISING, "1"], until=[KNOT]),
    jn.forces.TimeLaw(jn.laws.PiecewiseMotion([RISING, "1"], until=[KNOT])),
    JUMPING,
    JUMPING.replace(str(KNOT), "knot") + " + 0*x*v",
]


@pytest.mark.parametrize("shown, law", [*(("torque", law) for law in TORQUES), ("reaction", TORQUES[0])])
def test_a_peak_at_a_knot_of_a_force_is_the_limit_from_its_side(shown, law):
    """What brakes a crank that turns evenly is taken up by its driver, and what pulls at its pin by the pin."""
    forces = {"torque": jn.forces.Torque(("ground", "a"), law), "reaction": jn.forces.PointForce("a", [0, 0], [law, 0])}
    outputs = {"torque": jn.outputs.DriverTorqueOutput("turn"), "reaction": jn.outputs.JointForceOutput("O", "ground")}
    even = {"turn": dataclasses.replace(CRANK.drivers["turn"], motion="w*t")}
    parts = {"drivers": even, "parameters": {"w": 3.0, "knot": KNOT}, "outputs": {"load": outputs[shown]}}
    braked = dataclasses.replace(CRANK, forces={"load": forces[shown]}, **parts)
    found = peaks(jn.solve(braked, np.linspace(0.0, 0.5, 6), order=2))
    largest = [max(peak.maximum, -peak.minimum) for peak in found if peak.output in ("load", "load_x")]
    assert largest == pytest.approx([2.0, 6.0, 8.0], rel=1e-8)


@pytest.mark.slow
def test_the_end_of_a_law_at_the_end_of_the_time_is_seen_from_before():
    """A 3-4-5 profile ends with the jerk that it begins with, 60 by way and duration, where the law is at rest."""
    law = jn.laws.SegmentedMotion([jn.laws.Segment("polynomial_3_4_5", 0.5, by=0.1)], beyond="hold")
    driver = dataclasses.replace(CRANK.drivers["turn"], motion=law)
    motion = jn.solve(dataclasses.replace(CRANK, drivers={"turn": driver}), np.linspace(0.0, 0.5, 6), order=3)
    jerk = peaks(motion)[3]
    assert jerk.maximum == pytest.approx(60 * 0.1 / 0.5**3, rel=1e-9)


@pytest.mark.parametrize(
    "minimum, maximum, largest",
    [
        (-1.0, 0.5, (True, False)),
        (-0.5, 1.0, (False, True)),
        (-1.0, 1.0, (True, True)),
        (-1.0 + 1e-14, 1.0, (True, True)),  # they differ by rounding
        (2.0, 2.0, (False, False)),  # it does not change, and has no peak
    ],
)
def test_the_largest_magnitude_is_marked(minimum, maximum, largest):
    assert Peak("psi", "velocity", "rad/s", minimum, 0.0, maximum, 1.0, 2.0).largest == largest


def test_ordinals_of_derivatives():
    assert [derivative_name(k) for k in (11, 12, 13, 21, 23)] == ["11th", "12th", "13th", "21st", "23rd"]


@pytest.mark.slow
def test_instants_are_solved_together_or_one_by_one(monkeypatch):
    motion, again = (jn.solve(CRANK, np.linspace(0.0, 1.0, 3), order=1) for _ in range(2))
    together = peaks(motion)
    monkeypatch.setattr("jounce.reporting.peaks.CHUNK", 1)
    for one, other in zip(together, peaks(again), strict=True):
        assert one.maximum == pytest.approx(other.maximum, rel=1e-12)


def test_a_peak_on_an_instant_keeps_its_time():
    (position, velocity) = peaks(jn.solve(CRANK, [0.0, 0.1], order=1))
    assert (velocity.maximum_at, position.minimum_at, position.minimum) == (0.0, 0.0, 0.0)
    (single,) = peaks(jn.solve(CRANK, [0.3], order=0))
    assert single.maximum == single.minimum
    assert single.maximum_at == 0.3


def test_peaks_of_a_motion_that_ends_early():
    link = jn.load("examples/four_bar.yaml").with_parameters(AB="8 cm")
    motion = jn.solve(link, order=2, strict=False)
    reached = motion.time[motion.status == 0]
    for order, peak in enumerate(peaks(motion)[:3]):
        grid = motion.outputs["psi"][motion.status == 0, order]
        assert peak.maximum >= grid.max()
        assert peak.minimum <= grid.min()
        assert 0 <= peak.maximum_at <= reached[-1] + 0.01


@pytest.mark.slow
def test_peaks_of_a_simulation():
    free = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={"rod": jn.Body([0, 0], mass=2.0, inertia=0.5, center_of_mass=[1, 0])},
        joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
        outputs={"angle": jn.outputs.AngleOutput("rod")},
    )
    (angle, rate) = peaks(jn.simulate(free, [0.0, 1.0, 2.0], order=1))
    assert angle.minimum == pytest.approx(-np.pi, abs=1e-8)  # it swings from one side to the other
    assert -rate.minimum == pytest.approx(np.sqrt(2 * 9.81 * 2.0 / 2.5), rel=1e-8)  # energy, at the lowest point


def test_a_motion_keeps_its_peaks_when_the_code_of_its_law_changes():
    gain = [1.0]
    crank = jn.Mechanism(
        space="planar",
        bodies={"rod": jn.Body([0, 0])},
        joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
        drivers={"motor": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", lambda t: gain[0] * t * (1 - t))},
        outputs={"angle": jn.outputs.AngleOutput("rod")},
    )
    time = [0.0, 0.2, 0.6, 1.0]
    (before,) = peaks(jn.solve(crank, time, order=0))
    later = jn.solve(crank, time, order=0)
    gain[0] = 3.0
    (after,) = peaks(later)
    assert before.maximum == pytest.approx(0.25, abs=1e-12)
    assert after.maximum == pytest.approx(0.24, abs=1e-12)  # at its own instants


@pytest.mark.slow
def test_knots_of_laws_count_in_simulations_backward():
    law = jn.laws.TrapezoidalMotion(0.0, 1.0, duration=1.0)
    driven = jn.Mechanism(
        space="planar",
        bodies={name: jn.Body([k, 0], mass=1.0, inertia=0.1) for k, name in enumerate(("rod", "bob"))},
        joints={
            "O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0]),
            "A": jn.planar.Revolute(("rod", "bob"), [1, 0], [0, 0]),
        },
        drivers={"motor": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", law)},
        outputs={"angle": jn.outputs.AngleOutput("rod")},
    )
    _, rate, *_ = peaks(jn.simulate(driven, [1.0, 0.6, 0.4, 0.0], order=3), refine=False)
    assert rate.maximum == pytest.approx(1.75, abs=1e-9)  # from 3/7 to 4/7 of the duration, between the instants


def test_peaks_at_the_instants_only(run, tmp_path):
    time = np.linspace(0.0, 4.0, 8)
    found = peaks(jn.solve(CRANK, time, order=2), refine=False)
    for order, peak in enumerate(found):
        shift = order * np.pi / 2
        law = 3.0**order * np.sin(3 * time + shift) + 0.25 * 6.0**order * np.sin(6 * time + shift)
        assert peak.maximum == pytest.approx(law.max(), rel=1e-12)
        assert peak.maximum_at == time[law.argmax()]
    path = tmp_path / "crank.yaml"
    jn.write_mechanism(dataclasses.replace(CRANK, time=jn.TimeGrid(start=0.0, stop=4.0, count=8)), path)
    status, printed, _ = run("run", path, "--order", 2, "--no-refine", "--json")
    assert status == 0
    assert [row["maximum"] for row in json.loads(printed)["peaks"]] == [peak.maximum for peak in found]


def test_a_table_has_no_times_for_what_is_constant():
    fixed = Peak("C_x", "jerk", "m/s^3", -3e-16, 0.25, 2e-16, 0.75, 4.0)
    moving = dataclasses.replace(fixed, output="C_y", maximum=4.0)
    shown = {row[0]: row[3:] for row in peaks_table([fixed, moving]).rows}
    assert shown == {"C_x": ["0", "-", "0", "-"], "C_y": ["0", "0.25", "4", "0.75"]}


@pytest.mark.parametrize("count", [2, 41, 201, 203])
def test_of_two_equal_peaks_the_earlier_is_named(count):
    swing = jn.Mechanism(
        space="planar",
        bodies={"arm": jn.Body(position=[0.0, 0.0])},
        joints={"O": jn.planar.Revolute(("ground", "arm"), point_i=[0, 0], point_j=[0, 0])},
        drivers={"theta": jn.drivers.CoordinateDriver(("ground", "arm"), "angle", motion="0.1 + sin(2*pi*t)")},
        outputs={"theta": jn.outputs.AngleOutput("arm")},
    )
    for order, peak in enumerate(peaks(jn.solve(swing, np.linspace(0.0, 1.9, count), order=4))):
        top, bottom = (1.0 - order) / 4 % 1.0, (3.0 - order) / 4 % 1.0  # sin(2 pi t + order pi/2) is 1 and -1
        assert (peak.maximum_at, peak.minimum_at) == pytest.approx((top, bottom), abs=1e-4)


def test_a_table_names_the_earliest_of_equal_extremes():
    time = np.linspace(0.0, 1.0, 11)
    raised = np.where(abs(time - 0.5) < 0.25, 2.0, 0.0)  # a dwell from 0.3 to 0.7 s
    raised[6] += 5e-16  # rounding, which has no say
    values = xarray.Dataset({"j": (("time", "derivative"), raised[:, None], {"units": "m"})}, {"time": time})
    (peak,) = table_peaks(values)
    assert (peak.minimum, peak.minimum_at) == (0.0, 0.0)
    assert (peak.maximum, peak.maximum_at) == (raised.max(), time[3])
    (unsolved,) = table_peaks(values.where(False))
    assert np.isnan([unsolved.minimum, unsolved.maximum, unsolved.minimum_at, unsolved.maximum_at]).all()
