"""Samples of designs within bounds, solved side by side, as starts of searches."""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.design.optimization.problem import Problem
from jounce.errors import MechanismError, whole_number
from jounce.kinematics import Status, solve_batch

FEWER = 3  # derivatives that samples do not need
PENALTY = 10.0  # of a broken condition against the objective, each over its usual size
MIN_DISTANCE = 0.05  # of starts from each other, over the diagonal between bounds


@dataclasses.dataclass(frozen=True, eq=False)
class Samples:
    """Points of designs, how far they move, and their merits.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    points : array of shape (designs, parameters)
        From 0 to 1 between the bounds.
    status : array of int of shape (designs,)
        Outcome at the first instant that is not solved, `Status.OK` where all are.
    merits : array of shape (designs,)
        Smaller is better; infinite for those that do not move.
    """

    names: tuple[str, ...]
    points: Float[np.ndarray, "design parameter"]
    status: Int[np.ndarray, " design"]
    merits: Float[np.ndarray, " design"]

    @property
    def moving(self) -> Bool[np.ndarray, " design"]:
        """Which designs move at all instants."""
        return self.status == Status.OK

    @property
    def count(self) -> int:
        """Number of designs."""
        return len(self.points)

    def best(self, count: int) -> list[Float[np.ndarray, " parameter"]]:
        """Return the best points that have a least distance from each other."""
        selected: list[np.ndarray] = []
        least = MIN_DISTANCE * math.sqrt(self.points.shape[1])
        for k in np.argsort(self.merits):
            if len(selected) >= count or not np.isfinite(self.merits[k]):
                break
            if all(np.linalg.norm(self.points[k] - other) > least for other in selected):
                selected.append(self.points[k])
        return selected

    def notes(self, bounds: Mapping[str, tuple[float, float]]) -> list[str]:
        """Return words for designs that cannot be assembled or lock, and the ranges of those that move."""
        stuck = self.count - int(self.moving.sum())
        if not stuck or not self.moving.any():
            return []
        words = [f"{stuck} of {self.count} designs within the bounds cannot be assembled, or lock"]
        step = 2.0 / self.count if self.points.shape[1] == 1 else 0.1
        for k, name in enumerate(self.names):
            low, high = bounds[name]
            used = self.points[self.moving, k]
            if used.min() > step or used.max() < 1 - step:
                ends = low + (high - low) * np.array([used.min(), used.max()])
                words.append(f"those that move have {name} from {ends[0]:.4g} to {ends[1]:.4g}")
        return ["; ".join(words)]


def sampled(problem: Problem, count: int | None, seed: int) -> Samples:
    """Return a low-discrepancy sample of designs.

    Parameters
    ----------
    problem : Problem
    count : int, optional
        Rounded up to a power of two.
    seed : int
    """
    from scipy.stats import qmc  # here, to start quickly

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
    moving = status == Status.OK
    merits = np.full(len(points), np.inf)
    if moving.any():
        outputs = {name: _flat(family[name].values[moving]) for name in goals.mechanism.outputs}
        numbers = problem.sampled(values[moving], outputs)
        merits[moving] = _merits(numbers, np.array([c.relation.equal for c in goals.conditions], bool))
        merits[~np.isfinite(merits)] = np.inf
    return Samples(problem.names, points, status, merits)


def _flat(values: Float[np.ndarray, "design time derivative *axes"]) -> Float[np.ndarray, "design time derivative *_"]:
    return values.reshape(*values.shape[:3], -1) if values.ndim > 4 else values


def _merits(numbers: Float[np.ndarray, "design goal"], equal: Bool[np.ndarray, " condition"]) -> np.ndarray:
    """Return the merits of designs: the objective plus broken conditions, each over its usual size."""
    objective, conditions = numbers[:, 0], numbers[:, 1:]
    broken = np.where(equal, np.abs(conditions), np.maximum(conditions, 0.0))
    sizes = np.median(np.abs(conditions), axis=0)
    scale = float(np.median(np.abs(objective))) or 1.0
    worst = (broken / np.where(sizes > 0, sizes, 1.0)).max(axis=1, initial=0.0)
    return objective / scale + PENALTY * worst
