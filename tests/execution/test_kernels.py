"""Loops compiled as one function: the same numbers, and only where XLA can."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jounce.execution import kernels
from jounce.execution.compilation import compiled

MARK = "xla_cpu_small_call"


def halved(body, **limits):
    """Return a loop that goes on until its value, which `body` halves, is small."""

    def loop(x):
        return jax.lax.while_loop(lambda x: jnp.max(x) > 1e-3, body, x)

    return lambda x: kernels.in_one_piece(loop, x, **limits)


def marked(function, x) -> bool:
    return MARK in jax.jit(function).lower(x).as_text()


@pytest.fixture
def tried(monkeypatch):
    """As if this release of XLA were known."""
    monkeypatch.setattr(kernels, "_tried", lambda: True)


@pytest.mark.parametrize("size", [1, 3, 90])
def test_sums_of_every_size_are_those_of_numpy(size):
    matrix = np.random.default_rng(1).normal(size=(size, size, 1))
    matrix /= 2.0 * np.linalg.norm(matrix[..., 0], 2)

    def body(carry):
        x, count = carry
        return jnp.sum(matrix * x[None], axis=1), count + 1

    @compiled(without=kernels.LIBRARIES)
    def found(x):
        return kernels.in_one_piece(lambda c: jax.lax.while_loop(lambda c: c[1] < 5, body, c), (x, 0))

    start = np.ones((size, 1))
    np.testing.assert_allclose(found(start)[0], np.linalg.matrix_power(matrix[..., 0], 5) @ start, atol=1e-16)


def test_operations_on_many_numbers_are_not_shared_among_threads():
    @compiled(without=kernels.LIBRARIES)
    def found(x):
        return kernels.in_one_piece(lambda x: jnp.sin(x) * jnp.exp(x), x)

    x = np.linspace(-1.0, 1.0, 500_000)  # XLA would share them among the cores, by a function that is out of reach
    np.testing.assert_allclose(found(x), np.sin(x) * np.exp(x), rtol=1e-14)


def test_small_loops_are_marked(tried):
    assert marked(halved(lambda x: 0.5 * jnp.sin(x)), jnp.ones(3))


@pytest.mark.parametrize(
    "body",
    [
        lambda x: 0.5 * jnp.eye(3) @ x,
        lambda x: 0.5 * jnp.sort(x),
        lambda x: 0.5 * jnp.zeros(3).at[jnp.array([2, 0, 1])].add(x),
        lambda x: jax.lax.fori_loop(0, 2, lambda i, y: 0.5 * jnp.eye(3) @ y, x),
    ],
)
def test_loops_for_which_a_library_is_called_are_not(tried, body):
    assert not marked(halved(body), jnp.ones(3))


@pytest.mark.parametrize("largest", [0, 3])
def test_large_loops_are_not(tried, largest):
    assert not marked(halved(lambda x: 0.5 * jnp.sin(x) + 0.1 * x, largest=largest), jnp.ones(3))


def test_nothing_is_marked_for_releases_that_were_not_tried(monkeypatch):
    monkeypatch.setattr(kernels, "TRIED", (0, 1))
    assert not marked(halved(lambda x: 0.5 * jnp.sin(x)), jnp.ones(3))


def test_all_that_is_given_is_one_argument_which_is_used(tried):
    """XLA ends the process over an argument that is without effect, as it does not find its memory."""

    def loop(argument):
        x, _, steps, going = argument
        return jax.lax.while_loop(lambda c: going & (c[1] < steps), lambda c: (0.5 * c[0] + 1.0, c[1] + 1), (x, 0))

    def function(x):
        return kernels.in_one_piece(loop, (x, jnp.full((7, 1), 3.0) * x[0], jnp.int32(40), jnp.bool_(True)))

    found = compiled(without=kernels.LIBRARIES)(function)
    (begin,) = re.findall(r"func.func private @whole\((.*?)\) ->", jax.jit(function).lower(np.ones(3)).as_text())
    assert begin == "%arg0: tensor<12xf64>"
    result, count = found(np.array([0.0, 1.0, 5.0]))
    np.testing.assert_allclose(result, 2.0, rtol=1e-11)
    assert count == 40
    assert count.dtype == int
