"""Elementary functions of jets against mpmath to order 12, at ordinary values and where naive formulas lose digits."""

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from mpmath import mp

import jounce as jn
from jounce import jet
from tests.oracles.mp_series import Series, atan2 as reference_atan2, log as reference_log
from tests.oracles.mp_taylor import DIGITS, composed, worst

ORDER = 12
ROUNDING = 1e-14  # of the natural scale of each coefficient

ENTIRE = {
    "sin": (jet.sin, mp.sin, [0.0, 1.0, np.pi, 1e5, 1e15, -1e-9, 1e-300]),
    "cos": (jet.cos, mp.cos, [0.0, np.pi / 2, 1e5, -1e-9]),
    "exp": (jet.exp, mp.exp, [0.0, -700.0, 700.0, 1e-12]),
    "sinh": (jet.sinh, mp.sinh, [0.0, 1.0, -20.0, 700.0, 1e-9]),
    "cosh": (jet.cosh, mp.cosh, [0.0, 1.0, -20.0, 700.0, 1e-9]),
    "tanh": (jet.tanh, mp.tanh, [0.0, 1e-9, 1.0, -5.0, 18.0, 20.0, -40.0, 300.0]),
    "tan": (jet.tan, mp.tan, [0.0, 1e-9, 1.0, 1.57, -1.5707, 100.0]),
    "atan": (jet.atan, mp.atan, [0.0, 1e-9, 1.0, -1e5, 1e100]),
    "asinh": (jet.asinh, mp.asinh, [0.0, 1e-9, 1.0, -1e5]),
    "acosh": (jet.acosh, mp.acosh, [2.0, 1e5]),
    "expm1": (jet.expm1, mp.expm1, [0.0, 1e-12, -30.0, 600.0]),
    "log1p": (jet.log1p, mp.log1p, [0.0, 1e-12, 1e5]),
    "erf": (jet.erf, mp.erf, [0.0, 1e-9, 1.0, -3.0]),
    "square": (lambda x: x**2, 2, [0.0, 1e-9, -3.0]),
    "seventh_power": (lambda x: x**7, 7, [0.0, 1e-3, -2.0]),
    "zeroth_power": (lambda x: x**0, 0, [0.0, 2.0]),
    "exponential_of_base_2": (lambda x: 2.0**x, lambda x: mp.mpf(2) ** x, [0.0, -30.0, 1e-5]),
    "power_of_itself": (lambda x: x**x, lambda x: x**x, [0.5, 1.0, 3.0]),
}
SCALE_FREE = {  # the other coefficients are as large as the value: radius of convergence and value go together
    "log": (jet.log, mp.log, [1.0, 1 + 1e-10, 1e-20, 1e200]),
    "sqrt": (jet.sqrt, 0.5, [1.0, 2.0, 1e-200, 1e200]),
    "cbrt": (jet.cbrt, 1 / 3, [1.0, 1e-30, 1e30]),
    "cbrt_of_negative": (jet.cbrt, lambda x: -mp.cbrt(-x), [-8.0]),
    "half_power": (lambda x: x**0.5, 0.5, [2.0]),
    "real_power": (lambda x: x**1.7, 1.7, [1.0, 1e-100, 1e100]),
    "negative_real_power": (lambda x: x**-0.3, -0.3, [1.0, 1e-100, 1e100]),
    "cube": (lambda x: x**3, 3, [1e-90, -2.0, 1e90]),
    "inverse_square": (lambda x: x**-2, -2, [1e-100, 1.0, -2.0, 1e100]),
    "reciprocal": (lambda x: 1 / x, -1, [1.0, -1e-200, 1e200]),
    "array_power": (lambda x: x ** jnp.asarray(1.7), 1.7, [1.0, 1e-50, 1e50]),
}
NEAR_ENDS = [0.0, 1e-12, 0.5, 1 - 1e-10, -1 + 1e-6, 1 - 1e-15]


@pytest.fixture(autouse=True)
def _many_digits():
    with mp.workdps(DIGITS):
        yield


def points(table):
    return [pytest.param(*row[:2], x, id=f"{name}({x:.3g})") for name, row in table.items() for x in row[2]]


def tails(size):
    """Higher coefficients of an argument: those of time itself, and arbitrary ones."""
    random = np.random.default_rng(7).uniform(-0.5, 0.5, ORDER)
    return size * np.eye(1, ORDER)[0], size * random


def jet_of(coefficients):
    return jn.Jet(jnp.asarray(c) for c in coefficients)


def check(function, reference, coefficients):
    values, scale = composed(reference, coefficients)
    result = function(jet_of(coefficients))
    assert result.order == ORDER
    assert worst(result.dense().coefficients, values, scale) < ROUNDING


@pytest.mark.parametrize("function, reference, x", points(ENTIRE))
def test_function_against_mpmath(function, reference, x):
    for tail in tails(1.0):
        check(function, reference, [x, *tail])


@pytest.mark.parametrize("function, reference, x", points(SCALE_FREE))
def test_scale_free_function_against_mpmath(function, reference, x):
    for tail in tails(0.5 * abs(x)):
        check(function, reference, [x, *tail])


@pytest.mark.parametrize("x", NEAR_ENDS)
@pytest.mark.parametrize(
    "function, reference",
    [(jet.asin, mp.asin), (jet.acos, mp.acos), (jet.atanh, mp.atanh)],
    ids=["asin", "acos", "atanh"],
)
def test_inverse_functions_up_to_their_ends(function, reference, x):
    for tail in tails(min(1.0, 0.5 * (1 - abs(x)))):
        check(function, reference, [x, *tail])


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.0, 3.0, 12.0])
def test_whole_power_given_as_an_array_at_zero(exponent):
    """A parameter of a motion law is an array: ``t**n`` must not fail at t = 0."""
    for x in (0.0, 1e-9):
        for tail in tails(1.0):
            check(lambda x: x ** jnp.asarray(exponent), int(exponent), [x, *tail])


@pytest.mark.parametrize("exponent", [4.5, 2.5, 0.5, -0.5, -2.0])
def test_power_of_zero_with_an_exponent_that_is_an_array(exponent):
    """Where the power of time has a derivative at t = 0, it is zero; where it has none, no number is made up."""
    found = np.array((jn.Jet.variable(jnp.array([0.0, 4.0]), 3) ** jnp.asarray(exponent)).derivatives())
    factors = np.cumprod([1.0, *(exponent - np.arange(3.0))])
    np.testing.assert_allclose(found[:, 1], factors * 4.0 ** (exponent - np.arange(4)), rtol=1e-14)
    assert found[0, 0] == 0 if exponent > 0 else np.isnan(found[0, 0])
    assert not found[:, 0].any() if exponent > 3 else np.isnan(found[3, 0])


ANGLES = [
    (1.0, 1.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (1.0, 0.0),
    (-1.0, 0.0),
    (3.0, -4.0),
    (1e200, 1e200),
    (1e-200, -1e-200),
    (1e-200, 1.0),
    (1.0, 1e-200),
    (1e300, -1e300),
    (1e-160, 1e160),
    (-1.0, 1e-17),
    (-1.0, -1e-17),
]


@pytest.mark.parametrize("x, y", ANGLES)
def test_atan2_against_mpmath(x, y):
    generator = np.random.default_rng(3)
    for size in (1.0, 1e-3):
        xs, ys = ([first, *generator.uniform(-1, 1, ORDER) * size * max(abs(x), abs(y))] for first in (x, y))
        result = jet.atan2(jet_of(ys), jet_of(xs))
        truth = reference_atan2(Series(map(mp.mpf, ys)), Series(map(mp.mpf, xs))).c
        distance = mp.hypot(x, y)
        growth = [(abs(mp.mpf(a)) + abs(mp.mpf(b))) / distance for a, b in zip(xs[1:], ys[1:], strict=True)]
        scale = [-c for c in reference_log(Series([mp.mpf(1), *(-g for g in growth)])).c]  # a majorant of the series
        scale[0] = abs(truth[0])
        assert worst(result.dense().coefficients, truth, scale) < ROUNDING


def test_atan2_takes_a_jet_and_a_number():
    t = jn.Jet.variable(0.3, ORDER)
    above, beside = jet.atan2(t, 2.0), jet.atan2(2.0, t)
    np.testing.assert_allclose((above + beside).derivatives(), [np.pi / 2] + [0.0] * ORDER, atol=1e-13)
    np.testing.assert_allclose(above.derivatives(), jet.atan(t / 2.0).derivatives(), rtol=1e-13, atol=1e-13)


def test_atan2_is_in_its_interval_at_the_cut():
    still = jnp.zeros(())
    assert float(jet.atan2(jn.Jet([still]), jn.Jet([still - 1])).coefficients[0]) == np.pi


def test_absolute_value():
    x = jet_of([-2.0, 1.0, 3.0])
    np.testing.assert_array_equal(jet.abs(x).coefficients, [2.0, -1.0, -3.0])
    np.testing.assert_array_equal(jet.abs(-x).coefficients, [2.0, -1.0, -3.0])
    np.testing.assert_array_equal(jet.abs(jet_of([0.0, 1.0])).coefficients, [0.0, 1.0])


UNARY = "sin cos tan asin acos atan sinh cosh tanh asinh exp expm1 log log1p sqrt cbrt erf abs".split()


@pytest.mark.parametrize("name", UNARY)
def test_functions_take_numbers_and_arrays(name):
    function, reference = getattr(jet, name), getattr(mpmath, {"abs": "fabs"}.get(name, name))
    assert float(function(0.4)) == pytest.approx(float(reference(0.4)), rel=1e-15)
    np.testing.assert_allclose(function(jnp.full(3, 0.4)), float(reference(0.4)), rtol=1e-15)
    assert float(function(jn.Jet.variable(0.4, 0)).coefficients[0]) == pytest.approx(float(reference(0.4)), rel=1e-15)


@pytest.mark.parametrize("name", UNARY)
def test_lower_orders_are_the_same(name):
    """The coefficients of a jet do not depend on its order."""
    function, x = getattr(jet, name), jet_of([0.3, 0.5, -0.2, 0.7])
    for order in range(3):
        shorter, longer = function(x.truncate(order)), function(x).truncate(order)
        np.testing.assert_array_equal(shorter.dense().coefficients, longer.dense().coefficients)
