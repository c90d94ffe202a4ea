"""Multipliers of the active constraints of a design, and the residual of its first-order (KKT) conditions."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.design.optimization.problem import Evaluation

ACTIVE = 1e-6  # distance from a bound, relative

Vector = Float[np.ndarray, " _"]


class Known(NamedTuple):
    """Scales and indices for the computation of multipliers.

    Attributes
    ----------
    bounded : array of int
        Extremes with a variable of their own.
    equal : array of bool of shape (conditions,)
        Whether each condition is an equality.
    sizes : array of shape (conditions,)
    extreme_sizes : array of shape (extremes,)
    owner : array of int of shape (rows,)
        Extreme of each row.
    clearance : float
        Bound of the smallest singular value.
    scale : float
        Size of the objective.
    """

    bounded: Int[np.ndarray, " bounded"]
    equal: Bool[np.ndarray, " condition"]
    sizes: Vector
    extreme_sizes: Vector
    owner: Int[np.ndarray, " row"]
    clearance: float
    scale: float


class Multipliers:
    """Multipliers of the active constraints of a design, by least squares with the required signs."""

    def __init__(
        self, known: Known, evaluation: Evaluation, numbers: Vector, slopes: list[Any], extremes: Vector, chosen: Any
    ):
        self.known, self.evaluation, self.numbers, self.extremes = known, evaluation, numbers, extremes
        by_parameter, by_extreme, by_smooth = slopes
        self.by_extreme, self.chosen = by_extreme, chosen
        self.fixed = by_parameter + by_smooth @ evaluation.smooth_slopes
        unbounded = np.setdiff1d(np.arange(len(extremes)), known.bounded)
        self.fixed = self.fixed + by_extreme[:, unbounded] @ evaluation.row_slopes[chosen[unbounded]]

    def solved(self) -> tuple[float, Vector, Vector]:
        """Return the residual, and the multipliers of conditions and of bounds."""
        from scipy.optimize import nnls  # importing SciPy takes half a second

        count, width = len(self.evaluation.point), len(self.known.bounded)
        target = -np.concatenate([self.fixed[0], self.by_extreme[0, self.known.bounded]])
        rows = [*self._conditions(), *self._rows(width), *self._bounds(count + width), *self._singular(width)]
        columns = np.stack([slope for slope, _, _ in rows], axis=1) if rows else np.zeros((len(target), 0))
        norms = np.linalg.norm(columns, axis=0)
        norms[norms == 0] = 1.0
        weights = nnls(columns / norms, target)[0] / norms if rows else np.zeros(0)
        multipliers = {"condition": np.zeros(len(self.known.equal)), "bound": np.zeros(count), "singular": np.zeros(1)}
        for (_, kind, signed_index), weight in zip(rows, weights, strict=True):
            if kind:
                sign = -1.0 if signed_index < 0 else 1.0
                multipliers[kind][abs(signed_index) - 1] += sign * weight
        size = max(float(np.linalg.norm(target)), self.known.scale)
        residual = float(np.linalg.norm(columns @ weights - target)) / size
        return residual, multipliers["condition"], multipliers["bound"]

    def _conditions(self) -> list[tuple[Vector, str, int]]:
        """Return the slopes of active conditions, with both signs for equalities."""
        rows, known = [], self.known
        for k, number in enumerate(self.numbers[1:]):
            slope = np.concatenate([self.fixed[k + 1], self.by_extreme[k + 1, known.bounded]])
            if known.equal[k] or number > -ACTIVE * known.sizes[k]:
                rows.append((slope, "condition", k + 1))
            if known.equal[k]:
                rows.append((-slope, "condition", -k - 1))
        return rows

    def _rows(self, extra: int) -> list[tuple[Vector, str, int]]:
        """Return the slopes of the largest values minus those of the variables that replace them."""
        known, evaluation = self.known, self.evaluation
        rows = []
        for k, extreme in enumerate(known.bounded):
            close = known.owner == extreme
            close &= evaluation.rows > self.extremes[extreme] - ACTIVE * known.extreme_sizes[extreme]
            rows += [(np.concatenate([row, -np.eye(extra)[k]]), "", 1) for row in evaluation.row_slopes[close]]
        return rows

    def _bounds(self, size: int) -> list[tuple[Vector, str, int]]:
        """Return the slopes of the active bounds."""
        point = self.evaluation.point
        lower = [(-np.eye(size)[k], "bound", int(k) + 1) for k in np.flatnonzero(point <= ACTIVE)]
        return lower + [(np.eye(size)[k], "bound", -int(k) - 1) for k in np.flatnonzero(point >= 1.0 - ACTIVE)]

    def _singular(self, extra: int) -> list[tuple[Vector, str, int]]:
        """Return the slopes of the smallest singular values at their bound."""
        limit = self.known.clearance**2 * (1 + 1e-4)
        rows = self.evaluation.margin_slopes[self.evaluation.margins < limit]
        return [(np.concatenate([-slope, np.zeros(extra)]), "singular", 1) for slope in rows]
