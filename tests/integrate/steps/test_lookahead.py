"""Forces and laws that a long step would pass over: pulses in time and in place, kinks, jumps, what has no value."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import erf

import jounce as jn
from jounce import drivers, forces, planar

# one law for all tests, so that it is compiled once: pulses, a jump, a kink, and a term that ends
LAW = (
    "A*exp(-((t - t0)/w)**2) + B*exp(-((x - place)/w)**2)"
    " - J*(x - edge)/abs(x - edge) - K*abs(x - edge) + N*sqrt(end - t)"
)
GIVEN = {
    "A": 0.0,
    "t0": 0.2,
    "w": 1e-3,
    "B": 0.0,
    "place": 9.0,
    "J": 0.0,
    "K": 0.0,
    "edge": 99.0,
    "N": 0.0,
    "end": 99.0,
}
STRENGTH = 3e3  # N
PRECISION = 1e-12  # m: ten steps within 1e-14 m by series of order 26, each about as long as the pulse


def sled(**values):
    """A mass of 1 kg on a rail along x, at rest at 1 m unless told."""
    return jn.Mechanism(
        space="planar",
        parameters={**GIVEN, "at": 1.0, "rate": 0.0, **values},
        bodies={"sled": jn.Body([1, 0], mass=1.0, inertia=1.0)},
        joints={"rail": planar.Prismatic(("ground", "sled"), [0, 0], [0, 0], [1, 0], [1, 0])},
        forces={"push": forces.SlideForce(("ground", "sled"), [0, 0], [0, 0], [1, 0], LAW)},
        initial={"go": drivers.SlideDriver(("ground", "sled"), [0, 0], [0, 0], [1, 0], "at + rate*t")},
        outputs={"x": jn.outputs.PointOutput("sled", [0, 0])},
    )


def gained(stop, t0, w):
    """Velocity that the pulse in time has given by an instant."""
    return STRENGTH * w * math.sqrt(math.pi) / 2 * (erf((stop - t0) / w) + erf(t0 / w))


@pytest.mark.slow
@pytest.mark.parametrize("stop", [0.4, 5.0])
def test_a_pulse_in_time_is_seen_from_any_distance_and_of_any_width(stop):
    for t0 in (0.05, 0.137, 0.2, 0.2137, 0.35):
        for w in (1e-4, 1e-3, 1e-2, 1e-1):
            motion = jn.simulate(sled(A=STRENGTH, t0=t0, w=w), [0.0, stop], 1)
            assert abs(motion.outputs["x"][-1, 1, 0] - gained(stop, t0, w)) < PRECISION / w, (t0, w)
            assert motion.steps < 25
            assert motion.kinks == []  # steep, but smooth


@pytest.mark.slow
def test_a_pulse_in_time_backward_and_before_an_event():
    there = jn.simulate(sled(A=STRENGTH), [0.0, 0.4], 1).outputs["x"][-1, :, 0]
    mechanism = sled(A=STRENGTH, at=there[0] - 0.4 * there[1], rate=there[1])
    back = jn.simulate(mechanism, [0.4, 0.0], 1).outputs["x"][-1, :, 0]
    np.testing.assert_allclose(back, [1.0, 0.0], atol=1e-9)
    away = jn.Event(jn.outputs.PointOutput("sled", [0, 0]), value=1.5, terminal=True)
    run = jn.simulate(sled(A=STRENGTH), [0.0, 4.0], 1, events=[away])
    assert run.ended_at == pytest.approx(0.2 + 0.5 / gained(4.0, 0.2, 1e-3), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("place", [1.3, 1.77, 1.99])
def test_a_pulse_in_place_gives_its_work(place):
    for w in (1e-4, 1e-3, 1e-2):
        motion = jn.simulate(sled(B=STRENGTH, place=place, w=w, rate=1.0), [0.0, 1.5], 1)
        speed = math.sqrt(1 + 2 * STRENGTH * w * math.sqrt(math.pi))
        assert motion.outputs["x"][-1, 1, 0] == pytest.approx(speed, rel=2e-9)


@pytest.mark.slow
def test_steps_over_a_jump_and_a_kink_cost_no_digits_and_are_reported():
    jump = jn.simulate(sled(J=2.0, edge=0.0), [0.0, 3.0], 1)  # falls to 0 at 1 s, turns at -1 m at 2 s
    np.testing.assert_allclose(jump.outputs["x"][-1, :, 0], [0.0, 2.0], atol=1e-9)
    ((when, name),) = jump.kinks
    assert name == "forces.push"
    assert when == pytest.approx(1.0, abs=1e-9)
    kink = jn.simulate(sled(K=4.0, edge=0.0), [0.0, 1.5], 1)  # cos(2 t) down to 0, then -sinh(2 (t - pi/4))
    since = 2 * (1.5 - math.pi / 4)
    np.testing.assert_allclose(kink.outputs["x"][-1, :, 0], [-math.sinh(since), -2 * math.cosh(since)], rtol=1e-10)
    assert [name for _, name in kink.kinks] == ["forces.push"]
    assert kink.kinks[0][0] == pytest.approx(math.pi / 4, abs=1e-4)
    assert max(jump.steps, kink.steps) < 20


@pytest.mark.slow
def test_a_force_that_ends_is_named_with_the_time():
    motion = jn.simulate(sled(N=1.0, end=1.0), [0.0, 0.5, 1.5, 2.0], 1, strict=False)
    assert [jn.Status(s).name for s in motion.status] == ["OK", "OK", "INADMISSIBLE", "NOT_REACHED"]
    assert motion.ended_at == pytest.approx(1.0, abs=1e-8)
    assert motion.faults == {2: "forces.push at t = 1 s"}
    assert np.isnan(motion.outputs["x"][2:]).all()


@pytest.mark.slow
def test_a_rate_that_is_not_finite_at_the_start_is_named():
    with pytest.raises(jn.errors.SolveError, match=r"forces\.push at t = 0 s: inadmissible"):
        jn.simulate(sled(N=1.0, end=0.0), [0.0, -1.0], 1)


@pytest.mark.slow
def test_the_longest_step_finds_what_is_narrower_than_the_places_looked_at():
    motion = jn.simulate(sled(A=STRENGTH, t0=0.23456, w=1e-6), [0.0, 0.4], 1, longest_step=2e-4)
    assert motion.outputs["x"][-1, 1, 0] == pytest.approx(gained(0.4, 0.23456, 1e-6), abs=PRECISION / 1e-6)


@pytest.mark.slow
def test_smooth_forces_cost_no_steps():
    # x'' = -4 x, seen by the law as a kink far away; the same steps as to the series alone
    motion = jn.simulate(sled(K=4.0, edge=-99.0, at=1.0), [0.0, 0.05], 1)
    assert motion.steps == 1
    assert motion.kinks == []


@pytest.mark.slow
def test_implicit_formulas_see_pulses_too():
    for values, speed in (
        ({"A": STRENGTH, "t0": 0.137}, gained(0.4, 0.137, 1e-3)),
        ({"B": STRENGTH, "place": 1.2, "rate": 1.0}, math.sqrt(1 + 2 * STRENGTH * 1e-3 * math.sqrt(math.pi))),
    ):
        motion = jn.simulate(sled(**values), [0.0, 0.4], 1, method=jn.Obreshkov(8), tolerance=1e-12)
        assert motion.outputs["x"][-1, 1, 0] == pytest.approx(speed, rel=1e-7)


@pytest.mark.slow
def test_every_run_of_a_batch_sees_its_own_pulse():
    t0, w = np.array([0.05, 0.137, 0.2137, 0.35]), np.array([1e-4, 1e-3, 1e-2, 1e-3])
    batch = jn.simulate_batch(sled(A=STRENGTH), {"t0": t0, "w": w}, [0.0, 0.4], 1)
    expected = [gained(0.4, *pair) for pair in zip(t0, w, strict=True)]
    assert (abs(batch.outputs["x"][:, -1, 1, 0] - expected) < PRECISION / w).all()


@pytest.mark.slow
def test_a_pulse_of_a_driver():
    # a trolley is thrown to and fro; a damper of 2 N s/m passes it on to 1 kg: v' = -2 (v - s')
    rail = ([0, 0], [0, 0], [1, 0], [1, 0])
    law = "rise*exp(-((t - t0)/w)**2) + leap*(t - when)/abs(t - when)"
    mechanism = jn.Mechanism(
        space="planar",
        parameters={"t0": 0.2, "w": 1e-3, "rise": 0.3, "leap": 0.0, "when": 99.0},
        bodies={name: jn.Body([0, 0], mass=1.0, inertia=1.0) for name in ("trolley", "load")},
        joints={name: planar.Prismatic(("ground", name), *rail) for name in ("trolley", "load")},
        drivers={"s": drivers.CoordinateDriver(("ground", "trolley"), "x", law)},
        forces={"oil": forces.SlideForce(("trolley", "load"), [0, 0], [0, 0], [1, 0], "-2*v")},
        outputs={"x": jn.outputs.PointOutput("load", [0, 0])},
    )
    for t0, w in ((0.05, 1e-3), (0.2, 1e-4), (0.3137, 1e-3), (0.3, 1e-2)):
        motion = jn.simulate(mechanism.with_parameters(t0=t0, w=w), [0.0, 0.4], 1)
        expected = -4 * 0.3 * w * math.sqrt(math.pi) * math.exp(-2 * (0.4 - t0) + w**2)
        assert motion.outputs["x"][-1, 1, 0] == pytest.approx(expected, rel=1e-7)
        assert motion.drift.max() < 1e-13
    # where the law jumps, the run ends
    torn = jn.simulate(mechanism.with_parameters(rise=0.0, leap=0.1, when=0.3), [0.0, 0.2, 0.4], 1, strict=False)
    assert [jn.Status(s).name for s in torn.status] == ["OK", "OK", "COLLAPSED"]
    assert torn.ended_at == pytest.approx(0.3, abs=1e-9)
    assert torn.faults == {2: "drivers.s at t = 0.3 s"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", ["0.3*sign(t - 0.77)", "t + 1e-4*sign(t - 0.77)", jn.laws.PiecewiseMotion(["t", "0.78"], until=[0.77])]
)
def test_a_run_ends_where_a_law_jumps_that_has_a_value_there(law):
    """A trolley that is set elsewhere leaves its load undetermined."""
    rail = ([0, 0], [0, 0], [1, 0], [1, 0])
    crane = jn.Mechanism(
        space="planar",
        gravity=[0, -9.81],
        bodies={
            "trolley": jn.Body([0, 0], mass=5.0, inertia=1.0),
            "load": jn.Body([0, 0], angle=-1.2, mass=2.0, inertia=0.3, center_of_mass=[0.7, 0]),
        },
        joints={
            "rail": planar.Prismatic(("ground", "trolley"), *rail),
            "hook": planar.Revolute(("trolley", "load"), [0, 0], [0, 0]),
        },
        drivers={"x": drivers.CoordinateDriver(("ground", "trolley"), "x", law)},
    )
    run = jn.simulate(crane, [0.0, 0.5, 2.0], 1, strict=False)
    assert [jn.Status(s).name for s in run.status] == ["OK", "OK", "COLLAPSED"]
    assert run.ended_at == pytest.approx(0.77, abs=1e-9)
    assert run.faults == {2: "drivers.x at t = 0.77 s"}


@pytest.mark.slow
@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_a_spring_turns_around_at_its_anchor(gap):
    """The force of a spring reverses within a time of `gap` over the speed, which few points along a step may miss."""
    sprung = dataclasses.replace(
        sled(at=-2.0, rate=10.0), forces={"spring": forces.Spring(("ground", "sled"), [0, gap], [0, 0], 2.0, 1.5)}
    )
    motion = jn.simulate(sprung, [0.0, 0.1, 0.3, 0.4], 1)
    x, v = motion.outputs["x"][:, :2, 0].T
    np.testing.assert_allclose(v**2 + 2.0 * (np.hypot(x, gap) - 1.5) ** 2, 100.0 + 2.0 * (np.hypot(2, gap) - 1.5) ** 2)
    assert x[0] < x[1] < 0 < x[2] < x[3]


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6])
def test_a_pulse_whose_denominator_nears_zero(width):
    pushed = dataclasses.replace(
        sled(), forces={"push": forces.PointForce("sled", [0, 0], [f"{width}/({width}**2 + (t - 0.3)**2)", 0.0])}
    )
    velocity = jn.simulate(pushed, [0.0, 1.0], 1).outputs["x"][-1, 1, 0]
    assert velocity == pytest.approx(math.atan(0.7 / width) + math.atan(0.3 / width), rel=0, abs=1e-10)
