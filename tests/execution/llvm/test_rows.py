"""Arrays with the instants along the first axis, and sorts: NumPy's numbers, for any number of instants and threads."""

import jax.numpy as jnp
import numpy as np
import pytest

from jounce.execution.llvm.self_test import is_usable
from jounce.execution.mapped import Mapped, OnLlvm

pytestmark = pytest.mark.skipif(not is_usable(), reason="there is no compiler, or a system where it was not tried")


def of_all_kinds(shared, lanes):
    a, b, c, d = lanes
    return a * shared, b[::-1] + shared, c == 1, d * 2, a[0], jnp.ones((9, 1)), jnp.zeros((0, 1))


ROWS = Mapped(of_all_kinds, rows=True)


@pytest.mark.parametrize("threads", [1, 2, 3, 5])
@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 9, 15, 16, 17, 100])
def test_rows_are_read_and_written(count, threads):
    generator = np.random.default_rng(count)
    a, b = generator.normal(size=(count, 5, 7)), generator.normal(size=(count, 3))
    c, d = generator.integers(0, 3, (count, 9)), generator.integers(0, 3, (count, 2)).astype(np.int32)
    program = ROWS.program(np.float64(3.0), (a, b, c, d))
    assert isinstance(program, OnLlvm)
    expected = a * 3, b[:, ::-1] + 3, c == 1, d * 2, a[:, 0], np.ones((count, 9)), np.zeros((count, 0))
    for x, y in zip(program((a, b, c, d), threads), expected, strict=True):
        assert x.dtype == y.dtype
        assert np.array_equal(x, y)


@pytest.mark.parametrize("size", [1, 2, 5, 9])
def test_sorts_are_those_of_jax(size):
    x = np.random.default_rng(size).normal(size=(50, size)).round(1)
    x[::3, -1] = np.nan
    program = Mapped(lambda _, x: (jnp.sort(x, axis=0), jnp.argsort(x, axis=0)), rows=True).program(0.0, x)
    assert isinstance(program, OnLlvm)
    for found, expected in zip(program(x), (jnp.sort(x, axis=1), jnp.argsort(x, axis=1)), strict=True):
        assert np.array_equal(found, expected, equal_nan=True)
