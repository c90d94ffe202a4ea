"""Which programs a Taylor series cannot overlook anything of."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce.integrate.steps.exact_programs import is_plain, radicands_and_denominators, uses


@pytest.mark.parametrize(
    "function, plain",
    [
        (lambda x, y: x * x * y - jnp.cos(3.0 * x) / 7.0 + 2.0, True),
        (lambda x, y: jnp.stack([x, y]) @ jnp.array([[1.0, 2.0], [3.0, 4.0]]), True),
        (lambda x, y: (x + y) ** 3 * jax.jit(jnp.sin)(y), True),
        (lambda x, y: x + jnp.stack([x, y])[jnp.array([1, 1])].sum(), True),  # of a fixed entry
        (lambda x, y: jnp.stack([x, y])[jnp.array(y, int)], False),  # of an entry that changes
        (lambda x, y: jnp.where(jnp.array(True), x, y), True),
        (lambda x, y: x / y, False),  # a pole may be ahead
        (lambda x, y: (x + y) ** 9, False),  # flat, and then a wall
        (lambda x, y: x - jnp.exp(-y * y), False),
        (lambda x, y: jnp.where(x > 0.0, x, y), False),
        (lambda x, y: jnp.interp(x, jnp.array([0.0, 1.0, 2.0]), jnp.array([0.0, 0.0, 1.0])) + y, False),
        (lambda x, y: jnp.sqrt(x * x + y * y), False),
        (lambda x, y: x + jnp.exp(jnp.array(2.0)) * y, True),  # of numbers alone
    ],
)
def test_sums_products_and_waves_are_plain(function, plain):
    assert is_plain(jax.make_jaxpr(function)(jnp.array(1.0), jnp.array(2.0))) is plain


def test_what_does_not_enter_is_not_used():
    def use(function):
        return uses(jax.make_jaxpr(function)(jnp.array(1.0)))

    assert use(lambda t: jnp.exp(-t))
    assert use(lambda t: 0.5 * t)
    assert not use(lambda t: jnp.zeros_like(t) + 3.0)


@pytest.mark.parametrize(
    "function, divisors",
    [
        (lambda x, y: x * y, []),
        (lambda x, y: y / jnp.sqrt(x * x + y * y), [5.0, math.sqrt(5.0)]),
        (lambda x, y: jax.jit(jnp.sqrt)(x) / 2.0, [1.0]),  # a number divides, which is not zero
        (lambda x, y: 1.0 / (x - y) ** 2, [1.0]),
    ],
)
def test_radicands_and_denominators_are_found(function, divisors):
    found = radicands_and_denominators(function, jnp.array(1.0), jnp.array(2.0))
    np.testing.assert_allclose(np.array(found, float), divisors)


@pytest.mark.parametrize(
    "function", [lambda x: jnp.exp(-x), lambda x: jnp.tanh(x) / x, lambda x: jnp.abs(x), lambda x: x**20, jnp.arctan]
)
def test_what_may_hide_a_pulse_has_no_list_of_them(function):
    assert radicands_and_denominators(function, jnp.array(1.0)) is None
