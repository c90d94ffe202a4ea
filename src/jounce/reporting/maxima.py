"""Maxima of curves that arrive in chunks and are not stored."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from jounce.dynamics.limits.local_maxima import largest_indices, local_heights

Times = Float[np.ndarray, " time"]
Curves = Float[np.ndarray, "time curves"]
Peaks = Float[np.ndarray, "peaks curves"]
ALIKE = 1e-6  # fraction of the largest value of a curve
ROUNDING = 1e-9  # fraction of the scale of a curve, within which maxima are equal


class RunningMaxima:
    """The largest values and the highest local maxima of curves that arrive in chunks.

    Curves are -inf where unknown. Of maxima that differ only by rounding the earlier one is preferred.

    Attributes
    ----------
    times, sizes : array of shape (2 curves,)
        Instant, s, and size of the largest value of each curve.
    scales : array of shape (2 curves,)
        Largest scale of each curve, from the scales of the chunks.
    """

    times: Float[np.ndarray, " curves"]
    sizes: Float[np.ndarray, " curves"]
    scales: Float[np.ndarray, " curves"]

    def __init__(self, count: int) -> None:
        self._count = count
        self._ends: tuple[Times, Curves] | None = None  # the last two instants so far
        self._maxima: list[Peaks] = []  # heights, and the instants before and after

    def add(self, time: Times, values: Curves, scales: Float[np.ndarray, " curves"]) -> None:
        """Add the next chunk."""
        self.scales = scales if self._ends is None else np.maximum(self.scales, scales)
        top, columns = largest_indices(self._rounded(local_heights(values)), 1)[0], np.arange(values.shape[1])
        largest = values[top, columns]
        if self._ends is None:
            self.times, self.sizes = time[top], largest
        else:
            self.times = np.where(largest > self.sizes, time[top], self.times)
            self.sizes = np.maximum(self.sizes, largest)
            time, values = np.concatenate([self._ends[0], time]), np.concatenate([self._ends[1], values])
        self._maxima = self._local_maxima(time, values, ends=False)
        self._ends = time[-2:], values[-2:].copy()

    def around_maxima(self) -> tuple[Peaks, Peaks]:
        """Return the instants before and after the highest local maxima of each curve, after the last chunk."""
        assert self._ends is not None
        height, low, high = self._local_maxima(*self._ends, ends=True)
        usable = np.isfinite(height)
        return np.where(usable, low, low[0]), np.where(usable, high, high[0])

    def _local_maxima(self, time: Times, values: Curves, *, ends: bool) -> list[Peaks]:
        """Return the highest local maxima so far; the first and last instant of a chunk count only at the ends."""
        inner = slice(1 if self._maxima else 0, None if ends else -1)
        height = local_heights(values)[inner]
        if not len(height):
            return self._maxima
        indices = np.arange(len(time))[inner]
        top = largest_indices(self._rounded(height), self._count)
        index = indices[top]
        heights = np.take_along_axis(height, top, axis=0)
        for k in range(1, self._count):  # a maximum listed twice for lack of others counts once
            heights[k, (top[:k] == top[k]).any(axis=0)] = -np.inf
        candidates = [
            heights,
            time[np.maximum(index - 1, 0)],
            time[np.minimum(index + 1, len(time) - 1)],
        ]
        if self._maxima:
            joined = [np.concatenate(pair) for pair in zip(self._maxima, candidates, strict=True)]
            order = np.argsort(-self._rounded(joined[0]), axis=0, kind="stable")[: self._count]
            candidates = [np.take_along_axis(x, order, axis=0) for x in joined]
        return candidates

    def _rounded(self, heights: Curves) -> Curves:
        """Return heights to multiples of their rounding, so that maxima of one height are equal."""
        step = ROUNDING * np.where(self.scales > 0, self.scales, 1.0)
        return np.rint(heights / step) * step


def alike(first: Curves, second: Curves) -> bool:
    """Return whether two samples of the same curves agree up to rounding and the tolerance of solving."""
    size = np.max(np.abs(second), axis=0, initial=0.0, where=np.isfinite(second))
    with np.errstate(invalid="ignore"):  # both may be unknown
        return bool(np.all((first == second) | (np.abs(first - second) <= ALIKE * size)))
