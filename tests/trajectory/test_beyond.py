"""Laws through samples: every degree, steps in the data, and instants beyond them."""

import math

import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError
from jounce.mechanism.laws.law_checks import check_laws
from jounce.trajectory.sample_errors import derivative_errors

TIMES = np.linspace(0.0, 2.0, 201)


def derivatives(law, order, at):
    return np.array(law(jn.Jet.variable(np.asarray(at, float), order)).derivatives())


def wave(order, at, rate=3.0):
    return np.array([rate**k * np.sin(rate * np.asarray(at) + k * math.pi / 2) for k in range(order + 1)])


@pytest.mark.parametrize("degree", range(1, 12))
def test_every_degree_goes_through_samples_of_a_sine(degree):
    law = jn.laws.SplineMotion(TIMES, np.sin(3 * TIMES), degree)
    at, order = np.linspace(0.3, 1.7, 17), min(degree - 1, 4)
    step = 3 * (TIMES[1] - TIMES[0])
    for k, (found, true) in enumerate(zip(derivatives(law, order, at), wave(order, at), strict=True)):
        rounding = 1e-14 * 3**k * (10 / step) ** k
        assert np.abs(found - true).max() <= 3**k * step ** (degree + 1 - k) + rounding
    np.testing.assert_allclose(derivatives(law, 0, TIMES)[0], np.sin(3 * TIMES), atol=1e-14)


@pytest.mark.parametrize("degree", [1, 3, 5, 9, 11])
def test_samples_of_uneven_steps_and_large_times(degree):
    times = 1e6 + np.cumsum(np.random.default_rng(2).uniform(0.005, 0.02, 150))
    polynomial = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.25][: degree + 1])
    law = jn.laws.SplineMotion(times, polynomial(times - 1e6), degree)
    at = np.linspace(times[2], times[-3], 9)
    for k in range(min(degree, 3) + 1):
        true = polynomial.deriv(k)(at - 1e6) if k else polynomial(at - 1e6)
        np.testing.assert_allclose(derivatives(law, 3, at)[k], true, atol=3e-8 * 300.0 ** max(k - 1, 0))


@pytest.mark.parametrize(
    "times, values, degree, words",
    [
        ([0, 1, 1, 2], [0, 1, 1, 2], 1, r"times\[2\]: .* must increase, .* repeats"),
        ([0, 2, 1, 3], [0, 1, 1, 2], 1, r"times\[2\]: .* must increase, .* comes before"),
        ([0], [1], 1, "at least two samples"),
        ([], [], 1, "at least two samples"),
        ([0, 1, 2], [0, 1, 2], 0, "from 1 to 11"),
        ([0, 1, 2], [0, 1, 2], 12, "from 1 to 11"),
        ([0, 1, 2], [0, 1, 2], True, "from 1 to 11"),
        ([0, 1, 2], [0, 1, math.inf], 1, "finite"),
        ([0, "a", 2], [0, 1, 2], 1, "times: must be real numbers"),
        ([0, 1, 2], [0, 1], 1, "one value for each time"),
    ],
)
def test_samples_that_give_no_law_are_refused(times, values, degree, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.laws.SplineMotion(times, values, degree)


def test_a_million_samples():
    times = np.linspace(0.0, 100.0, 1_000_000)
    law = jn.laws.SplineMotion(times, np.sin(times), 3)
    at = [3.3, 50.05, 99.99999]
    np.testing.assert_allclose(derivatives(law, 1, at), wave(1, at, 1.0), atol=1e-11)


def test_beyond_the_samples_a_law_refuses():
    law = jn.laws.SplineMotion(TIMES, np.sin(3 * TIMES))
    for at in (-0.1, 2.1, [0.5, 2.5]):
        with pytest.raises(jn.errors.MechanismError, match="the samples go from 0 to 2 s"):
            law(jn.Jet.variable(np.asarray(at, float), 2))
    assert np.isfinite(derivatives(law, 2, [-1e-10, 2 + 1e-10])).all()  # rounding
    import jax

    traced = jax.jit(lambda t: law(jn.Jet.variable(t, 2)).derivatives())(np.array([1.0, 2.1]))
    assert np.isfinite(traced[:, 0]).all()
    assert np.isnan(traced[:, 1]).all()


def test_held_laws_rest_at_their_ends():
    law = jn.laws.SplineMotion(TIMES, 1 + np.sin(3 * TIMES), beyond="hold")
    found = derivatives(law, 3, [-5.0, 2.5, 1.0])
    np.testing.assert_allclose(found[0, :2], [1.0, 1 + math.sin(6.0)], atol=1e-14)
    assert (found[1:, :2] == 0).all()
    np.testing.assert_allclose(found[1, 2], 3 * math.cos(3.0), atol=1e-10)


@pytest.mark.parametrize("degree", [3, 5, 7, 9, 11])
def test_repeated_laws_are_smooth_where_they_begin_again(degree):
    times = np.linspace(0.0, 2 * math.pi, 101)
    at = [-8.0, 0.0, 2 * math.pi, 6.2, 20.0, 1000.0]
    law = jn.laws.SplineMotion(times, np.cos(times), degree, beyond="repeat")
    np.testing.assert_allclose(derivatives(law, 2, at)[0], np.cos(at), atol=3e-7)
    np.testing.assert_allclose(derivatives(law, 2, at)[2], -np.cos(at), atol=2e-3)
    sides = derivatives(law, degree - 1, [2 * math.pi - 1e-9, 2 * math.pi + 1e-9])
    np.testing.assert_allclose(sides[:, 0], sides[:, 1], atol=1e-8 * 100.0 ** max(degree - 3, 0))


def test_repeated_turns_go_on_turning():
    times = np.linspace(0.0, 0.5, 51)
    angle = 4 * math.pi * times + 0.1 * np.sin(4 * math.pi * times)
    law = jn.laws.SplineMotion(times, angle, 5, beyond="repeat")
    at = np.array([-0.7, 0.2, 0.5, 3.3])
    np.testing.assert_allclose(derivatives(law, 0, at)[0], 4 * math.pi * at + 0.1 * np.sin(4 * math.pi * at), atol=1e-8)


@pytest.mark.parametrize("values, degree, words", [(TIMES, 3, "must end at the value"), (0 * TIMES, 4, "odd degree")])
def test_what_does_not_close_cannot_repeat(values, degree, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        jn.laws.SplineMotion(TIMES, values, degree, beyond="repeat")


def test_unknown_ways_are_refused():
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'hold'"):
        jn.laws.SplineMotion(TIMES, TIMES, beyond="held")
    with pytest.raises(JounceError, match="refuse"):
        jn.laws.PolynomialMotion(TIMES, TIMES, beyond="repeat")


def test_polynomials_through_knots_refuse_too():
    law = jn.laws.PolynomialMotion(TIMES, np.sin(3 * TIMES))
    with pytest.raises(jn.errors.MechanismError, match="go from 0 to 2 s"):
        law(jn.Jet.variable(2.1, 1))
    held, on = (jn.laws.PolynomialMotion(TIMES, np.sin(3 * TIMES), beyond=way) for way in ("hold", "continue"))
    assert derivatives(held, 1, 2.1)[1] == 0
    np.testing.assert_allclose(derivatives(on, 0, 2.01)[0], math.sin(6.03), atol=1e-6)


def test_profiles_hold_their_ends():
    for law in (
        jn.laws.TrapezoidalMotion(0.0, 1.0, duration=1.0),
        jn.laws.CycloidalMotion(),
        jn.laws.RestToRestMotion(),
    ):
        law.check_instants(-10.0, 10.0)
        np.testing.assert_array_equal(derivatives(law, 2, [-3.0, 5.0]), [[0, 1], [0, 0], [0, 0]])


def test_a_trajectory_does_not_outlast_its_laws():
    law = jn.laws.SplineMotion(TIMES, TIMES**2)
    jn.JointTrajectory({"a": law}, 0.0, 2.0)
    with pytest.raises(jn.errors.TrajectoryError, match=r"laws.a: the samples go from 0 to 2 s") as error:
        jn.JointTrajectory({"a": law}, 0.0, 2.5)
    assert error.value.value == 2.5


def arm(law, force=None):
    return jn.Mechanism(
        space="planar",
        bodies={"a": jn.Body([0, 0], mass=1.0, inertia=1.0)},
        joints={"O": jn.planar.Revolute(("ground", "a"), [0, 0], [0, 0])},
        drivers={} if law is None else {"turn": jn.drivers.CoordinateDriver(("ground", "a"), "angle", motion=law)},
        forces={} if force is None else {"load": jn.forces.Torque(("ground", "a"), law=force)},
        outputs={"angle": jn.outputs.AngleOutput("a")},
    )


def test_solving_and_simulating_refuse_before_they_compute():
    law = jn.laws.SplineMotion(TIMES, np.sin(3 * TIMES))
    for call in (jn.solve, jn.simulate):
        with pytest.raises(jn.errors.MechanismError, match="samples go from 0 to 2 s") as error:
            call(arm(law), [0.0, 1.0, 2.5], order=1)
        assert (error.value.name, error.value.value) == ("drivers.turn.motion", 2.5)
    with pytest.raises(jn.errors.MechanismError, match="samples go from 0 to 2 s") as error:
        jn.simulate(arm(None, law), [0.0, 1.0, 2.5], order=1)
    assert error.value.name == "forces.load.law"
    with pytest.raises(jn.errors.MechanismError, match="samples go from 0 to 2 s"):
        jn.simulate(arm(None, law), [0.0, -1.0], order=1)
    check_laws(arm(None, law), np.array([0.0, 2.5]), 4, forces=False)  # forces do not bear on what is prescribed


@pytest.mark.slow
def test_laws_of_three_kinds_side_by_side():
    """Stacked drivers take their own samples, each with its own way beyond them."""
    times = np.linspace(0.0, 2 * math.pi, 101)
    laws = {way: jn.laws.SplineMotion(times, np.cos(times), beyond=way) for way in ("hold", "repeat", "refuse")}
    mechanism = jn.Mechanism(
        space="planar",
        bodies={name: jn.Body([0, 0]) for name in laws},
        joints={name: jn.planar.Revolute(("ground", name), [0, 0], [0, 0]) for name in laws},
        drivers={f"d{n}": jn.drivers.CoordinateDriver(("ground", n), "angle", motion=law) for n, law in laws.items()},
        outputs={name: jn.outputs.AngleOutput(name) for name in laws},
    )
    motion = jn.solve(mechanism, [0.0, 3.0, 2 * math.pi], order=2)
    for name in laws:
        np.testing.assert_allclose(motion.outputs[name][1], np.cos([3.0, 3 + math.pi / 2, 3 + math.pi]), atol=1e-6)


@pytest.mark.slow
def test_noisy_samples_of_a_driver_warn_as_those_of_a_trajectory_do():
    generator = np.random.default_rng(3)
    clean = np.sin(3 * TIMES)
    noisy = clean + 1e-5 * generator.standard_normal(len(TIMES))
    jn.solve(arm(jn.laws.SplineMotion(TIMES, clean)), TIMES[::50], order=2)  # no warning
    trajectory = jn.JointTrajectory.from_samples(TIMES, noisy[:, None], ["a"])
    law = jn.laws.SplineMotion(TIMES, noisy)
    np.testing.assert_array_equal(law.errors, trajectory.estimate_error(5)[:, 0])
    worst = trajectory.supported_order() + 1
    with pytest.warns(jn.errors.SampleWarning, match=rf"'drivers\.turn\.motion' .*derivative of order {worst}"):
        jn.solve(arm(law), TIMES[::50], order=4)
    jn.solve(arm(law), TIMES[::50], order=worst - 1)  # no warning
    with pytest.warns(jn.errors.SampleWarning, match="forces.load.law"):
        check_laws(arm(None, law), TIMES, worst + 2, forces=True)
    check_laws(arm(None, law), TIMES, worst + 1, forces=True)


@pytest.mark.slow
def test_errors_of_very_many_samples_are_those_of_stretches():
    times = np.linspace(0.0, 20.0, 30_001)
    values = np.sin(3 * times) + 1e-9 * np.random.default_rng(4).standard_normal(len(times))
    found, few = derivative_errors(times, values, 5), derivative_errors(times[:10_000], values[:10_000], 5)
    np.testing.assert_allclose(found, few, rtol=0.5)
