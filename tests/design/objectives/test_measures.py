"""Numbers of quantities that change in time, from their series: against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

from jounce.design.objectives.measures import Cells, at_instants, gaps, integral, largest, square, value

TIME = np.linspace(0.0, 2.0, 41)
ORDER = 9


def sine(time):
    """Taylor coefficients of sin(3 t) about each instant."""
    rows = [3.0**k * np.sin(3.0 * time + k * np.pi / 2) / np.prod(np.arange(1.0, k + 1)) for k in range(ORDER + 1)]
    return jnp.asarray(np.stack(rows))


def test_the_largest_value_is_that_between_instants():
    cells = Cells.of(TIME)
    assert float(jnp.max(largest(sine(TIME), cells))) == pytest.approx(1.0, abs=1e-14)
    assert np.abs(np.sin(3 * TIME)).max() < 1 - 1e-4  # no instant is there


@pytest.mark.slow
def test_a_window_ends_where_it_is_said_to():
    cells = Cells.of(TIME, 0.61, 1.03)
    assert float(jnp.max(largest(sine(TIME), cells))) == pytest.approx(np.sin(3 * 0.61), abs=1e-14)
    assert float(integral(sine(TIME), cells)) == pytest.approx((np.cos(1.83) - np.cos(3.09)) / 3, abs=1e-14)
    exact = (1.03 - 0.61) / 2 - (np.sin(6 * 1.03) - np.sin(6 * 0.61)) / 12
    assert float(integral(square(sine(TIME)), cells)) == pytest.approx(exact, abs=1e-13)


def test_a_window_within_one_cell_is_no_other():
    cells = Cells.of(TIME, 0.501, 0.502)
    assert float(jnp.max(largest(sine(TIME), cells))) == pytest.approx(np.sin(3 * 0.502), abs=1e-14)


@pytest.mark.slow
def test_no_series_goes_on_beyond_a_knot():
    """A rate of 1 - t from a knot on, and of zero before it: it is largest at the knot, and half of it in the mean."""
    knots = np.array([0.5])
    time = at_instants([0.5, 0.9], TIME / 2, knots)
    assert np.count_nonzero(np.abs(time - 0.5) < 1e-9) == 2  # asked for, of the grid, and a knot: its two sides
    series = jnp.asarray(np.stack([np.where(time >= 0.5, 1.0 - time, 0.0), np.where(time >= 0.5, -1.0, 0.0)]))
    cells = Cells.of(time)
    assert float(jnp.max(largest(series, cells))) == pytest.approx(0.5, abs=1e-12)
    assert float(integral(series, cells)) == pytest.approx(0.125, abs=1e-12)
    assert float(jnp.max(largest(series, Cells.of(time, 0.0, 0.5)))) == 0.0
    assert float(jnp.max(largest(-series, Cells.of(time, 0.5, 1.0)))) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_points_are_compared_with_the_nearest_place_of_a_path_or_with_that_at_their_times():
    series = jnp.stack([sine(TIME + np.pi / 6), sine(TIME)], axis=1)  # a circle of radius 1
    points = np.array([[1.2, 0.0], [0.0, 0.5], [-2.0, 2.0]])
    cells = Cells.of(TIME)
    apart = np.linalg.norm(np.asarray(gaps(series, points, None, cells)), axis=0)
    assert apart == pytest.approx([0.2, 0.5, np.sqrt(8) - 1], abs=1e-13)
    times = np.array([0.111, 1.0, 1.777])
    timed = np.asarray(gaps(series, points, times, cells))
    assert timed == pytest.approx(np.stack([np.cos(3 * times), np.sin(3 * times)]) - points.T, abs=1e-13)


def test_series_are_evaluated_at_shifts():
    assert np.asarray(value(sine(TIME), 0.01)) == pytest.approx(np.sin(3 * (TIME + 0.01)), abs=1e-14)
