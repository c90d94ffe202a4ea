"""Curves through a position that fulfill the reduced constraints: their tangents, and the order they reach.

A curve is a series y(t) = y_p t^p + y_(p+1) t^(p+1) + ... Its tangent y_p has length one, and all later coefficients
are perpendicular to it, which fixes the parameter. The equations up to order k determine the coefficients together
(Gauss-Newton: from many starts at order two, then from the curve found so far); later orders decide what they leave
open. A smooth motion has p = 1; at a cusp p is 2, and the motion turns back.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jounce.kinematics.assembly.constraint_series import FULFILLED, ReducedConstraints
from jounce.linear_algebra.quadratic_forms import common_zeros, polarized

STARTS = 400  # directions from which tangents are searched
MOST_CURVES = 16
SAME = 1e-3  # rad: largest angle between tangents that are the same
STEPS = 40
VANISHING = 1e-9  # of the largest coefficient of the forms
RETRIES = 6
DIFFERENCE = 1e-4  # of coefficients for central differences of polynomials, whose error is its square

Series = Float[np.ndarray, "order k"]


@dataclasses.dataclass(frozen=True)
class LocalCurve:
    """A curve through the position.

    Attributes
    ----------
    series : array of shape (order, k)
        Coefficients of y from order one on; those below `multiplicity` are zero.
    multiplicity : int
        Order of the first nonzero coefficient: one for a smooth motion, two at a cusp.
    order : int
        Order to which the curve fulfills the constraints. If lower than the order sought, the next order blocks it.
    """

    series: Series
    multiplicity: int
    order: int

    @property
    def tangent(self) -> Float[np.ndarray, " k"]:
        """Unit tangent of the curve."""
        return self.series[self.multiplicity - 1]


def curves(constraints: ReducedConstraints) -> list[LocalCurve]:
    """Return the curves through a position, one for each tangent found, blocked ones included.

    A continuum of tangents, as with two degrees of freedom, is represented by a few.
    """
    tangents = _distinct([*_quadratic_tangents(constraints)])
    branches = []
    for tangent in tangents:
        smooth = _continued(constraints, tangent, 1)
        if smooth.order < constraints.order:
            branches += [smooth] if (cusp := _cusp(constraints, tangent)) is None else [cusp]
        else:
            branches.append(smooth)
    return branches


def _cusp(constraints: ReducedConstraints, tangent: Float[np.ndarray, " k"]) -> LocalCurve | None:
    for sign in (1.0, -1.0):
        curve = _continued(constraints, sign * tangent, 2)
        if curve.order == constraints.order:
            return curve
    return None


def _quadratic_tangents(constraints: ReducedConstraints) -> Float[np.ndarray, "tangent k"]:
    """Return unit vectors u for which the second-order terms of g vanish, from many starts; any if g has none."""
    count = constraints.free.shape[1]
    if count == 1:
        return np.ones((1, 1))
    forms = _quadratic_forms(constraints)
    scale = np.abs(forms).max(initial=0.0)
    random = np.random.default_rng(0)
    starts = random.standard_normal((STARTS, count))
    if not scale > FULFILLED:
        return starts / np.linalg.norm(starts, axis=1, keepdims=True)
    return common_zeros(forms / scale, starts, VANISHING, steps=STEPS)


def _quadratic_forms(constraints: ReducedConstraints) -> Float[np.ndarray, "s k k"]:
    """Return the second-order terms of g as quadratic forms."""

    def second_order(directions: Float[np.ndarray, "pair k"]) -> Float[np.ndarray, "s pair"]:
        series = np.zeros((len(directions), constraints.order, directions.shape[1]))
        series[:, 0] = directions
        return constraints.along(series)[0][:, 1].T

    return polarized(second_order, constraints.free.shape[1])


def _distinct(tangents: Sequence[Float[np.ndarray, " k"]]) -> list[Float[np.ndarray, " k"]]:
    """Return tangents along different lines; if too many, those farthest from each other."""
    if not len(tangents):
        return []
    candidates = np.asarray(tangents)
    chosen = [int(np.argmax(np.abs(candidates).max(axis=1)))]
    while len(chosen) < MOST_CURVES:
        cosines = np.abs(candidates @ candidates[chosen].T).max(axis=1)
        farthest = int(np.argmin(cosines))
        if np.arccos(min(cosines[farthest], 1.0)) < SAME:
            break
        chosen.append(farthest)
    return [candidates[k] for k in chosen]


def _continued(constraints: ReducedConstraints, tangent: Float[np.ndarray, " k"], multiplicity: int) -> LocalCurve:
    """Return the curve along a tangent, as far as it can be continued."""
    series = np.zeros((constraints.order, len(tangent)))
    series[multiplicity - 1] = tangent
    random, reached = np.random.default_rng(0), 2 * multiplicity - 1
    for order in range(2 * multiplicity, constraints.order + 1):
        for attempt in range(RETRIES):
            start = series.copy()
            if attempt:  # another choice of what lower orders leave open
                later = slice(multiplicity, order - multiplicity)
                start[later] += 0.5 * random.standard_normal(start[later].shape)
            trial = _fulfilling(constraints, start, multiplicity, order)
            if trial is not None:
                series, reached = trial, order
                break
        if reached < order:
            break
    return LocalCurve(series, multiplicity, reached)


def _fulfilling(constraints: ReducedConstraints, series: Series, multiplicity: int, order: int) -> Series | None:
    """Return a nearby series that fulfills the equations to an order, by Gauss-Newton steps, or None."""
    used = slice(multiplicity - 1, order - multiplicity)  # the coefficients on which the equations depend
    shape = series[used].shape

    def with_values(values: np.ndarray) -> np.ndarray:
        full_series = np.repeat(series[None], len(values), axis=0)
        full_series[:, used] = values.reshape(-1, *shape)
        return full_series

    values, damping = series[used].ravel(), 0.0
    gap, allowed = constraints.gap(with_values(values[None]), order)
    for _ in range(STEPS):
        if (np.abs(gap[0]) <= allowed[0]).all():
            value = with_values(values[None])[0]
            return value if np.linalg.norm(value[multiplicity - 1]) > 0.5 else None
        nudged = values + DIFFERENCE * np.concatenate([np.eye(values.size), -np.eye(values.size)])
        ahead, behind = np.split(constraints.gap(with_values(nudged), order)[0], 2)
        weights = 1.0 / allowed[0]
        slope = ((ahead - behind) / (2 * DIFFERENCE)).T * weights[:, None]
        # the tangent keeps length one, later coefficients stay perpendicular to it
        first, later = values[: shape[1]], values.reshape(shape)[1:]
        tangent_rows = np.zeros((shape[0], values.size))
        tangent_rows[0, : shape[1]] = first
        for k, row in enumerate(later, 1):
            tangent_rows[k, k * shape[1] : (k + 1) * shape[1]], tangent_rows[k, : shape[1]] = first, row
        tangent_gaps = np.concatenate([[0.5 * (first @ first - 1.0)], later @ first])
        weight = np.max(np.abs(slope), initial=1.0)
        matrix = np.concatenate([slope, weight * tangent_rows])
        rhs = np.concatenate([gap[0] * weights, weight * tangent_gaps])
        step = -np.linalg.lstsq(matrix, rhs, rcond=1e-9)[0]
        step *= min(1.0, 1.0 / max(np.abs(step).max(initial=0.0), 1e-300))
        trials = values + np.array([1.0, 0.5, 0.25, 0.1])[:, None] * step
        gaps, limits = constraints.gap(with_values(trials), order)
        best = int(np.argmin(np.abs(gaps / limits).max(axis=1)))
        if damping > 5 and np.abs(gaps / limits).max(axis=1)[best] > 0.9 * np.abs(gap / allowed).max():
            return None
        damping += 1
        values, gap, allowed = trials[best], gaps[best : best + 1], limits[best : best + 1]
    return None
