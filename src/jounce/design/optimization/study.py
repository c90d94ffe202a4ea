"""The search for the best design of one assembly: starts, searches, infeasible conditions, finer grids."""

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jounce.design.objectives.measures import PrescribedPath
from jounce.design.objectives.objectives import Goals
from jounce.design.optimization.law_knots import law_knots
from jounce.design.optimization.problem import LOCKS, Locked, Problem
from jounce.design.optimization.result import Comparison, OptimizedDesign
from jounce.design.optimization.samples import Samples, sampled
from jounce.design.optimization.search import CONDITION_TOLERANCE, SMALL, Search, SearchResult
from jounce.errors import DesignError, SolveError
from jounce.kinematics import Motion, Status, assemblies as all_assemblies, solve
from jounce.mechanism import Mechanism
from jounce.mechanism.laws.output_drivers import with_outputs

GRID = 121  # largest number of instants of the first grid
FINER = 4  # ratio of the numbers of instants of the grid for checks and the grid of the search
AGREED = 1e-6  # relative difference of objective and conditions on both grids
REFINEMENTS = 3
OPTIMAL = 1e-5  # residual of the first-order conditions
SAME_POSITION = 1e-6  # fraction of the spread of the bodies, or rad


@dataclasses.dataclass(frozen=True, eq=False)
class DesignRequest:
    """The objective, the conditions, the bounds, the curves and the instants of an optimization."""

    minimize: str
    subject_to: tuple[str, ...]
    bounds: dict[str, tuple[float, float]]
    curves: dict[str, PrescribedPath]
    instants: Float[np.ndarray, " time"]


class Study:
    """The search for the best design of one assembly."""

    def __init__(
        self,
        mechanism: Mechanism,
        request: DesignRequest,
        clearance: float,
        iterations: int,
        seed: int,
        progress: Callable[[int, int, float], None] | None,
    ):
        self.mechanism, self.request, self.seed, self.progress = mechanism, request, seed, progress
        self.all_instants = request.instants
        arguments = request.minimize, request.subject_to, tuple(request.bounds), request.curves
        knots = law_knots(mechanism, request.bounds, float(request.instants[0]), float(request.instants[-1]))
        self.goals = Goals(mechanism, *arguments, _thinned(request.instants, GRID), knots)
        self.problem = Problem(self.goals, request.bounds)
        self.search = Search(self.problem, clearance, iterations, self._watch)
        self.done, self.total, self.least = 0, 1, math.inf
        self.size = math.inf  # of the objective at the start of searches
        self.notes: list[str] = []
        self.searches: list[float] = []

    def _watch(self, objective: float, broken: float) -> None:
        """Report an evaluated design by the objective as stated by the user and its worst violation."""
        if broken <= CONDITION_TOLERANCE:
            self.least = min(self.least, objective)
        if self.progress is not None:
            self.progress(self.done, self.total, self.least)

    @property
    def given_point(self) -> Float[np.ndarray, " parameter"]:
        """The point of the given mechanism, clipped to the bounds."""
        values = self.mechanism.parameter_values
        return self.problem.point_of({name: values[name] for name in self.problem.names})

    def best(self, starts: int, samples: int | None) -> SearchResult:
        """Return the best result of searches from several starts.

        Raises
        ------
        DesignError
            If no design can be assembled and moved, or conditions cannot be fulfilled.
        """
        self._note_bounds()
        points, lock = [self.given_point], None
        try:
            self.problem.evaluate(self.given_point)
        except Locked as error:
            points, lock = [], error
        if starts > 1 or not points:
            sample = sampled(self.problem, samples, self.seed)
            self.notes += sample.notes(self.request.bounds)
            points += sample.best(starts - len(points))
            if not points:
                raise _infeasible_error(lock, sample)
        if lock is not None:
            self.notes.append(f"the mechanism as it is cannot be moved: {lock}")
        self.total = len(points)
        ends = list(self._ends(points))
        if not ends:
            raise DesignError("every search began at a design that locks; give a starting guess within the bounds")
        feasible = [end for end in ends if end.feasible]
        if not feasible:
            feasible = self._made_feasible(ends)
        result = min(feasible, key=lambda end: end.objective)
        return self._refined(result)

    def _ends(self, points: Sequence[Any]) -> Iterator[SearchResult]:
        for point in points:
            try:
                end = self.search.from_point(point)
            except Locked:  # a sample that moved may be in another assembly when solved individually
                continue
            self.size = min(self.size, self.search.stated_scale)
            objective = self.problem.stated(end.point, end.evaluation)[0]
            self.searches.append(objective if end.feasible else math.nan)
            self.done += 1
            if self.progress is not None:
                self.progress(self.done, self.total, self.least)
            yield end

    def _made_feasible(self, ends: Sequence[SearchResult]) -> list[SearchResult]:
        """Return designs that fulfill the conditions, from searches that minimize the worst violation first.

        Raises
        ------
        DesignError
            If there is none; the error contains the design with the smallest worst violation.
        """
        nearest = sorted(ends, key=lambda end: max(float(end.broken.max(initial=0.0)), end.near_singular))[:3]
        trials = [self.search.from_point(end.point, elastic=True) for end in nearest]
        ends = [self.search.from_point(end.point) for end in trials if end.feasible]
        feasible = [end for end in (*ends, *trials) if end.feasible]
        if feasible:
            return feasible
        best = min(trials, key=lambda end: max(float(end.broken.max(initial=0.0)), end.near_singular))
        design = self.result(self.mechanism, best, infeasible=True)
        raise DesignError(
            f"no design within the bounds was found that {self._violated_conditions(best)}", design=design
        )

    def _violated_conditions(self, end: SearchResult) -> str:
        """Return a description of the conditions that the nearest design violates."""
        _, numbers, sides = self.problem.stated(end.point, end.evaluation)
        phrases = []
        for condition, number, broken, (left, right) in zip(
            self.goals.conditions, numbers, end.broken, sides, strict=True
        ):
            if broken > CONDITION_TOLERANCE:
                text, value, bound = condition.relation.text, left, right
                if condition.relation.bound_left:
                    value, bound = right, left
                phrases.append(f"meets '{text}': nearest is {value:.6g} against {bound:.6g}, off by {abs(number):.3g}")
        if end.near_singular > CONDITION_TOLERANCE:
            phrases.append("stays clear of a singular position at all instants")
        parameters = ", ".join(f"{name} = {x:.6g}" for name, x in self.problem.values(end.point).items())
        return f"{'; and none that '.join(phrases)} (SI, at {parameters}); widen the bounds or ease the conditions"

    def _refined(self, result: SearchResult) -> SearchResult:
        """Continue the search on finer grids until its result does not depend on the grid."""
        for _ in range(REFINEMENTS):
            if self.grid_error(result) <= AGREED:
                break
            instants = self.problem.goals.instants
            self.problem.set_instants(_split(instants, 2))
            try:
                result = self.search.from_point(result.point)
            except Locked:  # between the instants; `_judged` reports it
                self.problem.set_instants(instants)
                break
        return result

    def grid_error(self, result: SearchResult) -> float:
        """Return the relative difference of objective and conditions on a finer grid; infinite if the design locks."""
        coarse, numbers, _ = self.problem.stated(result.point, result.evaluation)
        values = self.problem.values(result.point)
        try:
            objective, fine, _ = self._on(_split(self.goals.instants, FINER), self.goals.mechanism, values)
        except LOCKS:
            return math.inf
        scale = abs(coarse) if abs(coarse) > SMALL * self.size else self.size  # zero has no size
        errors = [abs(objective - coarse) / scale, *(np.abs(fine - numbers) / self.search.sizes)]
        return float(max(errors))

    def _on(
        self, instants: Any, mechanism: Mechanism, values: dict[str, float]
    ) -> tuple[float, np.ndarray, list[tuple[float, float]]]:
        """Return the objective and conditions of a design of a mechanism on another grid.

        Raises
        ------
        AssemblyError, MobilityError, SolveError
            If the design cannot be assembled, or locks.
        """
        goals, previous = self.goals, self.goals.instants
        try:
            goals.set_instants(instants)
            motion = solve(mechanism.with_parameters(**values), goals.instants, goals.order, strict=False)
            if (failures := motion.status[motion.status != Status.OK]).size:
                raise SolveError(Status(int(failures[0])).advice, status=Status(int(failures[0])))
            outputs = {name: np.asarray(x) for name, x in motion.outputs.items()}
            rows, smooth = jax.jit(lambda *arguments: goals.measured(*arguments))(values, outputs)
            extremes = np.array([float(np.max(x)) for x in rows])
            numbers = np.asarray(goals.numbers(values, extremes, np.asarray(smooth), as_stated=True))
            return float(numbers[0]), numbers[1:], goals.sides(values, extremes, np.asarray(smooth))
        finally:
            goals.set_instants(previous)

    def _note_bounds(self) -> None:
        """Add a note on parameters of the mechanism outside their bounds."""
        values = self.mechanism.parameter_values
        for name, (low, high) in self.request.bounds.items():
            if not low <= values[name] <= high:
                self.notes.append(f"{name} is {values[name]:.6g} in the mechanism, outside of its bounds")

    def result(
        self, original: Mechanism, end: SearchResult, *, assembly: int | None = None, infeasible: bool = False
    ) -> OptimizedDesign:
        """Return the design of a search, compared with the given mechanism, on a finer grid."""
        fine = _split(self.goals.instants, FINER)
        error = self.grid_error(end)
        parameters = self.problem.values(end.point)
        mechanism = self._assembled(original.with_parameters(**parameters), end, assembly)
        status, message = self._judged(end, error, infeasible=infeasible)
        try:
            final = self._on(fine, self.goals.mechanism, parameters)
        except LOCKS:
            final = self.problem.stated(end.point, end.evaluation)
        return OptimizedDesign(
            mechanism,
            parameters,
            final[0],
            status,
            message,
            tuple(self._comparisons(original, end, final)),
            float(np.sqrt(end.evaluation.margins.min(initial=np.inf))),
            end.residual,
            error,
            tuple(self.searches),
            self.problem.evaluations,
            tuple(self.notes),
        )

    def _judged(self, end: SearchResult, error: float, *, infeasible: bool) -> tuple[str, str]:
        """Return the status of a design, and its meaning in words."""
        if infeasible or not end.feasible:
            return "infeasible", "conditions do not hold"
        if math.isinf(error):
            return "feasible", (
                "between the instants the design locks, or its objective or a condition is not finite; give more "
                "instants, so that the search keeps away from there"
            )
        if not error <= AGREED:
            return "feasible", (
                f"objective and conditions differ by {error:.1e} on a finer grid; motion laws or forces may not be "
                "smooth, or too few instants are given"
            )
        if not end.residual <= OPTIMAL:
            return "feasible", (
                f"the search ended before no better design was near (first-order residual {end.residual:.1e}); "
                "take more iterations or starts"
            )
        note = f"; the best of {len(self.searches)} searches" if len(self.searches) > 1 else ""
        return "optimal", f"no design nearby is better, and all conditions hold{note}"

    def _comparisons(
        self, original: Mechanism, end: SearchResult, final: tuple[float, np.ndarray, list[Any]]
    ) -> Iterator[Comparison]:
        """Yield objective, conditions and parameters of the given mechanism and of the design."""
        all_values = original.parameter_values  # possibly outside of the bounds
        initial_values = {name: float(all_values[name]) for name in self.problem.names}
        unchanged = with_outputs(original, self.goals.mechanism.outputs)  # in its own assembly, not that of this study
        try:
            initial = self._on(_split(self.goals.instants, FINER), unchanged, initial_values)
        except LOCKS:
            nothing = [(math.nan, math.nan)] * len(self.goals.conditions)
            initial = math.nan, np.full(len(self.goals.conditions), math.nan), nothing
        root = end.objective and final[0] and self.goals.objective is not self.goals.objective_value
        factor = 0.5 / final[0] if root else 1.0  # from slopes of a square to slopes of its root
        yield Comparison("objective", self.request.minimize, initial[0], final[0])
        rows = zip(self.goals.conditions, initial[2], final[2], end.multipliers, strict=True)
        for condition, initial_sides, final_sides, multiplier in rows:
            relation = condition.relation
            is_left_fixed = relation.bound_left
            measure, bound = (1, final_sides[0]) if is_left_fixed else (0, final_sides[1])
            low = bound if relation.equal or is_left_fixed else None
            high = bound if relation.equal or not is_left_fixed else None
            slope = float(multiplier * factor * (1.0 if is_left_fixed else -1.0))
            yield Comparison("condition", relation.text, initial_sides[measure], final_sides[measure], low, high, slope)
        values = self.problem.values(end.point)
        for k, (name, (low, high)) in enumerate(self.request.bounds.items()):
            slope = float(end.bound_multipliers[k]) * factor / float(self.problem.width[k])
            yield Comparison("parameter", name, initial_values[name], values[name], low, high, slope)

    def _assembled(self, mechanism: Mechanism, end: SearchResult, assembly: int | None) -> Mechanism:
        """Return a mechanism that selects the optimized assembly, by its number in the optimized design."""
        if assembly is None:
            return mechanism
        first = self.goals.instants[:1]
        target = _configuration(solve(self.problem.design(end.point), first, 0))
        for candidate in all_assemblies(mechanism, float(first[0]), circuits=False):
            chosen = dataclasses.replace(mechanism, assembly=candidate.number)
            if np.abs(_configuration(solve(chosen, first, 0)) - target).max() <= SAME_POSITION:
                return chosen
        message = "the assembly of the best design was not found again among the assemblies of that design"
        raise DesignError(message, name="assemblies", value=assembly)


def _infeasible_error(lock: Locked | None, sample: Samples) -> DesignError:
    """Return the error for the case that no design can be assembled and moved."""
    reason = "" if lock is None else f"; the mechanism as it is: {lock}"
    if (sample.status == Status.LOCKED).all():
        locks = f"friction locks in all {sample.count} designs within the bounds"
        return DesignError(f"{locks}; give bounds within which it does not{reason}")
    bounds = "give bounds within which it can be, or a starting guess nearer to them"
    return DesignError(f"none of {sample.count} designs within the bounds can be assembled and moved; {bounds}{reason}")


def _configuration(motion: Motion) -> Float[np.ndarray, " entry"]:
    """Return the first configuration of a motion: positions over their spread, and attitudes without whole turns.

    Bodies on fixed pivots have the same position in all assemblies.
    """
    coordinates = {name: np.asarray(x[0]) for name, x in motion.poses[1].items()}
    if "angle" in coordinates:
        attitude = np.stack([np.cos(coordinates["angle"]), np.sin(coordinates["angle"])])
    else:  # a quaternion and its negative are the same attitude
        attitude = coordinates["quaternion"][:, None] * coordinates["quaternion"]
    position = coordinates["position"]
    return np.concatenate([position.ravel() / (np.ptp(position) or 1.0), attitude.ravel()])


def _thinned(instants: Float[np.ndarray, " given"], max_count: int) -> Float[np.ndarray, " time"]:
    """Return at most a number of the instants, evenly chosen, with both ends."""
    if len(instants) <= max_count:
        return instants
    return instants[np.unique(np.linspace(0, len(instants) - 1, max_count).round().astype(int))]


def _split(instants: Float[np.ndarray, " given"], count: int) -> Float[np.ndarray, " time"]:
    """Return the instants with each interval divided into equal parts."""
    fractions = np.arange(count) / count
    inner = instants[:-1, None] + np.diff(instants)[:, None] * fractions
    return np.concatenate([inner.ravel(), instants[-1:]])
