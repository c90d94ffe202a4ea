"""Measures, which reduce a time-dependent quantity to one number: largest value, mean, distance from points.

The Taylor series of a motion about the instants of a grid represent it between the instants as well: each instant has a
cell, up to halfway to its neighbors, in which its series holds. The largest value in a cell is a smooth function of the
design: by the envelope theorem, its slope is that of the value at the fixed instant.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers
from jounce.jet import Jet
from jounce.trajectory.law_checks.breaks import with_sides

SAMPLES = 9  # samples of a cell in the search for its largest value
ROUNDS = 6  # of Newton's method from the best sample

NO_KNOTS = np.zeros(0)
NEAR = 1e-9  # fraction of the duration: instants nearer to each other coincide

Series = Float[Numbers, "order *cell"]
"""Taylor coefficients about the instants of a grid."""


@dataclasses.dataclass(frozen=True, eq=False)
class Cells:
    """The intervals of time in which the series about the instants hold.

    Parameters
    ----------
    instants : array of shape (time,)
        Instants, s.
    index : array of int of shape (cells,)
        Indices of the instants whose cells overlap the window.
    low, high : array of shape (cells,)
        Ends of the cells relative to their instants, s.
    """

    instants: Float[np.ndarray, " time"]
    index: Int[np.ndarray, " cell"]
    low: Float[np.ndarray, " cell"]
    high: Float[np.ndarray, " cell"]

    @classmethod
    def of(
        cls,
        instants: Float[np.ndarray, " time"],
        start: float | None = None,
        stop: float | None = None,
    ) -> "Cells":
        """Return the cells of a grid within a window, by default the whole grid.

        The cells of the two instants on both sides of a knot of a motion law meet at the knot.
        """
        middles, pairs = (instants[1:] + instants[:-1]) / 2, np.diff(instants) < NEAR * (instants[-1] - instants[0])
        if pairs.any():  # a knot at an end coincides with that end
            middles[0] = instants[0] if pairs[0] else middles[0]
            middles[-1] = instants[-1] if pairs[-1] else middles[-1]
        first, last = instants[0] if start is None else start, instants[-1] if stop is None else stop
        low = np.maximum(np.concatenate([instants[:1], middles]), first)
        high = np.minimum(np.concatenate([middles, instants[-1:]]), last)
        (index,) = np.nonzero((high - low > NEAR * (instants[-1] - instants[0])) | ((high == low) & (first == last)))
        if not index.size:  # a window of one instant where two cells meet
            index = np.array([int(np.argmin(np.abs(instants - first)))])
            low[index] = high[index] = first
        return cls(instants, index, low[index] - instants[index], high[index] - instants[index])

    def at(self, time: float) -> tuple[int, float]:
        """Return the number of the nearest instant, and the distance of a time from it, s."""
        index = int(np.argmin(np.abs(self.instants - time)))
        duration = float(self.instants[-1] - self.instants[0])
        if np.diff(self.instants[index : index + 2]).min(initial=np.inf) < NEAR * duration:  # from the right, at a knot
            index += 1
        return index, float(time - self.instants[index])


def derivative(jet: Jet, order: int) -> Series:
    """Return the Taylor coefficients of a derivative of a quantity, order first."""
    coefficients = jnp.stack(jet.dense().coefficients)
    count = len(coefficients) - order
    scale = np.array([math.factorial(k + order) / math.factorial(k) for k in range(count)])
    return coefficients[order:] * scale[:, None]


def value(series: Series, shift: Any) -> Any:
    """Return the values of series at times relative to their instants."""
    result = jnp.zeros_like(series[-1] * shift)
    for coefficient in series[::-1]:
        result = result * shift + coefficient
    return result


def slope_of(series: Series) -> Float[Numbers, "lower *cell"]:
    """Return the series of the rate."""
    if len(series) == 1:
        return jnp.zeros_like(series)
    return series[1:] * np.arange(1.0, len(series))[:, None]


def top(series: Float[Numbers, "order cell"], cells: Cells) -> Float[Numbers, " cell"]:
    """Return the time, relative to its instant, at which each series is largest in its cell, as a constant for JAX."""
    series = jax.lax.stop_gradient(series)
    fractions = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    width = cells.high - cells.low
    positions = cells.low[None] + fractions * width[None]
    highest = jnp.argmax(value(series[:, None], jnp.asarray(positions)), axis=0)
    spacing = width / (SAMPLES - 1)
    start = jnp.asarray(cells.low) + highest.astype(float) * spacing
    low, high = jnp.maximum(start - spacing, cells.low), jnp.minimum(start + spacing, cells.high)
    rate, bend = slope_of(series), slope_of(slope_of(series))
    shift = start
    for _ in range(ROUNDS):
        curvature = value(bend, shift)
        step = value(rate, shift) / jnp.where(curvature < 0, curvature, -jnp.inf)
        shift = jnp.clip(shift - step, low, high)
    return jnp.where(value(series, shift) >= value(series, start), shift, start)


def largest(series: Float[Numbers, "order time"], cells: Cells) -> Float[Numbers, " cell"]:
    """Return the largest value of each series in its cell."""
    cell_series = series[:, cells.index]
    return value(cell_series, top(cell_series, cells))


def integral(series: Series, cells: Cells) -> Any:
    """Return the integral over all cells."""
    cell_series = series[:, cells.index]
    powers = np.arange(1.0, len(series) + 1)[:, None]
    weights = (cells.high[None] ** powers - cells.low[None] ** powers) / powers
    return jnp.sum(cell_series * weights)


def square(series: Series) -> Series:
    """Return the series of the square, to the same order."""
    orders = range(len(series))
    return jnp.stack(
        [sum((series[j] * series[k - j] for j in range(k + 1)), jnp.zeros_like(series[0])) for k in orders]
    )


def safe_root(square: Any) -> Any:
    """Return a square root with the slope zero, not infinite, at zero."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def gaps(
    series: Float[Numbers, "order component time"],
    points: Float[np.ndarray, "point component"],
    times: Float[np.ndarray, " point"] | None,
    cells: Cells,
) -> Float[Numbers, "component point"]:
    """Return the vectors from points to a point of the motion, at their times or where it is nearest."""
    if times is not None:
        positions = [cells.at(float(time)) for time in times]
        index, shift = np.array([k for k, _ in positions]), np.array([h for _, h in positions])
        values = value(series[:, :, index], jnp.asarray(shift)[None])
        return values - points.T
    constant_series = jax.lax.stop_gradient(series)

    def nearest_instant(point: Any) -> tuple[Any, Any]:
        gap = jnp.concatenate([constant_series[:1] - point[None, :, None], constant_series[1:]])
        squared_distance = sum((square(gap[:, k]) for k in range(1, gap.shape[1])), square(gap[:, 0]))
        shift = top(-squared_distance[:, cells.index], cells)
        distances = value(squared_distance[:, cells.index], shift)
        nearest_index = jnp.argmin(distances)
        return jnp.asarray(cells.index)[nearest_index], shift[nearest_index]

    index, shift = jax.vmap(nearest_instant)(jnp.asarray(points))
    values = value(series[:, :, index], shift[None])
    return values - points.T


@dataclasses.dataclass(frozen=True, eq=False)
class PrescribedPath:
    """Points that a point of a mechanism should pass, at any time or at given times.

    Parameters
    ----------
    points : array of shape (points, components)
        Points, m.
    times : array of shape (points,), optional
        Instant for each point, s; any instant unless given.
    """

    points: Float[np.ndarray, "point component"]
    times: Float[np.ndarray, " point"] | None = None


def environment(
    instants: Float[np.ndarray, " time"], parameters: Mapping[str, Any], series: Mapping[str, Any], order: int
) -> dict[str, Any]:
    """Return the values of names: jets along the grid for time and quantities, numbers for parameters."""
    return {**parameters, "t": Jet.variable(instants, order), **{name: Jet(tuple(x)) for name, x in series.items()}}


def at_instants(
    values: Sequence[float], instants: Float[np.ndarray, " given"], knots: Float[np.ndarray, " knots"] = NO_KNOTS
) -> Float[np.ndarray, " time"]:
    """Return a grid with the instants of measures, and with instants on both sides of the knots of laws."""
    merged = np.unique(np.concatenate([instants, np.asarray(values, float)]))
    gaps = np.diff(merged)
    close = np.concatenate([[False], gaps < NEAR * (merged[-1] - merged[0] or 1.0)])
    merged = merged[~close]
    distinct = ~_near(merged, knots, merged)
    distinct[[0, -1]] = True
    return with_sides(merged[distinct], knots)


def _near(
    instants: Float[np.ndarray, " some"], targets: Float[np.ndarray, " others"], grid: Float[np.ndarray, " time"]
) -> Bool[np.ndarray, " some"]:
    """Return the mask of instants that coincide with an instant of a second set."""
    distances = np.abs(instants[:, None] - targets).min(axis=1, initial=np.inf)
    return distances < NEAR * (grid[-1] - grid[0] or 1.0)
