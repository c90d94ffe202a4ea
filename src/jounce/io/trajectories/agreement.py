"""Checks of a recording: whole turns of its positions, and the agreement of its derivatives with one another."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.io.trajectories.recordings import LEVELS, Recording
from jounce.trajectory.sample_errors import noise

CONTRADICTS, DOUBTFUL = 0.2, 0.05
"""Share of the change over a window from which a difference is refused, or mentioned."""
WINDOWS = 50  # number of windows over which changes are compared
NOISES = 6.0  # standard deviations of a change by noise that a difference must exceed
FEWEST = 12  # samples for the search for outliers
MOST = 3  # outliers in a row
PARTS = 5
OUTLYING = 0.05  # of the range of a derivative, which the distance of an outlier must exceed
TURN = 2.0 * np.pi
SMALL = 0.125 * TURN  # largest neighbor of a step by a turn; larger steps say nothing about turns
SAME = 1.5  # times the largest neighboring step: largest remainder of a step by whole turns
BLOCK = 20_000  # samples for an estimate of noise


@dataclasses.dataclass(frozen=True)
class _Difference:
    share: float  # of the change, by root mean squares
    row: int  # row of the largest difference
    given: float  # change by the derivative
    integral: float  # change by the level below


def check_turns(recording: Recording) -> None:
    """Raise an error if an angle changes by a whole turn between two samples, like an angle wrapped to one turn.

    Raises
    ------
    TrajectoryError
        If an angle does so, and the neighboring steps are small: the message names the joint and the line.
    """
    for k, name in enumerate(recording.names):
        rows = np.flatnonzero(~np.isnan(recording.values[:, 0, k]))
        if recording.measures.get(name) == "length" or len(rows) < 4:
            continue
        steps = np.diff(recording.values[rows, 0, k])
        remainders = np.abs((steps + TURN / 2) % TURN - TURN / 2)
        neighbors = np.maximum(np.append(0.0, remainders[:-1]), np.append(remainders[1:], 0.0))
        long = np.sign(steps) * (np.abs(steps) > TURN - SMALL)
        is_repeated = long[:-1] * long[1:] > 0  # a joint that turns so fast, or has so few samples
        goes_on = np.append(False, is_repeated) | np.append(is_repeated, False)
        is_turn = (long != 0) & ~goes_on & (neighbors < SMALL) & (remainders <= SAME * neighbors + 1e-3)
        if is_turn.any():
            index = int(np.argmax(is_turn))
            message = (
                f"goes by {steps[index]:.6g} in one step, nearly a whole turn, as angles do that are kept within one; "
                "count the turns, as numpy.unwrap does"
            )
            raise recording.error(message, int(rows[index + 1]), name=name)


def without_idle_rates(recording: Recording) -> tuple[Recording, list[str]]:
    """Return a recording without velocities, and what is above them, of joints that move and whose velocities are zero.

    Drivers that do not measure velocities write zeros. Which joints these are is told in words.
    """
    values, names = recording.values.copy(), []
    for k, name in enumerate(recording.names):
        rows = ~np.isnan(values[:, :2, k]).any(axis=1)
        if values.shape[1] < 2 or not rows.any() or values[rows, 1, k].any() or not np.ptp(values[rows, 0, k]):
            continue
        values[:, 1:, k] = np.nan
        names.append(name)
    if not names:
        return recording, []
    note = f"velocities that are zero throughout, and left out as not measured: {', '.join(names)}"
    return dataclasses.replace(recording, values=values), [note]


def check_agreement(recording: Recording) -> list[str]:
    """Return descriptions of small differences between derivatives and positions.

    Over windows of the recording, the change of a level is compared with the integral of the level above it.
    Differences that noise and the sampling period explain are ignored.

    Raises
    ------
    TrajectoryError
        If they differ by more than a fifth, or up to three consecutive samples of a derivative are outliers: the
        message names the joint and the line.
    """
    doubts = []
    for level in range(1, recording.values.shape[1]):
        for k, name in enumerate(recording.names):
            rows = np.flatnonzero(~np.isnan(recording.values[:, level - 1 : level + 1, k]).any(axis=1))
            if len(rows) < 4:
                continue
            values, rate = recording.values[rows, level - 1, k], recording.values[rows, level, k]
            if (outliers := _outliers(recording.times[rows], values, rate)) is not None:
                first, last, expected = outliers
                phrase, line = _outlier_words(recording, rows[first : last + 1], level, k), int(rows[first])
                advice = (
                    "correct it, or leave the row out" if first == last else "correct them, or leave these rows out"
                )
                neighbors = f"the samples beside {'it' if first == last else 'them'} and {LEVELS[level - 1]}"
                message = f"{phrase}, where {neighbors} say {expected:.6g}; {advice}"
                raise recording.error(message, line, name=name)
            worst = _difference(recording.times[rows], values, rate)
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


def _outlier_words(recording: Recording, rows: np.ndarray, level: int, joint: int) -> str:
    """Return a description of outliers: their instants and values."""
    values = ", ".join(f"{x:.6g}" for x in recording.values[rows, level, joint])
    first, last = recording.times[rows[[0, -1]]]
    if len(rows) == 1:
        return f"{LEVELS[level]} have an outlier at t = {first:.6g} s: {values}"
    lines = f", to line {int(recording.lines[rows[-1]])}" if len(recording.lines) else ""
    return f"{LEVELS[level]} have {len(rows)} outliers in a row from t = {first:.6g} s to {last:.6g} s{lines}: {values}"


def _outliers(times: np.ndarray, values: np.ndarray, rate: np.ndarray) -> tuple[int, int, float] | None:
    """Return consecutive outliers of a rate: the first and the last sample, and the expected value of the first.

    An outlier is farther from the slope of the level below, and from its neighbors, than noise and the changes of the
    rate about it explain. So neither a jump of the rate nor a shock that the positions show is an outlier.
    """
    if len(times) < FEWEST:
        return None
    steps = np.diff(times)
    slopes = np.diff(values) / steps
    before, after = steps[:-1], steps[1:]
    middle = (slopes[:-1] * after + slopes[1:] * before) / (before + after)  # slope of the parabola
    sigmas = [float(np.median([noise(times[b], x[b]) for b in _blocks(len(times))])) for x in (values, rate)]
    by_noise = NOISES * (sigmas[1] + 2 * sigmas[0] / np.minimum(before, after))
    deviation = np.abs(rate[1:-1] - middle) - by_noise  # of all samples but the first and the last
    best = None
    for count in range(1, MOST + 1):
        groups = len(times) - count - 3  # number of groups with two neighbors on each side
        left, right = slice(1, groups + 1), slice(count + 2, count + 2 + groups)
        turn = rate[right] - rate[left]
        windows = np.stack([slopes[k : k + groups] for k in range(1, count + 2)])
        change = np.abs(turn) + np.abs(rate[count + 3 :] - rate[:groups]) + np.ptp(windows, axis=0)
        excesses = np.full(groups, np.inf)
        for k in range(2, count + 2):
            window = slice(k, k + groups)
            fraction = (times[window] - times[left]) / (times[right] - times[left])
            noisy = by_noise[k - 1 : k - 1 + groups]
            by_neighbors = np.abs(rate[window] - rate[left] - fraction * turn) - noisy
            excesses = np.minimum(excesses, np.minimum(deviation[k - 1 : k - 1 + groups], by_neighbors))
        excesses -= change
        worst = int(np.argmax(excesses))
        if best is None or excesses[worst] > best[0]:
            best = excesses[worst], worst + 2, worst + count + 1
    assert best is not None
    excess, first, last = best
    if excess <= OUTLYING * float(np.ptp(np.delete(rate, slice(first, last + 1)))):
        return None
    return first, last, float(middle[first - 1])


def _blocks(count: int) -> list[slice]:
    """Return parts of the samples for separate estimates of noise, since an outlier raises that of its own part."""
    length = max(count // PARTS, FEWEST)
    size = min(length, BLOCK)
    return [slice(first, first + size) for first in range(0, max(count - length, 0) + 1, length)][:PARTS]


def _difference(times: np.ndarray, values: np.ndarray, rate: np.ndarray) -> _Difference | None:
    """Return the difference between the integral of a rate and the level below; None if it cannot be judged."""
    steps = np.diff(times)
    length = max(1, len(steps) // WINDOWS)
    sums = np.append(0.0, np.cumsum(steps * (rate[1:] + rate[:-1]) / 2))
    coarse = _coarse(times, rate)
    first = np.arange(0, len(times) - length, max(1, length // 2))
    last = first + length
    given, integral = sums[last] - sums[first], values[last] - values[first]
    difference = given - integral
    block = slice(0, BLOCK)
    sigmas = noise(times[block], values[block]), noise(times[block], rate[block])
    step = float(np.median(steps))
    by_noise = np.hypot(np.sqrt(2) * sigmas[0], sigmas[1] * step * np.sqrt(length))
    by_step = np.abs(coarse[last] - coarse[first] - given) / 3  # error of the trapezoidal rule, from twice the step
    size = max(_root(given), _root(integral))
    excess = np.maximum(np.abs(difference) - by_step - NOISES * by_noise, 0.0)
    if size == 0 or not excess.any():
        return None
    worst = int(np.argmax(excess))
    return _Difference(_root(excess) / size, int(first[worst]), float(given[worst]), float(integral[worst]))


def _coarse(times: Float[np.ndarray, " row"], rate: Float[np.ndarray, " row"]) -> Float[np.ndarray, " row"]:
    """Return the integral of a rate by every second sample, at all samples."""
    coarse = np.unique(np.append(np.arange(0, len(times), 2), len(times) - 1))
    sums = np.append(0.0, np.cumsum(np.diff(times[coarse]) * (rate[coarse][1:] + rate[coarse][:-1]) / 2))
    index = np.clip(np.searchsorted(coarse, np.arange(len(times)), side="right") - 1, 0, len(coarse) - 2)
    elapsed = times - times[coarse[index]]
    slope = (rate[coarse[index + 1]] - rate[coarse[index]]) / (times[coarse[index + 1]] - times[coarse[index]])
    return sums[index] + rate[coarse[index]] * elapsed + slope * elapsed**2 / 2


def _root(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
