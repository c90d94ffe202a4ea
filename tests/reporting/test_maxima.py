"""Where curves are highest that come stretch by stretch: as if they had come at once."""

import numpy as np
import pytest

from jounce.reporting.maxima import RunningMaxima


def brute_force(time, curve):
    """The first highest place, and the intervals around the local maxima, the highest and of equal ones the first."""
    top = max(range(len(curve)), key=lambda k: (curve[k], -k))
    edge = [-np.inf]
    padded = np.concatenate([edge, curve, edge])
    peaks = [k for k in range(len(curve)) if padded[k + 1] > padded[k] and padded[k + 1] >= padded[k + 2]]
    peaks.sort(key=lambda k: (-curve[k], k))
    return time[top], curve[top], [(time[max(k - 1, 0)], time[min(k + 1, len(time) - 1)]) for k in peaks]


@pytest.mark.parametrize("cuts", [[], [1], [2], [3], [5], [9], [2, 3], [1, 2, 3, 4], [4, 7], list(range(1, 12))])
@pytest.mark.parametrize("seed", range(6))
def test_stretches_have_the_maxima_of_the_whole(cuts, seed):
    curves = np.random.default_rng(seed).integers(0, 4, size=(12, 5)).astype(float)  # many are equal
    curves[:, 0] = 0.0  # a rate of a constant: its scale is zero, too
    time = np.linspace(2.0, 3.1, 12) ** 2
    found = RunningMaxima(2)
    for part in zip(np.split(time, cuts), np.split(curves, cuts), strict=True):
        found.add(*part, np.array([0.0, 1.0, 1.0, 1.0, 1.0]))
    low, high = found.around_maxima()
    for k in range(5):
        at, size, around = brute_force(time, curves[:, k])
        assert (found.times[k], found.sizes[k]) == (at, size)
        expected = (around + around[:1])[:2]  # where there is one only, it stands twice
        assert [(low[j, k], high[j, k]) for j in range(2)] == expected
