"""The highest places of curves that are known at instants."""

import numpy as np
from jaxtyping import Float, Int


def local_maxima(measures: Float[np.ndarray, "time curve"], count: int) -> Int[np.ndarray, "{count} curve"]:
    """Return the indices of the highest local maxima of curves, the best first."""
    height = local_heights(measures)
    order = highest_of(height, count)
    usable = np.isfinite(np.take_along_axis(height, order, axis=0))
    return np.where(usable, order, np.argmax(measures, axis=0))


def local_heights(measures: Float[np.ndarray, "time curve"]) -> Float[np.ndarray, "time curve"]:
    """Return curves where they have a local maximum, of a plateau its first instant, and -inf elsewhere."""
    edge = np.full((1, measures.shape[1]), -np.inf)
    before, after = np.concatenate([edge, measures[:-1]]), np.concatenate([measures[1:], edge])
    return np.where((measures > before) & (measures >= after), measures, -np.inf)


def highest_of(height: Float[np.ndarray, "time curve"], count: int) -> Int[np.ndarray, "{count} curve"]:
    """Return the indices of the highest values of curves, the best first, of equal ones the earlier."""
    left, every, order = height.copy(), np.arange(height.shape[1]), []
    for _ in range(count):
        order.append(np.argmax(left, axis=0))
        left[order[-1], every] = -np.inf
    return np.stack(order)
