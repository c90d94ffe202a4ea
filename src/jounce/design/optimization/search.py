"""A search from one start: sequential quadratic programming with exact slopes, in regions where no design locks.

The variables of SciPy's SLSQP are the parameters and, for each extreme with which a goal increases, a bound of the
values in the cells of time. A step to a design that locks is rejected: the search continues from the best design so
far, in a smaller region. A constraint keeps designs from locking: the smallest singular value of the Jacobian, which
vanishes where a mechanism locks, stays above a bound at every instant.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.design.optimization.multipliers import ACTIVE, Known, Multipliers, Vector
from jounce.design.optimization.problem import Evaluation, Locked, Problem

ACCURACY = 1e-13  # of SLSQP, relative
EACH = 2  # largest number of designs evaluated for each permitted iteration
ROUNDS = 12  # largest number of regions
SMALLEST_REGION = 1e-7  # fraction of the width between bounds
CONDITION_TOLERANCE = 1e-7  # permitted violation of a condition, relative to its size
SMALL = 1e-6  # fraction of the first objective: a smaller objective counts as zero
FITTED = 1e-6  # tolerance of the residual of the first-order conditions after least squares
LOCKED = 1e3  # relative value of a design that locks, from which the line search of SLSQP retreats


@dataclasses.dataclass(frozen=True, eq=False)
class SearchResult:
    """The result of a search.

    Attributes
    ----------
    point : array of shape (parameters,)
        Parameters, scaled from 0 to 1 between the bounds.
    evaluation : Evaluation
    objective : float
        The objective of the optimizer, which may be the square of the stated one.
    broken : array of shape (conditions,)
        Violation of each condition, relative to its size.
    near_singular : float
        Relative distance of the smallest singular value below its bound.
    residual : float
        Residual of the conditions of Karush, Kuhn and Tucker, relative to the slope of the objective.
    multipliers : array of shape (conditions,)
        Slope of the objective by each condition.
    bound_multipliers : array of shape (parameters,)
        Slope of the objective by a lower bound (positive) or an upper one (negative), by the point.
    """

    point: Vector
    evaluation: Evaluation
    objective: float
    broken: Vector
    near_singular: float
    residual: float
    multipliers: Vector
    bound_multipliers: Vector

    @property
    def feasible(self) -> bool:
        """Whether all conditions hold."""
        return bool(
            np.isfinite(self.objective)
            and (self.broken <= CONDITION_TOLERANCE).all()
            and self.near_singular <= CONDITION_TOLERANCE
        )


class _EvaluationLimitError(Exception):
    """Raised if a run has evaluated its largest number of designs."""


class Search:
    """A search in a problem.

    Parameters
    ----------
    problem : Problem
    clearance : float
        Bound of the smallest singular value.
    iterations : int
        Largest number of iterations of SLSQP in one region.
    watch : callable, optional
        Called for every evaluated design, with its objective and its worst violation.
    """

    def __init__(
        self,
        problem: Problem,
        clearance: float,
        iterations: int,
        watch: Callable[[float, float], None] | None = None,
    ):
        self.problem, self.clearance, self.iterations, self.watch = problem, clearance, iterations, watch
        self.bounded = np.flatnonzero(problem.goals.bounded)
        self.equal = np.array([c.relation.equal for c in problem.goals.conditions], bool)
        self.sizes = np.ones(len(self.equal))
        self.scale = self.stated_scale = 1.0

    def from_point(self, point: Vector, *, elastic: bool = False) -> SearchResult:
        """Search from a point that does not lock.

        Parameters
        ----------
        elastic : bool, default False
            Minimize the worst violation instead of the objective.
        """
        evaluation = self.problem.evaluate(point)
        self._set_scales(evaluation)
        best, radius = point, 1.0
        if self.problem.goals.gaps is not None and not elastic:
            fitted = self.result_at(self._fitted(point))
            if fitted.feasible and (fitted.residual <= FITTED or fitted.objective <= ACCURACY * self.scale):
                return fitted
            best = fitted.point
        for _ in range(ROUNDS):
            attempt = _Run(self, best, radius, elastic=elastic)
            locked, is_inside = attempt.run()
            shift = float(np.abs(attempt.best - best).max(initial=0.0))
            is_better, best = attempt.merit_of(attempt.best) < attempt.merit_of(best), attempt.best
            if locked is not None:
                radius = min(radius / 4, max(float(np.abs(locked.point - best).max()) / 2, SMALLEST_REGION))
                if radius <= SMALLEST_REGION:
                    break
            elif is_inside or (not is_better and shift < ACTIVE):
                if elastic or radius <= SMALLEST_REGION or self.result_at(best).residual <= FITTED:
                    break
                radius /= 4  # not optimal: shorter steps are less likely to lock
            else:
                radius *= 4
        return self.result_at(best)

    def _fitted(self, point: Vector) -> Vector:
        """Return a better point by nonlinear least squares, which uses each distance, not only their sum."""
        from scipy.optimize import least_squares  # importing SciPy takes half a second

        chosen = np.array(self.problem.goals.gaps)

        def gaps(point: Vector) -> Vector:
            try:
                evaluation = self.problem.evaluate(point)
            except Locked:
                return np.full(len(chosen), LOCKED * np.sqrt(self.scale))
            if self.watch is not None:
                self.watch(self.problem.stated(point, evaluation)[0], 0.0)
            return evaluation.smooth[chosen]

        def slopes(point: Vector) -> Float[np.ndarray, "gap parameter"]:
            return self.problem.evaluate(point).smooth_slopes[chosen]

        tolerances: Any = {"xtol": ACCURACY, "ftol": ACCURACY, "gtol": ACCURACY, "jac": slopes}
        start = np.clip(point, 1e-10, 1 - 1e-10)
        fit = least_squares(gaps, start, bounds=(0.0, 1.0), max_nfev=self.iterations, **tolerances)
        rounded = np.where(fit.x < ACTIVE, 0.0, np.where(fit.x > 1 - ACTIVE, 1.0, fit.x))
        return min((point, fit.x, rounded), key=self._fitness)

    def _fitness(self, point: Vector) -> tuple[float, float]:
        """Return the key that compares points: the worst violation, then the objective."""
        try:
            evaluation = self.problem.evaluate(point)
        except Locked:
            return np.inf, np.inf
        numbers, _ = self.problem.numbers(point, self.problem.extremes(evaluation)[0], evaluation.smooth)
        violation = max(self.near_singular(evaluation), float(self.broken(numbers[1:]).max(initial=0.0)))
        return (violation if violation > CONDITION_TOLERANCE else 0.0), float(numbers[0])

    def result_at(self, point: Vector) -> SearchResult:
        """Return the result at a point: values, violations, multipliers."""
        evaluation = self.problem.evaluate(point)
        extremes, chosen = self.problem.extremes(evaluation)
        numbers, slopes = self.problem.numbers(point, extremes, evaluation.smooth)
        broken = self.broken(numbers[1:], self._sizes_at(evaluation))
        singular_violation = self.near_singular(evaluation)
        kkt = Multipliers(self._known(float(numbers[0])), evaluation, numbers, slopes, extremes, chosen)
        return SearchResult(point, evaluation, float(numbers[0]), broken, singular_violation, *kkt.solved())

    def _known(self, objective: float) -> Known:
        goals, size = self.problem.goals, abs(objective)
        if goals.objective is not goals.objective_value:  # a square, whose slope is proportional to the root
            size = float(np.sqrt(size * self.scale))
        scales = self.clearance, max(size, SMALL * self.scale)
        return Known(self.bounded, self.equal, self.sizes, self.extreme_sizes, self.problem.owner, *scales)

    def broken(self, numbers: Vector, sizes: Vector | None = None) -> Vector:
        """Return the violations of conditions relative to their sizes, by default those at the start."""
        excess = np.where(self.equal, np.abs(numbers), np.maximum(numbers, 0.0))
        return excess / (self.sizes if sizes is None else sizes)

    def _sizes_at(self, evaluation: Evaluation) -> Vector:
        """Return the sizes of conditions at a design, or those at the start if a side is zero."""
        pairs = np.abs(np.array(self.problem.stated(evaluation.point, evaluation)[2])).reshape(-1, 2)
        return np.where((pairs > 0).all(axis=1), np.minimum(pairs.max(axis=1, initial=0.0), self.sizes), self.sizes)

    def near_singular(self, evaluation: Evaluation) -> float:
        """Return the relative distance of the smallest singular value below its bound."""
        smallest = float(np.sqrt(evaluation.margins.min(initial=np.inf)))
        return max(0.0, 1.0 - smallest / self.clearance) if self.clearance else 0.0

    def _set_scales(self, evaluation: Evaluation) -> None:
        extremes, _ = self.problem.extremes(evaluation)
        objective, _, sides = self.problem.stated(evaluation.point, evaluation)
        numbers, _ = self.problem.numbers(evaluation.point, extremes, evaluation.smooth)
        self.scale = abs(float(numbers[0])) or abs(objective) or 1.0
        self.stated_scale = abs(objective) or self.scale
        self.sizes = np.array([max(map(abs, pair)) or 1.0 for pair in sides])
        self.extreme_sizes = np.array([_size(evaluation.rows[self.problem.owner == k]) for k in range(len(extremes))])


def _size(rows: Vector) -> float:
    return float(np.abs(rows).max(initial=0.0)) or 1.0


class _Run:
    """SLSQP in one region; its variables are the point and one bound for each replaced extreme."""

    def __init__(self, search: Search, start: Vector, radius: float, *, elastic: bool):
        self.search, self.problem, self.start, self.radius, self.elastic = (
            search,
            search.problem,
            start,
            radius,
            elastic,
        )
        self.count = len(start)
        self.low, self.high = np.maximum(start - radius, 0.0), np.minimum(start + radius, 1.0)
        evaluation = self.problem.evaluate(start)
        self.extremes = search.bounded
        numbers = self._extremes(evaluation)[self.extremes] / search.extreme_sizes[self.extremes]
        violation = self.merit_parts(evaluation)[1] if elastic else 0.0
        self.first = np.concatenate([start, numbers, [violation] * elastic])
        self.best, self._best_merit = start, self.merit_of(start)
        self.evaluations = 0
        self._last = self._inequalities(self.first)[0]

    def run(self) -> tuple[Locked | None, bool]:
        """Return the design that locked, if any, and whether the result is off the bounds of the region."""
        from scipy.optimize import minimize  # importing SciPy takes half a second

        bounds = [*zip(self.low, self.high, strict=True)] + [(None, None)] * (len(self.first) - self.count)
        constraints: list[Any] = [{"type": "ineq", "fun": self._above, "jac": self._above_slopes}]
        if self.search.equal.any() and not self.elastic:
            constraints.append({"type": "eq", "fun": self._zero, "jac": self._zero_slopes})
        options = {"maxiter": self.search.iterations, "ftol": ACCURACY}
        try:
            minimize(
                self._objective,
                self.first,
                jac=self._objective_slopes,
                bounds=bounds,
                constraints=constraints,
                method="SLSQP",
                options=options,
            )
        except Locked as locked:
            return locked, False
        except _EvaluationLimitError:
            return None, True
        is_inside = (self.best > self.low + ACTIVE * self.radius) | (self.low <= 0.0)
        is_inside &= (self.best < self.high - ACTIVE * self.radius) | (self.high >= 1.0)
        return None, bool(is_inside.all())

    # designs compared

    def merit_parts(self, evaluation: Evaluation) -> tuple[float, float]:
        """Return the objective and the worst violation, both relative."""
        numbers, _ = self.problem.numbers(evaluation.point, self._extremes(evaluation), evaluation.smooth)
        broken = self.search.broken(numbers[1:])
        violation = max(float(broken.max(initial=0.0)), self.search.near_singular(evaluation))
        return float(numbers[0]) / self.search.scale, violation

    def merit_of(self, point: Vector) -> tuple[float, float]:
        """Return the key that compares designs: the worst violation, then the objective."""
        objective, worst = self.merit_parts(self.problem.evaluate(point))
        return (worst, 0.0) if self.elastic else (worst if worst > CONDITION_TOLERANCE / 2 else 0.0, objective)

    def _locks(self, variables: Vector) -> bool:
        """Return whether a design locks, and therefore has no slopes."""
        try:
            self._split(variables)
        except Locked:
            return True
        return False

    def _seen(self, point: Vector) -> Evaluation:
        previous_count = self.problem.evaluations
        evaluation = self.problem.evaluate(point)
        if self.problem.evaluations != previous_count:
            self.evaluations += 1
            if self.evaluations > EACH * self.search.iterations:
                raise _EvaluationLimitError
            merit = self.merit_of(point)
            if merit < self._best_merit:
                self.best, self._best_merit = np.array(point), merit
            if self.search.watch is not None:
                self.search.watch(self.problem.stated(evaluation.point, evaluation)[0], self.merit_parts(evaluation)[1])
        return evaluation

    # functions for SLSQP

    def _extremes(self, evaluation: Evaluation) -> Vector:
        return self.problem.extremes(evaluation)[0]

    def _split(self, variables: Vector) -> tuple[Evaluation, Vector]:
        """Return the evaluated design, and the extremes, some replaced by the variables of SLSQP."""
        evaluation = self._seen(np.clip(variables[: self.count], self.low, self.high))
        extremes = self._extremes(evaluation)
        values = variables[self.count : self.count + len(self.extremes)]
        extremes[self.extremes] = values * self.search.extreme_sizes[self.extremes]
        return evaluation, extremes

    def _goals(self, variables: Vector) -> tuple[Vector, Float[np.ndarray, "goal variable"]]:
        """Return the objective and conditions, and their slopes by the variables."""
        evaluation, extremes = self._split(variables)
        numbers, (by_parameter, by_extreme, by_smooth) = self.problem.numbers(
            evaluation.point, extremes, evaluation.smooth
        )
        slopes = by_parameter + by_smooth @ evaluation.smooth_slopes
        _, chosen = self.problem.extremes(evaluation)
        unbounded = np.setdiff1d(np.arange(len(extremes)), self.extremes)
        slopes = slopes + by_extreme[:, unbounded] @ evaluation.row_slopes[chosen[unbounded]]
        bounded_slopes = by_extreme[:, self.extremes] * self.search.extreme_sizes[self.extremes]
        return numbers, np.concatenate([slopes, bounded_slopes, np.zeros((len(numbers), int(self.elastic)))], axis=1)

    def _objective(self, variables: Vector) -> float:
        if self._locks(variables):
            return LOCKED
        return float(variables[-1]) if self.elastic else float(self._goals(variables)[0][0] / self.search.scale)

    def _objective_slopes(self, variables: Vector) -> Vector:
        if self.elastic:
            return np.eye(len(variables))[-1]
        return self._goals(variables)[1][0] / self.search.scale

    def _inequalities(self, variables: Vector) -> tuple[Vector, Float[np.ndarray, "row variable"]]:
        """Return the rows that must not be negative: conditions, bounds of extremes minus rows, singular values."""
        search, evaluation = self.search, self._split(variables)[0]
        numbers, slopes = self._goals(variables)
        scaled, scaled_slopes = numbers[1:] / search.sizes, slopes[1:] / search.sizes[:, None]
        is_inequality = ~search.equal
        blocks = [(-scaled[is_inequality], -scaled_slopes[is_inequality])]
        if self.elastic:  # two inequalities replace an equality
            blocks += [(-scaled[search.equal], -scaled_slopes[search.equal])]
            blocks += [(scaled[search.equal], scaled_slopes[search.equal])]
            blocks = [(v + variables[-1], np.concatenate([s[:, :-1], np.ones((len(v), 1))], axis=1)) for v, s in blocks]
        for k, extreme in enumerate(self.extremes):
            is_owned, size = self.problem.owner == extreme, search.extreme_sizes[extreme]
            rows = np.zeros((int(is_owned.sum()), len(variables)))
            rows[:, : self.count] = -evaluation.row_slopes[is_owned] / size
            rows[:, self.count + k] = 1.0
            blocks.append((variables[self.count + k] - evaluation.rows[is_owned] / size, rows))
        if search.clearance:
            padding = np.zeros((len(evaluation.margins), len(variables) - self.count))
            slack, slope = evaluation.margins - search.clearance**2, evaluation.margin_slopes
            blocks.append((slack, np.concatenate([slope, padding], axis=1)))
        return np.concatenate([v for v, _ in blocks]), np.concatenate([s for _, s in blocks])

    def _above(self, variables: Vector) -> Vector:
        if self._locks(variables):
            return np.full_like(self._last, -LOCKED)
        self._last = self._inequalities(variables)[0]
        return self._last

    def _above_slopes(self, variables: Vector) -> Float[np.ndarray, "row variable"]:
        return self._inequalities(variables)[1]

    def _zero(self, variables: Vector) -> Vector:
        if self._locks(variables):
            return np.full(int(self.search.equal.sum()), LOCKED)
        return (self._goals(variables)[0][1:] / self.search.sizes)[self.search.equal]

    def _zero_slopes(self, variables: Vector) -> Float[np.ndarray, "row variable"]:
        return (self._goals(variables)[1][1:] / self.search.sizes[:, None])[self.search.equal]
