"""How much jounce counts against distance from the samples: the weight under which samples are most likely.

The likelihood of the samples, of a motion whose jounce is noise and of independent noise of their own, has one maximum
over the weight (G. Wahba, A comparison of GCV and GML for choosing the smoothing parameter, Annals of Statistics 13
(1985), 1378-1402): neither a noise level nor a bandwidth has to be given. It is found stretch by stretch, since fast
parts of a motion support less smoothing than slow ones.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from jounce.planning.smoothing.bases import DEGREE, PENALIZED, banded, penalty_root, values_at, whole

CELLS = (8, 16, 32, 64)  # of a stretch: as few as resolve what is followed, or rounding counts
MOST, LEAST = 3000, 64  # samples in a stretch
RESOLVED = np.pi / 2  # largest cutoff frequency times the length of a cell
RANGE = (-24.0, 20.0)  # of the natural logarithm of the weight, cells having the length 1
STEPS = 24
FLOOR = 1e-7  # of the range of samples: less is no noise


@dataclasses.dataclass(frozen=True, eq=False)
class Stretch:
    """What samples of a stretch say.

    Parameters
    ----------
    start, stop : float
        s.
    weight : float
        Of the integral of the square of the jounce, s^7, against the sum of squares of distances.
    cutoff : float
        Frequency from which on nothing is followed, rad/s.
    noise : float
        Standard deviation, rad or m.
    """

    start: float
    stop: float
    weight: float
    cutoff: float
    noise: float


def stretches(times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"]) -> list[Stretch]:
    """Return the likely weight in stretches of samples, short where the motion is fast."""
    count = len(times)
    pending = [(k, min(k + MOST, count)) for k in range(0, count, MOST)]
    if len(pending) > 1 and pending[-1][1] - pending[-1][0] < MOST // 2:
        pending[-2:] = [(pending[-2][0], count)]
    found = []
    while pending:
        first, last = pending.pop()
        own, resolved = _resolved(times[first:last], values[first:last])
        if not resolved and last - first >= 2 * LEAST:
            middle = (first + last) // 2
            pending += [(first, middle), (middle, last)]
        else:
            found.append(own)
    return sorted(found, key=lambda stretch: stretch.start)


def _resolved(times: np.ndarray, values: np.ndarray) -> tuple[Stretch, bool]:
    """Return the likely weight by as few cells as resolve what is followed, and whether they do."""
    counts = [min(cells, len(times) - 1) for cells in CELLS]
    own = _stretch(times, values, counts[0])
    for k, cells in enumerate(counts):
        own = _stretch(times, values, cells) if k else own
        if own.cutoff * (own.stop - own.start) <= RESOLVED * cells:
            return own, True
    return own, False


def _stretch(times: np.ndarray, values: np.ndarray, cells: int) -> Stretch:
    """Return the likely weight of one stretch, by splines of so many cells."""
    from scipy.linalg import cho_solve_banded, cholesky_banded

    count, span = len(times), float(times[-1] - times[0])
    knots = np.arange(cells + 1.0)
    matrix = values_at(np.clip((times - times[0]) * (cells / span), 0.0, cells), knots)
    since = (times - times.mean()) * (2 / span)
    offset = values - np.polynomial.Polynomial.fit(since, values, PENALIZED - 1, domain=[-1, 1], window=[-1, 1])(since)
    floor = max(float(np.abs(values).max()) * np.finfo(float).eps, FLOOR * float(np.ptp(values)))
    root = penalty_root(whole(knots), np.ones(cells))
    gram, jounce, right = banded(matrix.T @ matrix), banded(root.T @ root), matrix.T @ offset
    free = cells + DEGREE - PENALIZED

    def unlikely(logarithm: float) -> tuple[float, float]:
        factor = cholesky_banded(gram + np.exp(logarithm) * jounce)
        solved = cho_solve_banded((factor, False), right)
        apart, rough = offset - matrix @ solved, root @ solved
        rest = float(apart @ apart) + np.exp(logarithm) * float(rough @ rough) + count * floor**2
        determinant = 2 * float(np.log(factor[-1]).sum())
        return (count - PENALIZED) * np.log(rest) + determinant - free * logarithm, rest

    grid = np.linspace(*RANGE, STEPS)
    costs = np.array([_safe(unlikely, x)[0] for x in grid])
    best = int(np.argmin(costs))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    for _ in range(12):  # golden section
        third = 0.381966 * (high - low)
        if _safe(unlikely, low + third)[0] < _safe(unlikely, high - third)[0]:
            high -= third
        else:
            low += third
    logarithm = (low + high) / 2
    _, rest = _safe(unlikely, logarithm)
    cell = span / cells
    weight = float(np.exp(logarithm)) * cell ** (2 * PENALIZED - 1)
    cutoff = float((count / span / weight) ** (1 / (2 * PENALIZED)))
    return Stretch(float(times[0]), float(times[-1]), weight, cutoff, float(np.sqrt(rest / (count - PENALIZED))))


def _safe(function: object, argument: float) -> tuple[float, float]:
    """Return what a function gives, and infinity where its system is not positive definite any more."""
    try:
        return function(argument)  # type: ignore[operator]
    except np.linalg.LinAlgError:
        return np.inf, np.inf
