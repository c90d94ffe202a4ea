"""Laws of which a derivative is given, against integrals in closed form."""

import jax
import mpmath
import numpy as np
import pytest

import jounce as jn


def values(law, instants, order=0):
    return np.asarray(law(jn.Jet.variable(np.array(instants, float), order)).dense().derivatives())


def run_up(t):
    return 100 * (t + mpmath.mpf("0.2") * mpmath.expm1(-t / mpmath.mpf("0.2")))


def softened_step(t):
    def antiderivative(t):
        return mpmath.log(mpmath.cosh((t - 3) * 100)) / 100

    return antiderivative(t) - antiderivative(0)


def bent(t):
    return t * abs(t) / 2


CASES = {
    "100*(1 - exp(-t/0.2))": (run_up, [-1.0, 1e-4, 0.3, 1.0, 2.5, 1000.0]),
    "sin(2*pi*t)": (lambda t: (1 - mpmath.cos(2 * mpmath.pi * t)) / (2 * mpmath.pi), [-40.2, 0.1, 7.3, 99.9]),
    "abs(t - 0.3)": (
        lambda t: mpmath.mpf("0.045") + (t - mpmath.mpf("0.3")) * abs(t - mpmath.mpf("0.3")) / 2,
        [0.1, 0.3, 1.7, 30.0],
    ),
    "1 + sign(t - 1.3)": (lambda t: 2 * max(t - mpmath.mpf("1.3"), 0), [1.2, 2.7, 30.0]),
    "tanh((t - 3)/0.01)": (softened_step, [1.0, 3.0, 3.01, 10.0]),
    "sqrt(t)": (lambda t: 2 * mpmath.mpf(t) ** 1.5 / 3, [0.0, 0.01, 1.0, 100.0]),
}


@pytest.mark.slow
@pytest.mark.parametrize("text", [pytest.param(x, marks=pytest.mark.slow) if k else x for k, x in enumerate(CASES)])
def test_the_integral_of_a_formula(text):
    exact, instants = CASES[text]
    with mpmath.workdps(40):
        expected = np.array([float(exact(mpmath.mpf(t))) for t in instants])
    found = values(jn.laws.IntegratedMotion(text), instants)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_derivatives_are_those_of_the_formula_and_follow_a_leader():
    law = jn.laws.FollowingMotion(jn.laws.IntegratedMotion("cos(t)", initial=[0.5]), "3*t + 0.2*sin(t)")
    instants = [-2.0, 0.3, 1.9]
    with mpmath.workdps(50):
        exact = [
            [mpmath.diff(lambda t: 0.5 + mpmath.sin(3 * t + 0.2 * mpmath.sin(t)), x, k) for x in instants]
            for k in range(5)
        ]
    np.testing.assert_allclose(values(law, instants, 4), np.array(exact, float), rtol=0, atol=2e-12)


@pytest.mark.slow
def test_a_second_derivative_with_what_is_known_at_the_start():
    law = jn.laws.IntegratedMotion("6*t", derivative=2, initial=["x0", 2.0], start=1.0).resolved({"x0": 3.0})
    instants = np.array([-1.0, 1.0, 2.5])
    np.testing.assert_allclose(values(law, instants, 1), [instants**3 - instants + 3, 3 * instants**2 - 1], atol=1e-12)


@pytest.mark.slow
def test_pieces_that_repeat_are_integrated_from_border_to_border():
    saw = jn.laws.PiecewiseMotion(["t", "2 - t"], until=[1.0, 2.0], beyond="repeat")
    found = values(jn.laws.IntegratedMotion(saw), [0.5, 1.5, 7.3, 50.2, -1.0])[0]
    np.testing.assert_allclose(found, [0.125, 0.875, 3 + 0.5 + 0.3 - 0.045, 25.02, -0.5], rtol=1e-13)
    pulse = [jn.laws.Segment("dwell", 100.0), *(jn.laws.Segment("cycloidal", 0.005, to=x) for x in (1.0, 0.0))]
    found = values(jn.laws.IntegratedMotion(jn.laws.SegmentedMotion(pulse)), [50.0, 101.0])[0]
    np.testing.assert_allclose(found, [0.0, 0.005], rtol=1e-11)


def test_a_pole_is_never_passed():
    law = jn.laws.IntegratedMotion("1/(2 - t)**2")
    np.testing.assert_allclose(values(law, [1.9])[0], [1 / 0.1 - 0.5], rtol=1e-12)
    assert np.isnan(values(law, [2.5])).all()
    with pytest.raises(jn.errors.TrajectoryError, match=r"is integrated from .* to 2 s only"):
        law.check_instants(0.0, 2.5)


@pytest.mark.slow
def test_slopes_by_parameters():
    def distance(tau):
        law = jn.laws.IntegratedMotion("1 - exp(-t/tau)").resolved({"tau": tau})
        return law(jn.Jet.variable(0.7, 0)).coefficients[0]

    tau = 0.3
    found = jax.jacfwd(distance)(tau), jax.grad(distance)(tau)
    expected = -(1 - np.exp(-0.7 / tau)) + 0.7 / tau * np.exp(-0.7 / tau)  # of t - tau (1 - exp(-t/tau))
    np.testing.assert_allclose(found, [expected, expected], rtol=1e-12)


@pytest.mark.slow
def test_slopes_by_the_start_and_the_values_there():
    def place(start, x0, v0):
        law = jn.laws.IntegratedMotion("6*t", 2, initial=["x0", "v0"], start="s").resolved(
            {"s": start, "x0": x0, "v0": v0}
        )
        return law(jn.Jet.variable(2.0, 0)).coefficients[0]

    start, v0 = 0.5, 3.0  # x0 + v0 (t - s) + t^3 - s^3 - 3 s^2 (t - s)
    slopes = jax.jacfwd(place, (0, 1, 2))(start, 1.0, v0)
    np.testing.assert_allclose(slopes, [-v0 - 6 * start * (2 - start), 1.0, 2 - start], rtol=1e-12)
    curvature = jax.jacfwd(jax.jacfwd(place))(start, 1.0, v0)
    np.testing.assert_allclose(curvature, -6 * (2 - 2 * start), rtol=1e-9)


@pytest.mark.slow
def test_knots_are_those_of_the_derivative_one_order_higher():
    ramp = jn.laws.SegmentedMotion([jn.laws.Segment("constant_velocity", 1.0, to=2.0)])
    result = jn.laws.continuity(jn.laws.IntegratedMotion(ramp), -0.5, 1.5)
    assert [(x.order, x.count, abs(x.size)) for x in result.derivatives if x.count] == [(2, 2, 2.0)]


def test_what_cannot_be_is_refused():
    with pytest.raises(jn.errors.TrajectoryError, match=r"initial: must be a list of at most 1 values"):
        jn.laws.IntegratedMotion("t", initial=[0.0, 1.0])
    with pytest.raises(jn.errors.TrajectoryError, match="derivative"):
        jn.laws.IntegratedMotion("t", derivative=9)
