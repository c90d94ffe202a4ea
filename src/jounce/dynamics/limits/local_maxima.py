"""Local maxima of sampled curves."""

import numpy as np
from jaxtyping import Float, Int

LEAST, MOST = 3, 50  # number of local maxima of a curve


def local_maxima(measures: Float[np.ndarray, "time curve"]) -> Int[np.ndarray, "peak curve"]:
    """Return the indices of local maxima of curves that may exceed every sample, or of three, the highest first.

    The height between about evenly spaced instants is estimated by the parabola through three of them.
    """
    height = local_heights(measures) + _above_samples(measures)
    count = np.sum(height >= measures.max(axis=0), axis=0).max(initial=0)
    order = largest_indices(height, int(np.clip(count, LEAST, MOST)))
    usable = np.isfinite(np.take_along_axis(height, order, axis=0))
    return np.where(usable, order, np.argmax(measures, axis=0))


def _above_samples(measures: Float[np.ndarray, "time curve"]) -> Float[np.ndarray, "time curve"]:
    """Return the heights of parabola vertices above their middle samples, 0 at the ends and without a vertex."""
    heights = np.zeros_like(measures)
    before, middle, after = measures[:-2], measures[1:-1], measures[2:]
    with np.errstate(invalid="ignore", divide="ignore"):
        top = (after - before) ** 2 / 8 / (2 * middle - before - after)
    heights[1:-1] = np.where((middle >= before) & (middle >= after) & np.isfinite(top), top, 0.0)
    return heights


def local_heights(measures: Float[np.ndarray, "time curve"]) -> Float[np.ndarray, "time curve"]:
    """Return the values of local maxima, at the first instant of a plateau, and -inf elsewhere."""
    edge = np.full((1, measures.shape[1]), -np.inf)
    before, after = np.concatenate([edge, measures[:-1]]), np.concatenate([measures[1:], edge])
    return np.where((measures > before) & (measures >= after), measures, -np.inf)


def largest_indices(height: Float[np.ndarray, "time curve"], count: int) -> Int[np.ndarray, "{count} curve"]:
    """Return the indices of the highest values of curves, the highest first, the earlier of equal ones first.

    Indices repeat if fewer values are finite than are requested.
    """
    remaining, columns, order = height.copy(), np.arange(height.shape[1]), []
    for _ in range(count):
        order.append(np.argmax(remaining, axis=0))
        remaining[order[-1], columns] = -np.inf
    return np.stack(order)
