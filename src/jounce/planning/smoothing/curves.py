"""Splines near samples of one joint: least weighted jounce, at rest in dwells, within a deviation of every sample."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.errors import SolveError
from jounce.planning.smoothing.bases import DEGREE, Samples, banded, cost, parts_of, values_at, whole
from jounce.planning.smoothing.dwells import Dwell
from jounce.planning.smoothing.weights import IntervalEstimate
from jounce.planning.solver import cone_solver
from jounce.units.instants import time_text

CELL = np.pi / 4  # length of a cell times the cutoff frequency
GRADED = 1.6  # ratio of the lengths of neighboring cells
FEWEST = 8  # cells between two dwells
MARGIN = 1e-6  # fraction of the deviation: tolerance of the solver
ROUNDING = 32 * np.finfo(float).eps  # of the value of a spline, relative to its largest coefficient
ROUNDS, HALVINGS = 12, 12
LOOSE = 4.0  # deviations that a spline may be from lines between samples without bends
LOOKS = 8  # evaluations of the knot density in an interval
NEARBY = 32  # samples whose bends explain those of the spline
RINGING = 0.6  # ratio of neighboring half-waves with which splines ring beside a bend: 0.535 for degree 7
HALVED = 3  # cells on each side of one that is halved
PADDING = 64  # neighboring splines that move with those at samples that are too far
TOGETHER, AHEAD = 2000, 400  # splines that are solved for at once, and splines after them that are solved for again


@dataclasses.dataclass(frozen=True, eq=False)
class Curve:
    """The spline of one joint.

    Parameters
    ----------
    knots : array of shape (cell + 1,)
        Knots, s.
    coefficients : array of shape (spline,)
        Coefficients, rad or m.
    away : float
        Largest distance of the spline from a sample.
    forced : array of shape (spline,)
        What the deviation changed of the coefficients: the part of the motion that follows noise.
    """

    knots: Float[np.ndarray, " knot"]
    coefficients: Float[np.ndarray, " spline"]
    away: float
    forced: Float[np.ndarray, " spline"]


class TooFarError(Exception):
    """Raised if no spline on given knots is within the deviation of the samples."""

    def __init__(self, samples: Int[np.ndarray, " sample"]):
        super().__init__(samples)
        self.samples = samples


def smoothed_curve(
    times: Float[np.ndarray, " sample"],
    values: Float[np.ndarray, " sample"],
    deviation: float,
    estimates: Sequence[IntervalEstimate],
    dwells: Sequence[Dwell],
) -> Curve:
    """Return the spline of least cost with the estimated weights within a deviation of every sample.

    Raises
    ------
    SolveError
        If no spline is within the deviation; the message gives the instant.
    """
    knots = laid_knots(times, estimates, dwells)
    missed = np.zeros(1, int)
    for _ in range(HALVINGS):
        try:
            return _on_knots(times, values, deviation, knots, estimates, dwells)
        except TooFarError as reason:
            missed = reason.samples
            knots = _halved(knots, times, missed)
    time = float(times[missed[0]])
    message = (
        f"no smooth motion stays within the deviation of the samples near t = {time_text(time)} s; allow a larger one"
    )
    raise SolveError(message, name="deviation", value=deviation)


def laid_knots(
    times: Float[np.ndarray, " sample"], estimates: Sequence[IntervalEstimate], dwells: Sequence[Dwell]
) -> Float[np.ndarray, " knot"]:
    """Return knots, which include the ends of dwells, at distances set by the cutoff frequency."""
    ends = [times[0], *(t for d in dwells for t in (times[d.first], times[d.last])), times[-1]]
    ends = np.unique(ends)
    middles = np.array([(s.start + s.stop) / 2 for s in estimates])
    logarithms = np.log(CELL / np.array([s.cutoff for s in estimates]))
    sample_step = float(np.median(np.diff(times), overwrite_input=True))
    min_step = min(s.stop - s.start for s in estimates) / LOOKS
    dwell_ends = {(float(times[d.first]), float(times[d.last])) for d in dwells}
    grids = []
    for a, b in itertools.pairwise(ends):
        if (float(a), float(b)) in dwell_ends:
            grids.append(np.array([a]))
            continue
        grid = np.linspace(a, b, 2 + int((b - a) / max(sample_step, min_step)))
        length = np.maximum(np.exp(np.interp(grid, middles, logarithms)), sample_step / 2)
        count = np.append(0.0, np.cumsum(np.diff(grid) * 2 / (length[1:] + length[:-1])))
        samples = int(np.searchsorted(times, b) - np.searchsorted(times, a))
        cells = max(min(FEWEST, samples), int(np.ceil(count[-1])), 1)
        grids.append(np.interp(np.arange(cells) * (count[-1] / cells), count, grid))
    return np.append(np.concatenate(grids), ends[-1])


def _halved(
    knots: Float[np.ndarray, " knot"], times: Float[np.ndarray, " sample"], samples: Int[np.ndarray, " far"]
) -> Float[np.ndarray, " halved"]:
    """Return knots at half the distance near some samples, but no closer than half of the time between samples."""
    cells = np.clip(np.searchsorted(knots, times[samples], side="right") - 1, 0, len(knots) - 2)
    is_near = np.zeros(len(knots) - 1, bool)
    for offset in range(-HALVED, HALVED + 1):
        is_near[np.clip(cells + offset, 0, len(is_near) - 1)] = True
    is_near &= np.diff(knots) > np.median(np.diff(times), overwrite_input=True) / 2
    return np.sort(np.append(knots, ((knots[:-1] + knots[1:]) / 2)[is_near]))


def _on_knots(
    times: np.ndarray,
    values: np.ndarray,
    deviation: float,
    knots: np.ndarray,
    estimates: Sequence[IntervalEstimate],
    dwells: Sequence[Dwell],
) -> Curve:
    samples = Samples(times, values, knots)
    middles = (knots[:-1] + knots[1:]) / 2
    centers = np.array([(s.start + s.stop) / 2 for s in estimates])
    weights = np.exp(np.interp(middles, centers, np.log([s.weight for s in estimates]))) / samples.scale**DEGREE
    system, right = cost(samples, weights)
    coefficients, is_free = np.zeros(len(right)), np.ones(len(right), bool)
    for dwell in dwells:
        start = int(np.searchsorted(knots, times[dwell.first]))
        stop = int(np.searchsorted(knots, times[dwell.last]))
        columns = slice(start, stop + DEGREE)
        coefficients[columns], is_free[columns] = dwell.position - samples.middle, False
    for run in _runs(is_free):
        coefficients[run] = _solved(system, right, coefficients, run)
    problem = _Problem(samples, system, right, deviation)
    likely = coefficients.copy()
    coefficients = problem.within(coefficients, is_free)
    return Curve(knots, coefficients + samples.middle, problem.away, coefficients - likely)


def _runs(chosen: Bool[np.ndarray, " spline"]) -> list[slice]:
    """Return the runs of consecutive chosen splines."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _solved(system: Any, right: np.ndarray, coefficients: np.ndarray, run: slice) -> Float[np.ndarray, " spline"]:
    """Return the coefficients of a run that minimize the cost, with all others fixed."""
    from scipy.linalg import solveh_banded

    others = coefficients.copy()
    others[run] = 0.0
    target = right[run] - system[run] @ others
    bands = banded(system[run, run])
    bands[-1] *= 1 + 1e-14
    return solveh_banded(bands, target)


@dataclasses.dataclass
class _Problem:
    """Minimization of the cost within a deviation of the samples, solved only where the spline exceeds it."""

    samples: Samples
    system: Any
    right: np.ndarray
    deviation: float
    away: float = 0.0

    def within(self, coefficients: np.ndarray, is_free: np.ndarray) -> Float[np.ndarray, " spline"]:
        """Return the coefficients of a spline within the deviation."""
        missed = self._far(coefficients)
        if not len(missed):
            return coefficients
        for _ in range(ROUNDS):
            is_moved = np.zeros(len(coefficients), bool)
            for cell in np.unique(self._cells(missed)):
                is_moved[max(cell - PADDING, 0) : cell + DEGREE + 1 + PADDING] = True
            is_moved &= is_free
            if not is_moved.any():
                raise TooFarError(missed)
            for run in _runs(is_moved):
                for chunk in _parts(run):
                    self._move(coefficients, chunk, run.stop)
            missed = self._far(coefficients)
            if not len(missed):
                missed = self._swings(coefficients)
                break
        if len(missed):
            raise TooFarError(missed)
        return coefficients

    def _cells(self, samples: Int[np.ndarray, " some"]) -> Int[np.ndarray, " some"]:
        """Return the cells of samples, whose numbers are also those of the first nonzero splines at the samples."""
        knots = self.samples.knots
        return np.clip(np.searchsorted(knots, self.samples.times(samples), side="right") - 1, 0, len(knots) - 2)

    def _far(self, coefficients: np.ndarray) -> Int[np.ndarray, " far"]:
        """Return the samples farther away than the deviation, and store the largest distance."""
        from scipy.interpolate import BSpline

        spline, missed, self.away = BSpline(whole(self.samples.knots), coefficients, DEGREE), [np.zeros(0, int)], 0.0
        for chunk in parts_of(len(self.samples)):
            distances = np.abs(spline(self.samples.times(chunk)) - self.samples.values(chunk))
            self.away = max(self.away, float(distances.max()))
            missed.append(chunk.start + np.flatnonzero(distances > self.deviation))
        return np.concatenate(missed)

    def _swings(self, coefficients: np.ndarray) -> Int[np.ndarray, " some"]:
        """Return the samples before intervals in which a spline swings by more than the bends of samples explain."""
        from scipy.interpolate import BSpline

        spline = BSpline(whole(self.samples.knots), coefficients, DEGREE)
        swings = [np.zeros(0, int)]
        for part in parts_of(len(self.samples)):
            chunk = slice(max(part.start - NEARBY, 0), part.stop + NEARBY)
            times, values = self.samples.times(chunk), self.samples.values(chunk)
            steps = np.diff(times)
            bends = np.abs(np.diff(np.diff(values) / steps)) * 2 / (steps[1:] + steps[:-1])
            logarithms = np.log(np.maximum(np.append(bends, 0.0), np.append(0.0, bends)) + 1e-300)
            falls = np.log(RINGING) * np.arange(len(steps))
            before = np.maximum.accumulate(logarithms - falls) + falls
            after = np.maximum.accumulate((logarithms + falls)[::-1])[::-1] - falls
            allowed = np.exp(np.maximum(before, after)) * steps**2 + LOOSE * self.deviation
            departures = np.abs(spline((times[1:] + times[:-1]) / 2) - (values[1:] + values[:-1]) / 2)
            swings.append(chunk.start + np.flatnonzero(departures > allowed))
        return np.unique(np.concatenate(swings))

    def _move(self, coefficients: np.ndarray, run: slice, last: int) -> None:
        """Change a run of coefficients such that all samples under its splines are within the deviation.

        If the run goes on to another ``last``, samples under splines beyond it do not count: those are not moved yet.
        """
        from scipy import sparse

        clarabel = cone_solver()
        knots = self.samples.knots
        stop = run.stop if run.stop == last else run.stop - DEGREE
        ends = knots[[max(run.start - DEGREE, 0), min(stop, len(knots) - 1)]]
        side = "right" if stop >= len(knots) - 1 else "left"
        rows = np.arange(self.samples.place(ends[0]), self.samples.place(ends[1], side))
        matrix = values_at(self.samples.times(rows), knots)
        columns = matrix[:, run]
        residual = self.samples.values(rows) - matrix @ coefficients
        target = self.right[run] - self.system[run] @ coefficients
        size = self.deviation
        inside = 1 - MARGIN - ROUNDING * float(np.abs(coefficients).max()) / size
        distances = np.abs(residual) / size
        limits = np.maximum(inside, np.where(distances <= 1, distances, 0.0))  # splines at the ends hardly move samples
        bounds = np.concatenate([limits + residual / size, limits - residual / size])
        quadratic = sparse.triu(self.system[run, run], format="csc")
        top = float(quadratic.diagonal().max())
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        solver = clarabel.DefaultSolver(
            quadratic / top,
            -target / (top * size),
            sparse.vstack([columns, -columns], format="csc"),
            bounds,
            [clarabel.NonnegativeConeT(2 * len(rows))],
            settings,
        )
        solution = solver.solve()
        if "Solved" not in str(solution.status):
            missed = rows[distances > 1]
            raise TooFarError(missed if len(missed) else rows[:1])
        coefficients[run] += np.array(solution.x) * size


def _parts(run: slice) -> list[slice]:
    """Return overlapping parts of a long run."""
    starts = range(run.start, max(run.stop - AHEAD, run.start + 1), TOGETHER)
    return [slice(k, min(k + TOGETHER + AHEAD, run.stop)) for k in starts]
