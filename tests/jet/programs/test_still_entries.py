"""Constant entries of a differential equation, and series without their products."""

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.jax_internals import by_certain_entries
from jounce.jet import cross
from jounce.jet.programs.series import Recursion
from jounce.jet.programs.still_entries import still_entries

ORDER = 5


def turning(axis, vector, rate):
    """Return the rate of a vector that turns about an axis, and the axis itself."""
    with by_certain_entries():
        spin = axis * rate
        return cross(spin, axis), cross(spin, vector), rate * rate


def still(axis, vector):
    return still_entries(lambda _, *given: turning(*given), (), (axis, vector, np.full((1, 1), np.nan)), (0, 1, -1))


def column(*numbers):
    return np.array(numbers, float)[:, None]


def test_a_turn_about_a_coordinate_axis_keeps_that_axis_and_what_is_along_it():
    found = still(column(0, 0, 1), np.full((3, 1), np.nan))
    assert [x[:, 0].tolist() for x in found.given] == [[True] * 3, [False, False, True], [False]]


def test_what_is_not_known_may_change():
    found = still(column(0, np.nan, np.nan), np.full((3, 1), np.nan))
    assert [x[:, 0].tolist() for x in found.given] == [[False] * 3, [False] * 3, [False]]


def marched(axis, vector, entries):
    """Return the series of the axis and of the vector, which turns at the rate 1 + t."""

    def run(axis, vector):
        values = axis, vector, jnp.ones((1, 1))
        recursion = Recursion(turning, values, ORDER, still=entries)
        history, now, series = recursion.history, recursion.outputs, [values[:2]]
        for k in range(1, ORDER + 1):
            now = [now[0] / k, now[1] / k]
            series.append(tuple(now))
            rate = jnp.full((1, 1), float(k == 1))
            now, newest = recursion.advanced(history, k, (*now, rate))
            history = recursion.noted(history, k, newest)
        return jax.tree.map(lambda *x: jnp.stack(x), *series)

    return jax.tree.map(np.asarray, jax.jit(run)(axis, vector))


def test_series_are_the_same_without_the_products_of_what_does_not_change():
    axis, vector = column(0, 0, 1), column(0.3, -0.7, 0.2)
    found = marched(axis, vector, still(axis, np.full((3, 1), np.nan)))
    for a, b in zip(found, marched(axis, vector, None), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-15, atol=1e-16)
    # x + i y turns by t + t^2/2: the first coefficients of exp(i (t + t^2/2)) are 1, i, (i - 1)/2
    turned = (found[1][:, 0, 0] + 1j * found[1][:, 1, 0]) / (0.3 - 0.7j)
    np.testing.assert_allclose(turned[:3], [1, 1j, 0.5j - 0.5], rtol=1e-14)


def test_entries_of_another_program_are_not_used():
    axis, vector = column(0, 0, 1), column(0.3, -0.7, 0.2)
    entries = still(axis, np.full((3, 1), np.nan))
    skew = column(0.6, 0, 0.8)
    assert Recursion(turning, (axis, vector, np.ones((1, 1))), 2, still=entries).uses_still
    other = Recursion(lambda a, v, r: turning(a, v + a, r), (skew, vector, np.ones((1, 1))), 2, still=entries)
    assert not other.uses_still
