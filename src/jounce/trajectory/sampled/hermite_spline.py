"""Splines through samples of positions with velocities, and possibly accelerations, at the same instants."""

import math

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike
from jounce.errors import TrajectoryError
from jounce.trajectory.checks import check_samples
from jounce.trajectory.motion import SplineMotion
from jounce.trajectory.sample_errors import INTERPOLATION_SAFETY, NOISE_SAFETY, noise
from jounce.trajectory.sampled.hermite import HermiteMotion
from jounce.trajectory.splines import pieces_at

MOST = 3  # levels: positions, velocities, accelerations
WINDOW = 24  # instants over which a sample has influence
LOOKS = 4  # samples of each piece
LONGEST = 20_000  # most samples for the estimate of errors


class HermiteSplineMotion(SplineMotion):
    """The smoothest spline through samples of a law and of its first derivatives.

    Through positions and velocities the spline has degree 5 and continuous derivatives up to jerk, with accelerations
    degree 7, and up to jounce. The next derivative at each instant follows from this continuity, by a tridiagonal
    linear system. In contrast, the polynomials of a controller (`HermiteMotion`) jump in the next derivative at the
    instants.

    Parameters
    ----------
    times : array_like of shape (samples,)
        Strictly increasing instants, s, at least three.
    derivatives : array_like of shape (samples, levels)
        The law, its velocity, and possibly its acceleration: m or rad per s to the power of the order.

    Raises
    ------
    TrajectoryError
        If the numbers are not finite, the instants do not increase, or there are not two or three levels.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> t = np.linspace(0.0, 2.0, 21)
    >>> law = jn.laws.HermiteSplineMotion(t, np.stack([np.sin(t), np.cos(t)], axis=1))
    >>> [round(float(x), 4) for x in law(jn.Jet.variable(1.05, order=3)).derivatives()]
    [0.8674, 0.4976, -0.8674, -0.4976]
    """

    def __init__(self, times: ArrayLike, derivatives: ArrayLike):
        instants, table = check_samples(times, derivatives)
        if table.ndim != 2 or not 2 <= table.shape[1] <= MOST:
            message = f"samples with velocities, and accelerations, have the shape (samples, 2) or (samples, {MOST})"
            raise TrajectoryError(message, name="derivatives", value=f"shape {table.shape}")
        if len(instants) < 3:
            raise TrajectoryError("at least three samples are needed", name="times", value=len(instants))
        law = _spline(instants, table)
        pieces = np.asarray(law.coefficients)[:, :-1]
        self._set(instants[:-1], pieces, instants[-1], "refuse", samples=(instants, table[:, 0]))
        self.samples.derived = _errors(instants, table)

    @property
    def joined(self) -> int:
        """Order of the highest derivative that is continuous between pieces, two above the given ones."""
        return self.degree // 2 + 1

    def at(self, instants: Float[np.ndarray, " instants"], order: int) -> Float[np.ndarray, " instants"]:
        """Return a derivative at instants, by NumPy only."""
        return pieces_at(self, instants, order)


def _spline(times: np.ndarray, table: np.ndarray) -> HermiteMotion:
    """Return the law through samples whose next derivative makes the one above it continuous."""
    from scipy.linalg import solve_banded  # local, since the import of SciPy takes half a second

    levels, count = table.shape[1], len(times)
    steps = np.diff(times)
    start, end = _at_ends(levels)  # derivative levels + 1 of a piece of length 1, for each value at its ends
    powers = steps[:, None] ** np.arange(levels + 1)
    given_terms = np.concatenate([table[:-1] * powers[:, :levels], table[1:] * powers[:, :levels]], axis=1)
    columns = [*range(levels), *range(levels + 1, 2 * levels + 1)]
    scale = steps ** (levels + 1)
    left, right = (given_terms @ row[columns] / scale for row in (start, end))  # at both ends of each piece
    factors = steps**levels / scale
    bands, right_side = np.zeros((3, count)), np.zeros(count)
    # inside: the derivative is continuous between pieces
    bands[1, 1:-1] = end[2 * levels + 1] * factors[:-1] - start[levels] * factors[1:]
    bands[2, :-2] = end[levels] * factors[:-1]
    bands[0, 2:] = -start[2 * levels + 1] * factors[1:]
    right_side[1:-1] = left[1:] - right[:-1]
    top = _end_condition(levels)  # at the ends: the highest power of the first and of the last piece vanishes
    for row, index, neighbor in ((0, 0, 1), (count - 1, -1, -2)):
        near_column, far_column = (levels, 2 * levels + 1) if row == 0 else (2 * levels + 1, levels)
        bands[1, row] = top[near_column] * factors[index]
        bands[0 if row == 0 else 2, neighbor] = top[far_column] * factors[index]
        right_side[row] = -given_terms[index] @ top[columns] / scale[index]
    higher = solve_banded((1, 1), bands, right_side)
    return HermiteMotion(times, np.column_stack([table, higher]))


def _basis(levels: int) -> Float[np.ndarray, "powers given"]:
    """Return the powers of a piece of length 1 for each value at its ends, with one more level than is given."""
    count = levels + 1
    columns = []
    for k in range(2 * count):
        ends = np.zeros((2, count))
        ends[k // count, k % count] = 1.0
        columns.append(np.asarray(HermiteMotion([0.0, 1.0], ends).coefficients)[:, 0])
    return np.stack(columns, axis=1)


def _at_ends(levels: int) -> tuple[np.ndarray, np.ndarray]:
    basis, order = _basis(levels), levels + 1
    factors = np.array([math.perm(k, order) if k >= order else 0 for k in range(len(basis))], float)
    return factors[order] * basis[order], factors @ basis


def _end_condition(levels: int) -> Float[np.ndarray, " given"]:
    return _basis(levels)[-1]


def _errors(times: np.ndarray, table: np.ndarray) -> Float[np.ndarray, " derivative"]:
    """Return estimated relative errors of the derivatives, like `derivative_errors` for positions only.

    The error of interpolation is the difference to the spline through every second sample. The error of noise is the
    standard deviation that noise of the positions and their given derivatives causes at the worst instant of an even
    grid.
    """
    if len(times) > LONGEST:
        times, table = times[:LONGEST], table[:LONGEST]
    degree, levels = 2 * table.shape[1] + 1, table.shape[1]
    if not np.ptp(table[:, 0]) and not table[:, 1:].any():
        return np.zeros(degree + 1)
    half = np.unique(np.append(np.arange(0, len(times), 2), len(times) - 1))
    if len(half) < 4:
        return np.append(np.zeros(levels), np.ones(degree + 1 - levels))
    fine, coarse = _spline(times, table), _spline(times[half], table[half])
    looks = (times[:-1, None] + np.diff(times)[:, None] * np.arange(LOOKS) / LOOKS).reshape(-1)
    step = float(np.median(np.diff(times)))
    grid = np.arange(WINDOW + 1.0)
    inner = np.linspace(WINDOW / 3, WINDOW - WINDOW / 3, 8 * LOOKS + 1)
    sigmas = [noise(times, column) for column in table.T]
    duration, min_peak = float(times[-1] - times[0]), float(np.ptp(table[:, 0])) / 2
    errors = np.ones(degree + 1)
    influence = [_influence(grid, inner, levels, level, degree) for level in range(levels)]
    for k in range(degree + 1):
        curve = pieces_at(fine, looks, k)
        difference = float(np.abs(curve - pieces_at(coarse, looks, k)).max()) / (2.0 ** max(degree - k, 1) - 1)
        spread = math.hypot(
            *(s * i[k] * step ** (j - k) for j, (s, i) in enumerate(zip(sigmas, influence, strict=True)))
        )
        peak = max(float(np.abs(curve).max()), min_peak * (2 * math.pi / duration) ** k)
        errors[k] = min(1.0, (INTERPOLATION_SAFETY * difference + NOISE_SAFETY * spread) / peak)
    return errors


def _influence(grid: np.ndarray, instants: np.ndarray, levels: int, level: int, degree: int) -> list[float]:
    """Return the deviation of each derivative caused by independent noise of 1 in one level, on a grid of step 1."""
    squares = np.zeros((degree + 1, len(instants)))
    for k in range(len(grid)):
        table = np.zeros((len(grid), levels))
        table[k, level] = 1.0
        law = _spline(grid, table)
        squares += np.stack([pieces_at(law, instants, order) ** 2 for order in range(degree + 1)])
    return np.sqrt(squares.max(axis=1)).tolist()
