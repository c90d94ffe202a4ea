"""The two-point formulas of Obreshkov: a closed form of one step, dense output, estimates, lack of convergence."""

from math import comb, factorial

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import BPoly

import jounce as jn
from jounce.dynamics.forward.accelerations import Expansion, State
from jounce.dynamics.forward.initial_state import consistent_start
from jounce.errors import JounceError
from jounce.integrate.steps import registry
from tests.problems import dynamics
from tests.problems.marches import LENIENT, ends, expansion_at, marched, widened

FREQUENCY = np.sqrt(50.0 / (2.0 + 0.09 / 0.3**2))
STEPS = np.array([0.01, 0.1, 0.25])
DISC: list = []


def disc():
    """Return the start of a disc that swings on a spring."""
    if not DISC:
        DISC.append(consistent_start(dynamics.rolling_disc(), 0.0))
    return DISC[0]


def pade(p, z):
    """Return the diagonal rational approximation of exp(z), of degree p above and below."""
    weights = [comb(p, j) * factorial(2 * p - j) / factorial(2 * p) for j in range(p + 1)]
    return sum(w * z**j for j, w in enumerate(weights)) / sum(w * (-z) ** j for j, w in enumerate(weights))


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 8])
def test_one_step_of_an_oscillator_is_the_diagonal_approximation_of_its_exponential(order):
    method = jn.Obreshkov(order, step=1.0)
    expansion = expansion_at(disc().equations, widened(disc().state, 3), jnp.zeros(3), order=order // 2)
    end = method.arrive(disc().equations, expansion, jnp.zeros(3), jnp.asarray(STEPS))
    before = 0.4 + 0.7j / -FREQUENCY  # x' is the imaginary part times minus the frequency: z = exp(i w t)
    after = pade(order // 2, 1j * FREQUENCY * STEPS) * before
    assert np.allclose(end.position[0, 0], after.real, rtol=0, atol=2e-15)
    assert np.allclose(end.velocity[0, 0], -FREQUENCY * after.imag, rtol=0, atol=4e-15)
    assert np.allclose(end.spin[0, 0], -FREQUENCY * after.imag / 0.3, rtol=0, atol=2e-14)


def test_dense_output_joins_the_derivatives_of_both_ends():
    random, p, step = np.random.default_rng(3), 3, 0.2
    method = jn.Obreshkov(2 * p)

    def expansion():
        return Expansion(State(*(random.normal(size=(p + 3, 2, 1, 1)) for _ in range(4))), None, None)

    first, last = expansion(), expansion()
    found = method.polynomial(first, last, jnp.array([step]))
    factorials = np.array([factorial(k) for k in range(p + 1)])[:, None]
    for a, b, c in zip(first.state, last.state, found, strict=True):
        derivatives = [x[: p + 1, :, 0, 0] * factorials for x in (a, b)]
        oracle = BPoly.from_derivatives([0, step], derivatives)
        assert c.shape == (2 * p + 2, 2, 1, 1)
        for t in (0.0, 0.07, 0.2):
            value = sum(np.asarray(c)[k, :, 0, 0] * t**k for k in range(2 * p + 2))
            assert np.allclose(value, oracle(t), rtol=1e-13, atol=1e-13)


@pytest.mark.slow
def test_estimate_of_the_error_is_that_of_one_step():
    method = jn.Obreshkov(4)
    tolerance = 1e-9
    pendulum = consistent_start(dynamics.double_pendulum(0.4, 1.3, 1.0, -2.0), 0.0)
    order = method.expansion_order(tolerance)
    start = expansion_at(pendulum.equations, widened(pendulum.state, 2), jnp.zeros(2), order=order)
    steps = jnp.array([0.01, 0.02])
    end = method.arrive(pendulum.equations, start, jnp.zeros(2), steps)
    later = expansion_at(pendulum.equations, end, steps, order=order)
    estimate = np.asarray(method.error(start, later, steps, 1.0))
    powers = np.asarray(steps) ** np.arange(order + 1.0)[:, None]
    exact = [np.sum(np.asarray(c) * powers[:, None, None], axis=0) for c in start.state]
    # the series, of order 8, is much better than the formula of order 4
    true = [np.max(np.abs(a - b), axis=(0, 1)) for a, b in zip(end, exact, strict=True)]
    true = np.max([true[0], true[1], true[2] * steps, true[3] * steps], axis=0)
    assert np.allclose(estimate, true, rtol=0.05)
    assert np.allclose(np.log2(true[1] / true[0]), 5, atol=0.15)


@pytest.mark.slow
def test_steps_of_given_length_are_cut_only_where_the_iteration_does_not_converge():
    swinging = disc()
    current, tried = marched(swinging, jn.Obreshkov(4, step=0.125), 1.0, LENIENT)
    assert tried == 8
    _, tried = marched(swinging, jn.Obreshkov(4, step=4.0), 4.0, LENIENT)
    assert tried > 4
    expected = dynamics.rolling_motion([1.0], 1)[0]
    assert np.allclose(ends(current)[[0, 3], 0], expected, atol=2e-3)


@pytest.mark.slow
def test_steps_by_the_error_reach_what_is_asked():
    time, kinds = dynamics.dynamic_reference("double_pendulum")
    motion = jn.simulate(dynamics.double_pendulum(), [0.0, float(time[0])], 2, method=jn.Obreshkov(4), tolerance=1e-11)
    for name in "ab":
        found, expected = motion.outputs[name][1], kinds["angles"][name][0, :3]
        assert np.allclose(found[1:], expected[1:], rtol=0, atol=1e-7)
    assert np.max(np.abs(motion.drift)) < 1e-13


@pytest.mark.parametrize("order", [0, 3, 5, 10, True, 4.5])
def test_orders_without_a_formula(order):
    with pytest.raises(Exception, match="order"):
        jn.Obreshkov(order)


@pytest.mark.parametrize("step", [0, -0.1, np.inf, np.nan, True])
@pytest.mark.parametrize("method", [jn.Obreshkov, jn.Taylor])
def test_steps_that_are_none(method, step):
    with pytest.raises(JounceError, match="positive number of seconds"):
        method(4, step=step)


def test_methods_are_found_by_name_and_users_register_theirs(monkeypatch):
    monkeypatch.setattr(registry, "_methods", dict(registry._methods))
    assert jn.integrate.method_named("obreshkov-6", 0.01) == jn.Obreshkov(6, 0.01)
    with pytest.raises(jn.errors.MechanismError, match="did you mean 'taylor'"):
        jn.integrate.method_named("tayler")
    jn.integrate.register_method("coarse", lambda step: jn.Obreshkov(4, step or 0.1))
    assert jn.integrate.method_named("coarse") == jn.Obreshkov(4, 0.1)
