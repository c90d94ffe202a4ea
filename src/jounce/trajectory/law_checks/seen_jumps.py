"""Jumps of derivatives, detected by sampled values, for laws without known knots."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float

BENT = 0.2  # of the change over a cell: part unexplained by slopes, from which it is a jump
FAINT = 1e-5  # of the largest value; smaller jumps are ignored
CONSTANT = 1e-9  # of the size of positions over time to the power of the order; smaller values are rounding
SHORTEST = 1e-11  # of the whole time: length of the last cell around a jump
HALVINGS = 40

Evaluation = Callable[[Float[np.ndarray, " time"]], Float[np.ndarray, "time level joint"]]


def level_sizes(values: Float[np.ndarray, "time level joint"], duration: float) -> Float[np.ndarray, "level joint"]:
    """Return the size of each derivative; one that is small beside a lower one over the whole time is rounding."""
    largest = np.abs(values).max(axis=0)
    sizes = largest.copy()
    for level in range(2, len(sizes)):
        sizes[level] = np.maximum(largest[level], sizes[level - 1] / duration)
    return sizes


def unexplained(
    instants: Float[np.ndarray, " time"],
    values: Float[np.ndarray, "time level joint"],
    sizes: Float[np.ndarray, "level #joint"],
) -> Bool[np.ndarray, "cell level-1 joint"]:
    """Return in which cells derivatives change by more than their slopes at both ends explain.

    Parameters
    ----------
    instants : array of shape (time,)
        Ends of the cells.
    values : array of shape (time, level, joint)
        Derivatives at the ends; the highest one serves only as slope.
    sizes : array of shape (level, joint) or (level, 1)
        Sizes of the derivatives from `level_sizes`.
    """
    step = np.diff(instants)[:, None, None]
    change, slopes = np.diff(values[:, :-1], axis=0), values[:, 1:]
    off = np.abs(change - (slopes[1:] + slopes[:-1]) * step / 2)  # part that no slope explains
    bends = step * np.abs(np.diff(slopes, axis=0))  # part that a jump of the slope explains
    return (off > BENT * np.abs(change)) & (off > FAINT * sizes[:-1]) & (off > bends)


def seen_jumps(
    evaluate: Evaluation, instants: Float[np.ndarray, " time"], values: Float[np.ndarray, "time level joint"]
) -> tuple[Float[np.ndarray, " jump"], Float[np.ndarray, "jump level-1 joint"]]:
    """Return the instants at which derivatives jump by their values, and the jumps; zero for continuous derivatives.

    A cell with a change that its slopes do not explain is bisected repeatedly: steep changes become flat, jumps remain.

    Parameters
    ----------
    evaluate : callable
        Maps instants, (time,), to derivatives, (time, level, joint).
    instants : array of shape (time,)
        Initial instants, s.
    values : array of shape (time, level, joint)
        Derivatives at these instants; the highest one serves only as slope.

    Examples
    --------
    >>> import numpy as np
    >>> def kink(t):
    ...     return np.stack([np.abs(t - 0.3), np.sign(t - 0.3), 0 * t], axis=1)[..., None]
    >>> t = np.linspace(0.0, 1.0, 101) ** 1.1
    >>> where, sizes = seen_jumps(kink, t, kink(t))
    >>> where.round(9).tolist(), sizes[..., 0].round(9).tolist()
    ([0.3], [[0.0, 2.0]])
    """
    duration = float(instants[-1] - instants[0])
    levels, joints = values.shape[1] - 1, values.shape[2]
    if len(instants) < 2:
        return np.zeros(0), np.zeros((0, levels, joints))
    sizes = level_sizes(values, duration)
    least = CONSTANT * sizes[0] / duration ** np.arange(levels + 1)[:, None]
    sizes = np.maximum(sizes, least / FAINT)
    cells = np.flatnonzero(unexplained(instants, values, sizes).any(axis=(1, 2)))
    low, high = instants[cells], instants[cells + 1]
    left, right = values[cells], values[cells + 1]
    for _ in range(HALVINGS):
        if not len(cells) or (high - low).max() <= SHORTEST * duration:
            break
        middle = (low + high) / 2
        between = evaluate(middle)
        usable = np.isfinite(between).all(axis=(1, 2))  # beside a kink, there may be no derivatives
        first = _unexplained_change(low, middle, left, between, sizes) >= _unexplained_change(
            middle, high, between, right, sizes
        )
        earlier, later = usable & first, usable & ~first
        low, high = np.where(later, middle, low), np.where(earlier, middle, high)
        left, right = np.where(later[:, None, None], between, left), np.where(earlier[:, None, None], between, right)
    change = right[:, :-1] - left[:, :-1]
    explained = (right[:, 1:] + left[:, 1:]) * (high - low)[:, None, None] / 2
    jumped = (np.abs(change) > FAINT * sizes[:-1]) & (np.abs(change - explained) > BENT * np.abs(change))
    some = jumped.any(axis=(1, 2))
    return high[some], np.where(jumped, change, 0.0)[some]


def _unexplained_change(
    low: np.ndarray, high: np.ndarray, left: np.ndarray, right: np.ndarray, sizes: np.ndarray
) -> Float[np.ndarray, " cell"]:
    """Return the largest changes over cells that slopes do not explain, relative to the sizes."""
    step = (high - low)[:, None, None]
    off = np.abs(right[:, :-1] - left[:, :-1] - (right[:, 1:] + left[:, 1:]) * step / 2)
    return np.max(off / np.maximum(sizes[:-1], np.finfo(float).tiny), axis=(1, 2))
