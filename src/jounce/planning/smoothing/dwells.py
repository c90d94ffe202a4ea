"""Dwells: intervals in which samples rest, within their noise or their quantization step."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jounce.trajectory.sample_errors import noise

BLOCK = 8  # samples of a block, whose means are compared
LEAST = 32  # samples of a dwell
SURE = 4.0  # standard deviations
SLOPE = 3.0  # standard deviations of the drift over a dwell
SHARES = (1.0, 0.95, 0.9, 0.8, 0.65, 0.5)  # trial fractions of a run
NEAR = 5  # largest number of blocks between dwells that are joined
LEAST_LEFT = 2  # samples
MARGIN = 1.5  # blocks at each end of a dwell that may belong to the neighboring motion
LONGER = 4  # least ratio of the length of a dwell of equal samples to that of neighboring runs
EQUAL = 16  # least number of samples in a run of equal ones
SEEN = 20_000  # samples from which noise and steps are estimated
AGREE = 1e-3  # fraction of a step: tolerance for differences that are whole numbers of steps
QUANTA = 4096  # largest number of steps in the range of the samples


@dataclasses.dataclass(frozen=True)
class Dwell:
    """An interval in which samples rest.

    Parameters
    ----------
    first, last : int
        Indices of its first and last sample.
    position : float
        Position, rad or m.
    """

    first: int
    last: int
    position: float


def step_of(values: Float[np.ndarray, " sample"]) -> float:
    """Return the quantization step of samples; 0 if none is visible."""
    differences = np.abs(np.diff(values[:SEEN]))
    differences = differences[differences > 0]
    if len(differences) < 8:
        return 0.0
    step = float(differences.min())
    if np.ptp(values[:SEEN]) > 1e9 * step:
        return 0.0
    ratios = differences / step
    fits = np.abs(ratios - np.rint(ratios)).max() <= max(AGREE * float(ratios.max()), 0.05)
    return step if fits and float(np.ptp(values[:SEEN])) < QUANTA * step * 1e3 and np.mean(ratios < 1.5) > 0.02 else 0.0


def noise_of(times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"]) -> float:
    """Return the standard deviation of the noise of samples, including quantization noise."""
    estimate = noise(times[:SEEN], values[:SEEN])
    return max(estimate, step_of(values) / np.sqrt(12))


def dwells(times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"], sigma: float) -> list[Dwell]:
    """Return the dwells of samples, without margins that may belong to the neighboring motions.

    Parameters
    ----------
    times, values : array of shape (sample,)
        Instants, s, and positions, rad or m.
    sigma : float
        Standard deviation of the noise.
    """
    chosen: list[Dwell] = []
    is_taken = np.zeros(len(values), bool)
    for dwell in sorted([*_of_equal(values), *_of_noise(times, values, sigma)], key=lambda x: x.first - x.last):
        samples = slice(dwell.first, dwell.last + 1)
        if not is_taken[samples].any():  # the longest dwells come first
            chosen.append(dwell)
            is_taken[samples] = True
    return _joined(sorted(chosen, key=lambda dwell: dwell.first), values, sigma)


def without_margins(
    dwells: Sequence[Dwell], times: Float[np.ndarray, " sample"], scales: Sequence[tuple[float, float]]
) -> list[Dwell]:
    """Return dwells without margins at their ends in which the neighboring motions may change unseen.

    Parameters
    ----------
    dwells : sequence of Dwell
        Dwells in order of time.
    times : array of shape (sample,)
        Instants, s.
    scales : sequence of (float, float)
        Time scales of the motions before and after each dwell, s.
    """
    inner = []
    for dwell, (scale_before, scale_after) in zip(dwells, scales, strict=True):
        first, last = dwell.first, dwell.last
        if first > 0:
            first = int(np.searchsorted(times, times[first] + scale_before))
        if last < len(times) - 1:
            last = int(np.searchsorted(times, times[last] - scale_after, side="right")) - 1
        is_whole = first == 0 and last == len(times) - 1
        if is_whole or (last - first >= LEAST_LEFT and times[last] - times[first] >= min(scale_before, scale_after)):
            inner.append(dataclasses.replace(dwell, first=first, last=last))
    return inner


def _joined(dwells: list[Dwell], values: np.ndarray, sigma: float) -> list[Dwell]:
    """Return dwells with those joined that rest at one position a short time apart, with rest between them."""
    result = dwells[:1]
    for dwell in dwells[1:]:
        previous = result[-1]
        counts = previous.last - previous.first + 1, dwell.last - dwell.first + 1
        if (
            dwell.first - previous.last <= NEAR * BLOCK
            and abs(previous.position - dwell.position) <= SURE * sigma * np.sqrt(1 / counts[0] + 1 / counts[1])
            and np.ptp(values[previous.last : dwell.first + 1]) <= 2 * SURE * sigma
        ):
            samples = values[previous.first : dwell.last + 1]
            result[-1] = Dwell(previous.first, dwell.last, float(samples.mean()))
        else:
            result.append(dwell)
    return result


def _of_equal(values: np.ndarray) -> list[Dwell]:
    """Return runs of equal samples much longer than neighboring runs; others are quantization of a slow motion."""
    begins = np.flatnonzero(np.append(True, values[1:] != values[:-1]))
    lengths = np.diff(begins, append=len(values))
    runs = []
    for k in np.flatnonzero(lengths >= EQUAL).tolist():
        neighbor = max((int(lengths[j]) for j in (k - 1, k + 1) if 0 <= j < len(lengths)), default=0)
        if len(lengths) > 1 and lengths[k] < LONGER * neighbor:
            continue
        first, last = int(begins[k]), int(begins[k] + lengths[k] - 1)
        first, last = _within(first, last, len(values), max(neighbor, int(lengths[k]) // 8))
        if last - first >= 2:
            runs.append(Dwell(first, last, float(values[first])))
    return runs


def _of_noise(times: np.ndarray, values: np.ndarray, sigma: float) -> list[Dwell]:
    """Return runs of blocks with means, drift and scatter of noise about one position."""
    count = len(values) // BLOCK
    if count < LEAST // BLOCK or sigma <= 0:
        return []
    means = values[: count * BLOCK].reshape(count, BLOCK).mean(axis=1)
    tolerance = SURE * sigma / np.sqrt(BLOCK)
    runs, first = [], 0
    while first < count - 1:
        last, low, high = first, means[first], means[first]
        while last + 1 < count and max(high, means[last + 1]) - min(low, means[last + 1]) <= 2 * tolerance:
            last += 1
            low, high = min(low, means[last]), max(high, means[last])
        start, end = first * BLOCK, (last + 1) * BLOCK - 1
        if last == count - 1:
            end = len(values) - 1
        size = end - start + 1
        lengths = [n for fraction in SHARES if (n := int(fraction * size)) >= LEAST]
        length = next((n for n in lengths if _still(times[start : start + n], values[start : start + n], sigma)), 0)
        if length:  # the first samples of a motion may look like noise
            end = start + length - 1
            start, end = _within(start, end, len(values), int(MARGIN * BLOCK))
            if end - start >= 2:
                runs.append(Dwell(start, end, float(values[start : end + 1].mean())))
            first = first + max(1, length // BLOCK)
        else:
            first += max(1, (last - first) // 8)
    return runs


def _still(times: np.ndarray, values: np.ndarray, sigma: float) -> bool:
    """Return whether samples drift and scatter no more than noise about one position."""
    elapsed = times - times.mean()
    span = float(times[-1] - times[0])
    slope = float(elapsed @ values) / float(elapsed @ elapsed)
    bound = SLOPE * sigma / np.sqrt(float(elapsed @ elapsed)) * span
    half = len(values) // 2
    difference = abs(values[:half].mean() - values[half:].mean())
    scatter = float(values.std())
    return bool(abs(slope) * span <= bound and scatter <= 1.3 * sigma and difference <= SURE * sigma / np.sqrt(half))


def _within(first: int, last: int, count: int, margin: int) -> tuple[int, int]:
    """Return a dwell without its margins, which are kept at the ends of the samples."""
    return (first if first == 0 else first + margin), (last if last == count - 1 else last - margin)
