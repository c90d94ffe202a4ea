"""The weight of jounce against distances from samples, by generalized maximum likelihood.

The samples are modeled as a motion whose jounce is white noise, plus independent noise; their likelihood has one
maximum over the weight (G. Wahba, A comparison of GCV and GML for choosing the smoothing parameter, Annals of
Statistics 13 (1985), 1378-1402), so that no noise level or bandwidth is needed. The weight is estimated for each
interval, as fast parts of a motion allow less smoothing than slow ones.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.planning.smoothing.bases import DEGREE, PENALIZED, penalty_root, values_at, whole
from jounce.planning.smoothing.dwells import noise_of

CELLS = (8, 16, 32, 64)  # of an interval: the fewest that resolve the cutoff frequency, as rounding grows with them
MOST, LEAST = 3000, 64  # samples in an interval
RESOLVED = np.pi / 2  # largest cutoff frequency times the length of a cell
RANGE = (-24.0, 20.0)  # of the natural logarithm of the weight, for cells of length 1
STEPS, FINE, REFINED = 24, 9, 2  # weights of the first grid, weights of each refinement, and number of refinements
EXCESS = 3.0  # largest plausible ratio to the noise that differences of samples show
FLOOR = 1e-7  # fraction of the range of samples: smaller noise counts as zero


@dataclasses.dataclass(frozen=True, eq=False)
class IntervalEstimate:
    """Weight, cutoff frequency and noise, estimated from the samples of an interval.

    Parameters
    ----------
    start, stop : float
        Ends of the interval, s.
    count : int
        Number of its samples.
    weight : float
        Weight of the integral of the squared jounce against the sum of squared distances, s^7.
    cutoff : float
        Frequency above which the motion does not follow the samples, rad/s.
    noise : float
        Standard deviation of the noise, rad or m.
    """

    start: float
    stop: float
    count: int
    weight: float
    cutoff: float
    noise: float

    @property
    def standard_errors(self) -> Float[np.ndarray, " derivative"]:
        """Standard deviations of position to jerk, given the samples, far from the ends.

        With the spectral density ``s`` of the noise, ``noise^2 (stop - start)/count``, that of what is not known of the
        motion is ``s/(1 + (w/cutoff)^8)``, and of its k-th derivative ``w^(2k)`` times that.
        """
        powers = 2 * np.arange(PENALIZED) + 1
        density = self.noise**2 * (self.stop - self.start) / self.count
        return np.sqrt(density * self.cutoff**powers / (2 * PENALIZED * np.sin(np.pi * powers / (2 * PENALIZED))))


def interval_estimates(
    times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"]
) -> list[IntervalEstimate]:
    """Return the estimates of intervals of samples, shorter where the motion is fast."""
    count = len(times)
    pending = [(k, min(k + MOST, count)) for k in range(0, count, MOST)]
    if len(pending) > 1 and pending[-1][1] - pending[-1][0] < MOST // 2:
        pending[-2:] = [(pending[-2][0], count)]
    estimates = []
    while pending:
        first, last = pending.pop()
        candidate, resolved = _resolved(times[first:last], values[first:last])
        if not resolved and last - first >= 2 * LEAST:
            middle = (first + last) // 2
            pending += [(first, middle), (middle, last)]
        else:
            estimates.append(candidate)
    return sorted(estimates, key=lambda estimate: estimate.start)


def _resolved(times: np.ndarray, values: np.ndarray) -> tuple[IntervalEstimate, bool]:
    """Return the estimate with the fewest cells that resolve the motion, and whether any do.

    A motion too fast for the cells counts as noise with a low cutoff frequency, so that both the cutoff frequency and
    the noise must be plausible.
    """
    likely = EXCESS * max(noise_of(times, values), FLOOR * float(np.ptp(values)))
    counts = [min(cells, len(times) - 1) for cells in CELLS]
    estimate = _estimate(times, values, counts[0])
    for k, cells in enumerate(counts):
        estimate = _estimate(times, values, cells) if k else estimate
        if estimate.cutoff * (estimate.stop - estimate.start) <= RESOLVED * cells and estimate.noise <= likely:
            return estimate, True
    return estimate, False


def _estimate(times: np.ndarray, values: np.ndarray, cells: int) -> IntervalEstimate:
    """Return the estimate of one interval, from splines with a number of cells."""
    count, span = len(times), float(times[-1] - times[0])
    matrix = values_at(np.clip((times - times[0]) * (cells / span), 0.0, cells), np.arange(cells + 1.0))
    offset = _without_cubic(times, values)
    floor = max(float(np.abs(values).max()) * np.finfo(float).eps, FLOOR * float(np.ptp(values)))
    least_cost = _least_cost(matrix, offset, count * floor**2, cells)
    freedom = cells + DEGREE - PENALIZED

    def unlikely(logarithms: Float[np.ndarray, " weight"]) -> Float[np.ndarray, " weight"]:
        residual, determinant = least_cost(np.exp(logarithms))
        return (count - PENALIZED) * np.log(residual) + determinant - freedom * logarithms

    grid = np.linspace(*RANGE, STEPS)
    costs = unlikely(grid)
    index = int(np.argmin(costs))
    for _ in range(REFINED):
        grid = np.linspace(grid[max(index - 1, 0)], grid[min(index + 1, len(grid) - 1)], FINE)
        costs = unlikely(grid)
        index = int(np.argmin(costs))
    logarithm = float(grid[index])
    if 0 < index < FINE - 1 and np.isfinite(costs[index - 1 : index + 2]).all():
        before, at, after = costs[index - 1 : index + 2]
        bend = before - 2 * at + after
        logarithm += float((grid[1] - grid[0]) * (before - after) / (2 * bend)) if bend > 0 else 0.0
    residual = float(least_cost(np.exp(np.array([logarithm])))[0][0])
    cell = span / cells
    weight = float(np.exp(logarithm)) * cell ** (2 * PENALIZED - 1)
    cutoff = float((count / span / weight) ** (1 / (2 * PENALIZED)))
    noise = float(np.sqrt(residual / (count - PENALIZED)))
    return IntervalEstimate(float(times[0]), float(times[-1]), count, weight, cutoff, noise)


def _without_cubic(times: np.ndarray, values: np.ndarray) -> Float[np.ndarray, " sample"]:
    """Return samples minus their least-squares cubic, which has no jounce."""
    scaled_times = np.clip((times - times[0]) * (2 / (times[-1] - times[0])) - 1, -1.0, 1.0)
    powers = np.polynomial.legendre.legvander(scaled_times, PENALIZED - 1)
    return values - powers @ np.linalg.lstsq(powers.T @ powers, powers.T @ values)[0]


def _least_cost(
    matrix: Any, offset: Float[np.ndarray, " sample"], floor: float, cells: int
) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Return a function from weights to the least cost of splines and the logarithm of the determinant.

    The last pivot of the system bordered by its right-hand side is the square root of the least cost, and the others
    give the determinant, so that one Cholesky factorization for each weight gives both. Costs refer to splines that
    follow the samples, or to zero, whichever costs less for the weight, so that hardly any digits cancel. If the system
    is not positive definite, both results are infinite.

    Parameters
    ----------
    matrix : sparse matrix of shape (sample, spline)
        Values of splines at the samples.
    offset : array of shape (sample,)
        The samples, rad or m.
    floor : float
        Constant added to the cost, for rounding.
    cells : int
        Number of cells, of length 1.
    """
    from scipy.linalg import cho_solve

    root = _jounce_root(cells)
    base, slope = np.zeros((2, len(root.T) + 1, len(root.T) + 1))
    base[:-1, :-1] = (matrix.T @ matrix).toarray()
    slope[:-1, :-1] = root.T @ root
    fit = np.zeros(len(root.T))
    for weight in np.exp(np.linspace(*RANGE, STEPS)):  # the first succeeds, unless cells have no samples
        try:
            factor = np.linalg.cholesky(base[:-1, :-1] + weight * slope[:-1, :-1])
        except np.linalg.LinAlgError:
            continue
        fit = cho_solve((factor, True), matrix.T @ offset)
        break
    residual, bent = offset - matrix @ fit, root @ fit
    zero_based, zero_slope = base.copy(), slope.copy()
    for system, residuals in ((base, residual), (zero_based, offset)):
        system[:-1, -1] = system[-1, :-1] = matrix.T @ residuals
        system[-1, -1] = residuals @ residuals + floor
    slope[:-1, -1] = slope[-1, :-1] = -(root.T @ bent)
    slope[-1, -1] = bent @ bent

    def least_costs(weights: Float[np.ndarray, " weight"]) -> tuple[np.ndarray, np.ndarray]:
        stiff = base[-1, -1] + weights * slope[-1, -1] > zero_based[-1, -1]
        systems = np.where(stiff[:, None, None], zero_based, base)
        systems += weights[:, None, None] * np.where(stiff[:, None, None], zero_slope, slope)
        pivots = _pivots(systems)
        return pivots[:, -1] ** 2, 2 * np.log(pivots[:, :-1]).sum(axis=1)

    return least_costs


def _pivots(systems: Float[np.ndarray, "weight row row"]) -> Float[np.ndarray, "weight row"]:
    """Return the diagonals of Cholesky factors, infinite for systems that are not positive definite."""
    try:
        return np.diagonal(np.linalg.cholesky(systems), axis1=1, axis2=2)
    except np.linalg.LinAlgError:
        if len(systems) == 1:
            return np.full(systems.shape[:2], np.inf)
        return np.concatenate([_pivots(system[None]) for system in systems])


@functools.cache
def _jounce_root(cells: int) -> Float[np.ndarray, "row spline"]:
    """Return a root of the matrix of the integrated squared jounce of splines on cells of length 1."""
    root = penalty_root(whole(np.arange(cells + 1.0)), np.ones(cells)).toarray()
    return np.asarray(np.linalg.qr(root, mode="r"))
