"""Identities of the algebra of jets, on arbitrary jets; transformations by JAX; errors."""

import math

import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

import jounce as jn
from jounce import jet

ORDER = 8
NUMBERS = st.floats(-2, 2).map(lambda x: 0.0 if abs(x) < 1e-6 else x)


def jets(first=NUMBERS, order=ORDER):
    """Jets of a scalar with some coefficients absent, which stand for zero."""
    rest = st.lists(st.one_of(st.none(), NUMBERS), min_size=order, max_size=order)
    return st.tuples(first, rest).map(
        lambda c: jn.Jet([jnp.asarray(c[0]), *(None if x is None else jnp.asarray(x) for x in c[1])])
    )


NONZERO = st.one_of(st.floats(0.8, 3), st.floats(-3, -0.8))
POSITIVE = st.floats(0.8, 3)


def magnitude(*operands):
    """Coefficients of the product of the magnitudes of the operands, to which rounding is proportional."""
    size = np.eye(1, ORDER + 1)[0]
    for x in operands:
        size = np.convolve(size, np.abs(np.array(x.dense().coefficients)))[: ORDER + 1]
    return size


def inverse_magnitude(x):
    """The same for 1 / x, whose magnitudes solve the recurrence of division with equal signs."""
    c, out = np.abs(np.array(x.dense().coefficients)), []
    for k in range(ORDER + 1):
        out.append(((k == 0) + sum(c[j] * out[k - j] for j in range(1, k + 1))) / c[0])
    return np.array(out)


def assert_same(a, b, scale, rounding=1e-14):
    a, b = (np.array(x.dense().coefficients if isinstance(x, jn.Jet) else x) for x in (a, b))
    assert np.all(np.abs(a - b) <= rounding * np.asarray(scale)), (a, b)


@given(jets(), jets(), jets())
def test_ring(a, b, c):
    assert_same(a + b, b + a, 0)
    assert_same(a * b, b * a, magnitude(a, b))
    assert_same(a * (b + c), a * b + a * c, magnitude(a, b) + magnitude(a, c))
    assert_same((a * b) * c, a * (b * c), magnitude(a, b, c))
    assert_same(a - b, -(b - a), 0)
    assert_same(a - a, np.zeros(ORDER + 1), 0)
    assert_same(a * a, a.square(), 0)
    assert_same(a.square(), a * (a + 0.0), magnitude(a, a))
    assert_same(+a, a, 0)


@given(jets(), jets(NONZERO))
def test_division_undoes_multiplication(a, b):
    scale = np.convolve(magnitude(a, b), inverse_magnitude(b))[: ORDER + 1]
    assert_same((a * b) / b, a, scale)
    scale = np.convolve(magnitude(b), inverse_magnitude(b))[: ORDER + 1]
    assert_same(b / b, np.eye(1, ORDER + 1)[0], scale)
    assert_same(1.0 / b * a, a / b, np.convolve(magnitude(a), inverse_magnitude(b))[: ORDER + 1])


@given(jets(), jets())
def test_leibniz_rule_for_all_orders(a, b):
    x, y = np.array(a.derivatives()), np.array(b.derivatives())
    expected = [sum(math.comb(n, k) * x[k] * y[n - k] for k in range(n + 1)) for n in range(ORDER + 1)]
    factorials = np.array([float(math.factorial(k)) for k in range(ORDER + 1)])
    np.testing.assert_allclose((a * b).derivatives() / factorials, np.array(expected) / factorials, atol=1e-13)


@given(jets(), jets())
def test_product_rule(a, b):
    lower = (a.differentiate() * b).dense() + (a * b.differentiate()).dense()
    assert_same((a * b).differentiate(), lower, ORDER * magnitude(a, b)[1:])


@given(jets())
def test_differentiation_undoes_integration(a):
    assert a.integrate(1.0).order == ORDER + 1
    assert float(a.integrate(jnp.asarray(1.5)).coefficients[0]) == 1.5
    assert_same(a.integrate(jnp.asarray(1.5)).differentiate(), a, magnitude(a))
    assert_same(a.differentiate().integrate(a.coefficients[0]), a, magnitude(a))


@given(jets(st.floats(-10, 10)))
def test_sine_and_cosine(x):
    s, c = jet.sin(x), jet.cos(x)
    scale = np.convolve(exponential_magnitude(x), exponential_magnitude(x))[: ORDER + 1]
    assert_same(s * s + c * c, np.eye(1, ORDER + 1)[0], scale)
    np.testing.assert_allclose(
        s.differentiate().dense().coefficients, (c * x.differentiate()).dense().coefficients, atol=1e-12 * scale.max()
    )


def exponential_magnitude(x):
    """Majorant of exp(i x): the exponential of the magnitudes of all coefficients but the first."""
    c, out = np.abs(np.array(x.dense().coefficients)), [1.0]
    for k in range(1, ORDER + 1):
        out.append(sum(j * c[j] * out[k - j] for j in range(1, k + 1)) / k)
    return np.array(out)


@given(jets(POSITIVE))
def test_exponential_of_logarithm(x):
    growth = inverse_magnitude(x)
    scale = np.convolve(np.convolve(growth, growth), magnitude(x))[: ORDER + 1]
    assert_same(jet.exp(jet.log(x)), x, scale * 10)
    assert_same(jet.sqrt(x).square(), x, scale * 10)


@given(jets(NONZERO))
def test_root_of_square_is_absolute_value(x):
    growth = inverse_magnitude(x)
    scale = np.convolve(np.convolve(growth, growth), magnitude(x, x))[: ORDER + 1]
    assert_same((x**2) ** 0.5, jet.abs(x), scale * 10)


@given(jets(st.floats(-1.4, 1.4)))
def test_tangent_is_sine_over_cosine(x):
    c = jet.cos(x)
    scale = np.convolve(exponential_magnitude(x), inverse_magnitude(c))[: ORDER + 1]
    assert_same(jet.tan(x), jet.sin(x) / c, scale * 100)


@given(jets(st.floats(-3, 3)), jets(st.floats(0.5, 2)))
def test_atan2_undoes_polar_coordinates(angle, radius):
    found = jet.atan2(radius * jet.sin(angle), radius * jet.cos(angle))
    scale = np.convolve(np.convolve(exponential_magnitude(angle), magnitude(radius)), inverse_magnitude(radius))
    assert_same(found, angle, 1e2 * np.convolve(scale, scale)[: ORDER + 1])


@given(jets(), st.floats(-0.3, 0.3))
def test_evaluation_is_the_taylor_polynomial(x, step):
    assert float(x.evaluate(step)) == pytest.approx(
        float(np.polyval(np.array(x.dense().coefficients)[::-1], step)), abs=1e-14
    )


def test_evaluation_predicts_a_function():
    t = jn.Jet.variable(0.7, 12)
    assert float(jet.sin(t).evaluate(0.1)) == pytest.approx(math.sin(0.8), abs=1e-15)
    steps = jnp.linspace(-0.1, 0.1, 5)
    many = jet.sin(jn.Jet.variable(jnp.full(5, 0.7), 12)).evaluate(steps)
    np.testing.assert_allclose(many, np.sin(0.7 + np.array(steps)), rtol=1e-15)


@given(jets())
def test_derivatives_and_back(x):
    assert_same(jn.Jet.from_derivatives(x.derivatives()), x, magnitude(x))
    assert x.derivatives().shape == (ORDER + 1,)


def test_variable_and_constant():
    np.testing.assert_array_equal(jn.Jet.variable(2.0, 3).derivatives(), [2.0, 1.0, 0.0, 0.0])
    np.testing.assert_array_equal(jn.Jet.constant(2.0, 3).derivatives(), [2.0, 0.0, 0.0, 0.0])
    assert jn.Jet.variable(2.0, 0).order == 0
    assert jn.Jet.constant(jnp.ones((2, 3)), 1).shape == (2, 3)


@pytest.mark.parametrize("order", [0, 1, 5])
def test_truncation(order):
    x = jn.Jet(jnp.asarray(float(k)) for k in range(6))
    np.testing.assert_array_equal(x.truncate(order).coefficients, np.arange(order + 1.0))
    assert x.truncate(99).order == 5


@pytest.mark.parametrize("order", [0, 2])
def test_shorter_jet_sets_the_order(order):
    long, short = jn.Jet.variable(2.0, 5), jn.Jet.variable(3.0, order)
    for result in (long + short, short - long, long * short, short / long, long / short, jet.atan2(short, long)):
        assert result.order == order


@pytest.mark.parametrize("left", [np.arange(1.0, 4.0), jnp.arange(1.0, 4.0)], ids=["numpy", "jax"])
def test_arrays_on_either_side(left):
    """A constant array meets a jet of scalars: every coefficient takes the larger shape."""
    t = jn.Jet.variable(jnp.asarray(2.0), 2)
    for result, expected in [
        (left + t, [[3, 4, 5], [1, 1, 1], [0, 0, 0]]),
        (left - t, [[-1, 0, 1], [-1, -1, -1], [0, 0, 0]]),
        (t - left, [[1, 0, -1], [1, 1, 1], [0, 0, 0]]),
        (left * t, [[2, 4, 6], [1, 2, 3], [0, 0, 0]]),
        (t / left, [[2, 1, 2 / 3], [1, 0.5, 1 / 3], [0, 0, 0]]),
        (left / t, [[0.5, 1, 1.5], [-0.25, -0.5, -0.75], [0.125, 0.25, 0.375]]),
    ]:
        np.testing.assert_allclose(result.dense().coefficients, expected, rtol=1e-15)


def test_ranks_meet_at_the_trailing_axes():
    vector = jn.Jet([jnp.ones((3, 4)), jnp.ones((3, 4))])
    scalar = jn.Jet([jnp.arange(4.0), jnp.ones(4)])
    assert (vector * scalar).shape == (3, 4)
    np.testing.assert_array_equal((scalar * vector).coefficients[1], np.tile(np.arange(4.0) + 1, (3, 1)))


def test_indexing_and_iteration():
    x = jn.Jet([jnp.arange(6.0).reshape(3, 2), None, jnp.ones((3, 2))])
    assert x[1].shape == (2,)
    np.testing.assert_array_equal(x[1:, 0].dense().coefficients, [[2, 4], [0, 0], [1, 1]])
    assert len(list(x)) == 3


def law(t):
    return jet.exp(-0.5 * t) * jet.sin(3.0 * t) / (1.0 + t**2) + jet.tanh(t)


def test_jit_gives_the_same():
    t = jn.Jet.variable(jnp.asarray(0.4), 6)
    np.testing.assert_allclose(jax.jit(law)(t).derivatives(), law(t).derivatives(), rtol=1e-13)


def test_vmap_gives_the_same_as_a_batch():
    instants = jnp.linspace(0.1, 1.0, 4)
    batch = law(jn.Jet.variable(instants, 5)).derivatives()
    mapped = jax.vmap(lambda t: law(jn.Jet.variable(t, 5)).derivatives(), out_axes=1)(instants)
    np.testing.assert_allclose(mapped, batch, rtol=1e-13)


def test_jets_pass_through_vmap_as_pytrees():
    instants = jnp.linspace(0.1, 1.0, 4)
    np.testing.assert_allclose(
        jax.vmap(lambda t: t * t)(jn.Jet.variable(instants, 2)).dense().coefficients,
        (jn.Jet.variable(instants, 2) ** 2).dense().coefficients,
    )


@pytest.mark.parametrize("k", range(6))
def test_gradient_of_a_derivative_is_the_next_derivative(k):
    """d/dt of f^(k)(t), found by reverse mode through the recurrences, is f^(k+1)(t)."""
    gradient = jax.grad(lambda t: law(jn.Jet.variable(t, k)).derivatives()[k])(0.4)
    assert float(gradient) == pytest.approx(float(law(jn.Jet.variable(0.4, k + 1)).derivatives()[k + 1]), rel=1e-11)


def test_jet_of_no_coefficient():
    with pytest.raises(ValueError, match="at least one coefficient"):
        jn.Jet([])


@pytest.mark.parametrize("derivatives", [np.array([[1.0], [1j]]), [jnp.ones(2), jnp.array([1.0, 1j])]])
def test_derivatives_of_a_jet_are_real(derivatives):
    with pytest.raises(ValueError, match="derivatives must be real numbers"):
        jn.Jet.from_derivatives(derivatives)


def test_jet_of_order_zero_has_no_derivative():
    with pytest.raises(ValueError, match="order 0 carries no derivative"):
        jn.Jet([1.0]).differentiate()


def test_representation_names_order_and_shape():
    assert repr(jn.Jet.variable(jnp.zeros(3), 2)) == "Jet(order=2, shape=(3,))"
