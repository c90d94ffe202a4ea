"""Samples of designs within bounds, solved side by side, as starts of searches."""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.design.optimization.problem import Problem
from jounce.errors import MechanismError, whole_number
from jounce.kinematics import Status, solve_batch

FEWER = 3  # number of derivatives that samples omit
PENALTY = 10.0  # weight of a violated condition against the objective, each relative to its typical size
MIN_DISTANCE = 0.05  # distance of starts from each other, relative to the diagonal between bounds


@dataclasses.dataclass(frozen=True, eq=False)
class Samples:
    """Sampled designs with their outcomes and merits.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    points : array of shape (designs, parameters)
        Parameters, scaled from 0 to 1 between the bounds.
    status : array of int of shape (designs,)
        Outcome at the first instant that is not solved, or `Status.OK`.
    merits : array of shape (designs,)
        Merit of each design, smaller for better ones; infinite for designs that do not move.
    """

    names: tuple[str, ...]
    points: Float[np.ndarray, "design parameter"]
    status: Int[np.ndarray, " design"]
    merits: Float[np.ndarray, " design"]

    @property
    def moving(self) -> Bool[np.ndarray, " design"]:
        """Whether each design moves at all instants."""
        return self.status == Status.OK

    @property
    def count(self) -> int:
        """Number of designs."""
        return len(self.points)

    def best(self, count: int) -> list[Float[np.ndarray, " parameter"]]:
        """Return the best points with a minimum distance from each other."""
        selected: list[np.ndarray] = []
        min_distance = MIN_DISTANCE * math.sqrt(self.points.shape[1])
        for k in np.argsort(self.merits):
            if len(selected) >= count or not np.isfinite(self.merits[k]):
                break
            if all(np.linalg.norm(self.points[k] - point) > min_distance for point in selected):
                selected.append(self.points[k])
        return selected

    def notes(self, bounds: Mapping[str, tuple[float, float]]) -> list[str]:
        """Return a note on designs that cannot be assembled or lock, with the ranges of designs that move."""
        stuck = self.count - int(self.moving.sum())
        if not stuck or not self.moving.any():
            return []
        phrases = [f"{stuck} of {self.count} designs within the bounds cannot be assembled, or lock"]
        step = 2.0 / self.count if self.points.shape[1] == 1 else 0.1
        for k, name in enumerate(self.names):
            low, high = bounds[name]
            coordinates = self.points[self.moving, k]
            if coordinates.min() > step or coordinates.max() < 1 - step:
                ends = low + (high - low) * np.array([coordinates.min(), coordinates.max()])
                phrases.append(f"those that move have {name} from {ends[0]:.4g} to {ends[1]:.4g}")
        return ["; ".join(phrases)]


def sampled(problem: Problem, count: int | None, seed: int) -> Samples:
    """Return a low-discrepancy sample of designs.

    Parameters
    ----------
    problem : Problem
    count : int, optional
        Number of designs, rounded up to a power of two.
    seed : int
    """
    from scipy.stats import qmc  # importing SciPy takes half a second

    size = len(problem.names)
    count = max(64, 16 * size) if count is None else whole_number("samples", count, 1, error=MechanismError)
    points = qmc.Sobol(size, rng=np.random.default_rng(seed)).random_base2(math.ceil(math.log2(count)))
    values = problem.low + problem.width * points
    goals = problem.goals
    order = max(goals.order - FEWER, 0)
    rows = dict(zip(problem.names, values.T, strict=True))
    family = solve_batch(goals.mechanism, rows, goals.instants, order, alone=False)
    outcomes = family["status"].values
    status = np.take_along_axis(outcomes, np.argmax(outcomes != Status.OK, axis=1)[:, None], axis=1)[:, 0]
    is_moving = status == Status.OK
    merits = np.full(len(points), np.inf)
    if is_moving.any():
        outputs = {name: _flat(family[name].values[is_moving]) for name in goals.mechanism.outputs}
        numbers = problem.sampled(values[is_moving], outputs)
        merits[is_moving] = _merits(numbers, np.array([c.relation.equal for c in goals.conditions], bool))
        merits[~np.isfinite(merits)] = np.inf
    return Samples(problem.names, points, status, merits)


def _flat(values: Float[np.ndarray, "design time derivative *axes"]) -> Float[np.ndarray, "design time derivative *_"]:
    return values.reshape(*values.shape[:3], -1) if values.ndim > 4 else values


def _merits(numbers: Float[np.ndarray, "design goal"], equal: Bool[np.ndarray, " condition"]) -> np.ndarray:
    """Return the merits of designs: the objective plus violations, each relative to its typical size."""
    objective, conditions = numbers[:, 0], numbers[:, 1:]
    broken = np.where(equal, np.abs(conditions), np.maximum(conditions, 0.0))
    sizes = np.median(np.abs(conditions), axis=0)
    scale = float(np.median(np.abs(objective))) or 1.0
    violations = (broken / np.where(sizes > 0, sizes, 1.0)).max(axis=1, initial=0.0)
    return objective / scale + PENALTY * violations
