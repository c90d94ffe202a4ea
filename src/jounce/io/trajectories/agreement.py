"""Whether velocities and accelerations of a recording are those of its positions."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.io.trajectories.recordings import LEVELS, Recording
from jounce.trajectory.sample_errors import noise

CONTRADICTS, DOUBTFUL = 0.2, 0.05
"""Of the change over a stretch: from there on a column is refused, or mentioned."""
WINDOWS = 50  # of a recording, over which changes are compared
NOISES = 6.0  # times the deviation of what noise makes of a change: a smaller difference says nothing
FEWEST = 12  # samples, of which one may be an outlier
PARTS = 5
OUTLYING = 0.05  # of the range of a derivative: a smaller distance is none of an outlier
BLOCK = 20_000  # samples that noise is estimated from


@dataclasses.dataclass(frozen=True)
class _Difference:
    share: float  # of the change, by the root of the mean of squares
    row: int  # where it is largest
    given: float  # the change there, by the derivative
    integral: float  # the change there, by the level below it


def check_agreement(recording: Recording) -> list[str]:
    """Return in words where derivatives differ a little from what positions say.

    Over stretches of the recording the change of a level is compared with the integral of the one above it, beyond what
    noise and the distance of the samples explain.

    Raises
    ------
    TrajectoryError
        If they differ by more than a fifth, or a single sample of a derivative is an outlier: the message names the
        joint and the line.
    """
    doubts = []
    for level in range(1, recording.values.shape[1]):
        for k, name in enumerate(recording.names):
            rows = np.flatnonzero(~np.isnan(recording.values[:, level - 1 : level + 1, k]).any(axis=1))
            if len(rows) < 4:
                continue
            below, rate = recording.values[rows, level - 1, k], recording.values[rows, level, k]
            if (outlier := _outlier(recording.times[rows], below, rate)) is not None:
                row, expected = outlier
                instant = recording.times[rows[row]]
                message = (
                    f"{LEVELS[level]} have an outlier at t = {instant:.6g} s: {rate[row]:.6g}, where the samples "
                    f"beside it and {LEVELS[level - 1]} say {expected:.6g}; correct it, or leave the row out"
                )
                raise recording.error(message, int(rows[row]), name=name)
            worst = _difference(recording.times[rows], below, rate)
            if worst is None or worst.share < DOUBTFUL:
                continue
            first = recording.times[rows[worst.row]]
            fact = (
                f"{LEVELS[level]} say a change of {worst.given:.4g}, and {LEVELS[level - 1]} one of "
                f"{worst.integral:.4g}, from t = {first:.6g} s on"
            )
            if worst.share >= CONTRADICTS:
                message = f"{fact}: they contradict each other; correct units, signs or order, or leave the columns out"
                raise recording.error(message, int(rows[worst.row]), name=name)
            doubts.append(f"{name}: {fact}")
    return doubts


def _outlier(times: np.ndarray, below: np.ndarray, rate: np.ndarray) -> tuple[int, float] | None:
    """Return the sample of a rate that is far from what the level below says, and from its neighbors, and that value.

    It is farther from both than noise makes it, and than the rate itself changes over the samples about it: neither a
    jump of the rate nor a knock, which positions show too, is an outlier.
    """
    if len(times) < FEWEST:
        return None
    before, after = np.diff(times)[1:-2], np.diff(times)[2:-1]  # about all but the two first and the two last
    falls, rises = np.diff(below)[1:-2] / before, np.diff(below)[2:-1] / after
    middle = (falls * after + rises * before) / (before + after)  # of the parabola through three samples
    own = rate[2:-2]
    change = np.abs(rate[3:-1] - rate[1:-3]) + np.abs(rate[4:] - rate[:-4]) + np.abs(rises - falls)
    between = rate[1:-3] + (rate[3:-1] - rate[1:-3]) * before / (before + after)
    sigmas = [float(np.median([noise(times[b], x[b]) for b in _blocks(len(times))])) for x in (below, rate)]
    by_noise = NOISES * (sigmas[1] + 2 * sigmas[0] / np.minimum(before, after))
    far = np.minimum(np.abs(own - middle), np.abs(own - between)) - by_noise - change
    worst = int(np.argmax(far))
    if far[worst] <= OUTLYING * float(np.ptp(np.delete(rate, worst + 2))):
        return None
    return worst + 2, float(middle[worst])


def _blocks(count: int) -> list[slice]:
    """Return parts of samples over which noise is estimated, since an outlier raises the estimate of its own part."""
    length = max(count // PARTS, FEWEST)
    return [slice(first, first + length) for first in range(0, max(count - length, 0) + 1, length)][:PARTS]


def _difference(times: np.ndarray, below: np.ndarray, rate: np.ndarray) -> _Difference | None:
    """Return by how much the integral of a rate differs from what it is the rate of; None where nothing is known."""
    steps = np.diff(times)
    length = max(1, len(steps) // WINDOWS)
    sums = np.append(0.0, np.cumsum(steps * (rate[1:] + rate[:-1]) / 2))
    coarse = _coarse(times, rate)
    first = np.arange(0, len(times) - length, max(1, length // 2))
    last = first + length
    given, integral = sums[last] - sums[first], below[last] - below[first]
    difference = given - integral
    block = slice(0, BLOCK)
    sigmas = noise(times[block], below[block]), noise(times[block], rate[block])
    step = float(np.median(steps))
    by_noise = np.hypot(np.sqrt(2) * sigmas[0], sigmas[1] * step * np.sqrt(length))
    by_step = np.abs(coarse[last] - coarse[first] - given) / 3  # of the trapezoidal rule, by twice the step
    size = max(_root(given), _root(integral))
    beyond = np.maximum(np.abs(difference) - by_step - NOISES * by_noise, 0.0)
    if size == 0 or not beyond.any():
        return None
    worst = int(np.argmax(beyond))
    return _Difference(_root(beyond) / size, int(first[worst]), float(given[worst]), float(integral[worst]))


def _coarse(times: Float[np.ndarray, " row"], rate: Float[np.ndarray, " row"]) -> Float[np.ndarray, " row"]:
    """Return the integral of a rate by every second sample, at all samples."""
    half = np.unique(np.append(np.arange(0, len(times), 2), len(times) - 1))
    sums = np.append(0.0, np.cumsum(np.diff(times[half]) * (rate[half][1:] + rate[half][:-1]) / 2))
    own = np.clip(np.searchsorted(half, np.arange(len(times)), side="right") - 1, 0, len(half) - 2)
    since = times - times[half[own]]
    slope = (rate[half[own + 1]] - rate[half[own]]) / (times[half[own + 1]] - times[half[own]])
    return sums[own] + rate[half[own]] * since + slope * since**2 / 2


def _root(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
