"""The largest values of curves that are known at instants."""

import numpy as np
from jaxtyping import Float, Int

LEAST, MOST = 3, 50  # local maxima of a curve


def local_maxima(measures: Float[np.ndarray, "time curve"]) -> Int[np.ndarray, "peak curve"]:
    """Return the indices of local maxima of curves, the best first: all that may be higher than every sample, or three.

    How high a curve is between instants that are about evenly spaced is read off the parabola through three of them.
    """
    height = local_heights(measures) + _above_samples(measures)
    reaching = np.sum(height >= measures.max(axis=0), axis=0).max(initial=0)
    order = largest_indices(height, int(np.clip(reaching, LEAST, MOST)))
    usable = np.isfinite(np.take_along_axis(height, order, axis=0))
    return np.where(usable, order, np.argmax(measures, axis=0))


def _above_samples(measures: Float[np.ndarray, "time curve"]) -> Float[np.ndarray, "time curve"]:
    """Return how far the tops of parabolas are above their middle samples, 0 at the ends and where they have none."""
    heights = np.zeros_like(measures)
    before, middle, after = measures[:-2], measures[1:-1], measures[2:]
    with np.errstate(invalid="ignore", divide="ignore"):
        top = (after - before) ** 2 / 8 / (2 * middle - before - after)
    heights[1:-1] = np.where((middle >= before) & (middle >= after) & np.isfinite(top), top, 0.0)
    return heights


def local_heights(measures: Float[np.ndarray, "time curve"]) -> Float[np.ndarray, "time curve"]:
    """Return curves where they have a local maximum, of a plateau its first instant, and -inf elsewhere."""
    edge = np.full((1, measures.shape[1]), -np.inf)
    before, after = np.concatenate([edge, measures[:-1]]), np.concatenate([measures[1:], edge])
    return np.where((measures > before) & (measures >= after), measures, -np.inf)


def largest_indices(height: Float[np.ndarray, "time curve"], count: int) -> Int[np.ndarray, "{count} curve"]:
    """Return the indices of the highest values of curves, the best first, of equal ones the earlier.

    Where fewer are finite than are requested, an index may stand twice.
    """
    left, every, order = height.copy(), np.arange(height.shape[1]), []
    for _ in range(count):
        order.append(np.argmax(left, axis=0))
        left[order[-1], every] = -np.inf
    return np.stack(order)
