"""Splines near samples of one joint: least jounce by weight, still in dwells, within a deviation of every sample."""

from __future__ import annotations

import dataclasses
import importlib
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.errors import SolveError
from jounce.planning.smoothing.bases import DEGREE, banded, penalty_root, values_at
from jounce.planning.smoothing.dwells import Dwell
from jounce.planning.smoothing.weights import Stretch

CELL = np.pi / 4  # length of a cell times the cutoff frequency
GRADED = 1.6  # ratio of the lengths of cells beside each other
FEWEST = 8  # cells of a time between dwells
INSIDE = 1 - 1e-6  # of the deviation: what a solver leaves
ROUNDS, HALVINGS = 12, 12
HALVED = 3  # cells on each side of one that is halved
PADDING = 24  # splines beside those at samples that are too far, which move with them
TOGETHER = 400  # splines that are moved at once, about


@dataclasses.dataclass(frozen=True, eq=False)
class Curve:
    """A spline, as it is found.

    Parameters
    ----------
    knots : array of shape (cell + 1,)
        s.
    coefficients : array of shape (spline,)
        rad or m.
    away : float
        Its largest distance from a sample.
    """

    knots: Float[np.ndarray, " knot"]
    coefficients: Float[np.ndarray, " spline"]
    away: float


class TooFarError(Exception):
    """No spline on these knots is within the deviation of a sample."""

    def __init__(self, samples: Int[np.ndarray, " sample"]):
        super().__init__(samples)
        self.samples = samples


def smoothed_curve(
    times: Float[np.ndarray, " sample"],
    values: Float[np.ndarray, " sample"],
    deviation: float,
    stretches: Sequence[Stretch],
    dwells: Sequence[Dwell],
) -> Curve:
    """Return the spline that is within a deviation of every sample, and otherwise as smooth as samples say.

    Raises
    ------
    SolveError
        If none is: the value is the instant.
    """
    knots = laid_knots(times, stretches, dwells)
    far = np.zeros(1, int)
    for _ in range(HALVINGS):
        try:
            return _on_knots(times, values, deviation, knots, stretches, dwells)
        except TooFarError as reason:
            far = reason.samples
            knots = _halved(knots, times, far)
    at = float(times[far[0]])
    raise SolveError("no smooth motion is within the deviation of the samples", name="deviation", value=at)


def laid_knots(
    times: Float[np.ndarray, " sample"], stretches: Sequence[Stretch], dwells: Sequence[Dwell]
) -> Float[np.ndarray, " knot"]:
    """Return knots as near one another as what is followed asks for, among them the ends of dwells."""
    ends = [times[0], *(t for d in dwells for t in (times[d.first], times[d.last])), times[-1]]
    ends = np.unique(ends)
    at = np.array([(s.start + s.stop) / 2 for s in stretches])
    logarithms = np.log(CELL / np.array([s.cutoff for s in stretches]))
    shortest = float(np.median(np.diff(times)))
    still = {(float(times[d.first]), float(times[d.last])) for d in dwells}
    parts = []
    for a, b in itertools.pairwise(ends):
        if (float(a), float(b)) in still:
            parts.append(np.array([a]))
            continue
        grid = np.linspace(a, b, 2 + int((b - a) / max(shortest, (b - a) / 20_000)))
        length = np.maximum(np.exp(np.interp(grid, at, logarithms)), shortest)
        count = np.append(0.0, np.cumsum(np.diff(grid) * 2 / (length[1:] + length[:-1])))
        samples = int(np.searchsorted(times, b) - np.searchsorted(times, a))
        cells = max(min(FEWEST, samples), int(np.ceil(count[-1])), 1)
        parts.append(np.interp(np.arange(cells) * (count[-1] / cells), count, grid))
    return np.append(np.concatenate(parts), ends[-1])


def _halved(
    knots: Float[np.ndarray, " knot"], times: Float[np.ndarray, " sample"], samples: Int[np.ndarray, " far"]
) -> Float[np.ndarray, " halved"]:
    """Return knots twice as near one another about samples, but no nearer than half of the time between samples."""
    cells = np.clip(np.searchsorted(knots, times[samples], side="right") - 1, 0, len(knots) - 2)
    near = np.zeros(len(knots) - 1, bool)
    for beside in range(-HALVED, HALVED + 1):
        near[np.clip(cells + beside, 0, len(near) - 1)] = True
    near &= np.diff(knots) > np.median(np.diff(times)) / 2
    return np.sort(np.append(knots, ((knots[:-1] + knots[1:]) / 2)[near]))


def _on_knots(
    times: np.ndarray,
    values: np.ndarray,
    deviation: float,
    knots: np.ndarray,
    stretches: Sequence[Stretch],
    dwells: Sequence[Dwell],
) -> Curve:
    scale = float(np.median(np.diff(knots)))
    local = (knots - knots[0]) / scale
    matrix = values_at(np.clip((times - knots[0]) / scale, 0.0, local[-1]), local)
    middles = (knots[:-1] + knots[1:]) / 2
    at = np.array([(s.start + s.stop) / 2 for s in stretches])
    weights = np.exp(np.interp(middles, at, np.log([s.weight for s in stretches]))) / scale**DEGREE
    root = penalty_root(local, weights)
    system = (matrix.T @ matrix + root.T @ root).tocsr()
    middle = float(values.mean())
    right = matrix.T @ (values - middle)
    found, free = np.zeros(matrix.shape[1]), np.ones(matrix.shape[1], bool)
    for dwell in dwells:
        first = int(np.searchsorted(knots, times[dwell.first]))
        last = int(np.searchsorted(knots, times[dwell.last]))
        own = slice(first, last + DEGREE)
        found[own], free[own] = dwell.position - middle, False
    for run in _runs(free):
        found[run] = _solved(system, right, found, run)
    problem = _Problem(matrix, system, right, values - middle, deviation, times)
    return Curve(knots, problem.within(found, free) + middle, problem.away)


def _runs(chosen: Bool[np.ndarray, " spline"]) -> list[slice]:
    """Return stretches of splines that are chosen."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _solved(system: Any, right: np.ndarray, found: np.ndarray, run: slice) -> Float[np.ndarray, " spline"]:
    """Return coefficients of a run that minimize the cost, those beside it being what they are."""
    from scipy.linalg import solveh_banded

    fixed = found.copy()
    fixed[run] = 0.0
    target = right[run] - system[run] @ fixed
    bands = banded(system[run, run])
    bands[-1] *= 1 + 1e-14
    return solveh_banded(bands, target)


@dataclasses.dataclass
class _Problem:
    """The least cost within a deviation of the samples: only where that is not kept already."""

    matrix: Any
    system: Any
    right: np.ndarray
    values: np.ndarray
    deviation: float
    times: np.ndarray
    away: float = 0.0

    def within(self, found: np.ndarray, free: np.ndarray) -> Float[np.ndarray, " spline"]:
        """Return coefficients within the deviation."""
        columns = self.matrix.indices.reshape(len(self.values), DEGREE + 1)
        for _ in range(ROUNDS):
            apart = np.abs(self.matrix @ found - self.values)
            self.away = float(apart.max())
            far = np.flatnonzero(apart > self.deviation)
            if not len(far):
                return found
            moved = np.zeros(len(found), bool)
            for sample in _spread(columns, far):
                moved[max(sample - PADDING, 0) : sample + DEGREE + 1 + PADDING] = True
            moved &= free
            if not moved.any():
                raise TooFarError(far)
            for run in _runs(moved):
                for part in _parts(run):
                    self._move(found, part, columns)
        raise TooFarError(np.flatnonzero(np.abs(self.matrix @ found - self.values) > self.deviation))

    def _move(self, found: np.ndarray, run: slice, columns: np.ndarray) -> None:
        """Solve for a run of coefficients, all samples that they reach being within the deviation."""
        clarabel, sparse = _solver()
        rows = np.flatnonzero((columns[:, -1] >= run.start) & (columns[:, 0] < run.stop))
        fixed = found.copy()
        fixed[run] = 0.0
        own = self.matrix[rows][:, run]
        rest = self.values[rows] - self.matrix[rows] @ fixed
        target = self.right[run] - self.system[run] @ fixed
        size = self.deviation
        bound = np.concatenate([rest / size + INSIDE, INSIDE - rest / size])
        quadratic = sparse.triu(self.system[run, run], format="csc")
        top = float(quadratic.diagonal().max())
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        solver = clarabel.DefaultSolver(
            quadratic / top,
            -target / (top * size),
            sparse.vstack([own, -own], format="csc"),
            bound,
            [clarabel.NonnegativeConeT(2 * len(rows))],
            settings,
        )
        solution = solver.solve()
        if "Solved" not in str(solution.status):
            far = rows[np.abs(own @ found[run] - rest) > self.deviation]
            raise TooFarError(far if len(far) else rows[:1])
        found[run] = np.array(solution.x) * size


def _spread(columns: Int[np.ndarray, "sample own"], far: Int[np.ndarray, " far"]) -> Int[np.ndarray, " first"]:
    return np.unique(columns[far, 0])


def _parts(run: slice) -> list[slice]:
    """Return parts of a long run that overlap."""
    count = run.stop - run.start
    if count <= 2 * TOGETHER:
        return [run]
    firsts = range(run.start, run.stop - TOGETHER, TOGETHER)
    return [slice(k, min(k + TOGETHER + 4 * DEGREE, run.stop) if k != firsts[-1] else run.stop) for k in firsts]


def _solver() -> tuple[Any, Any]:
    from scipy import sparse

    from jounce.planning.retiming.program import require_solver

    require_solver()
    return importlib.import_module("clarabel"), sparse
