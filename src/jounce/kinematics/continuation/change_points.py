"""Instants near a change point, interpolated from the motion on both sides.

At a change point the Jacobian is singular, and derivatives near it lose digits: at a time distance of d radii of the
Taylor series, a derivative of order k has an error of about ``eps k! / d^(k + m)``, where m is the multiplicity of the
zero of the determinant. The motion itself is smooth there. Accurate jets a little way off on both sides determine the
motion in between by two-point Hermite interpolation.
"""

import math
from collections.abc import Iterable
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float

from jounce.kinematics.continuation.anchors import Anchor, ChangePoint
from jounce.kinematics.continuation.path_following import FollowedPath, follow
from jounce.kinematics.continuation.solver import Solver
from jounce.kinematics.status import Status

ROUNDING = 1e-16
LARGEST_NOISE = 1e-3  # of the highest derivative, relative to the bound from the radius of the series
LARGEST_WIDTH = 0.5  # radii
TRUNCATION = 1e-3  # measured error of the highest derivative, interpolated over a width of one radius
LARGEST_DISAGREEMENT = 1e-7  # between interpolated and solved positions, rad or m


def half_width(point: ChangePoint, order: int) -> float:
    """Return the distance from a change point at which interpolation is as accurate as the jets at its ends, s."""
    balance = (ROUNDING * math.factorial(order) / TRUNCATION) ** (1 / (2 * order + 2 + point.multiplicity))
    return point.radius * min(LARGEST_WIDTH, balance)


def spoiled_width(point: ChangePoint, order: int) -> float:
    """Return the distance from a change point within which rounding dominates derivatives of an order, s."""
    return point.radius * (ROUNDING * math.factorial(order) / LARGEST_NOISE) ** (1 / (order + point.multiplicity))


def spoiled(
    points: Iterable[ChangePoint], instants: Float[np.ndarray, " time"], order: int
) -> Bool[np.ndarray, " time"]:
    """Return whether rounding dominates, at each instant, derivatives of an order from the factored Jacobian."""
    affected = np.zeros(len(instants), bool)
    for point in points:
        affected |= np.abs(instants - point.instant) < spoiled_width(point, order)
    return affected


def spoiled_nearby(distances: Float[np.ndarray, " time"], order: int) -> Bool[np.ndarray, " time"]:
    """Return whether rounding dominates derivatives of an order at distances from singular positions, in radii."""
    return (distances < 1.0) & (ROUNDING * math.factorial(order) > LARGEST_NOISE * distances ** (order + 1))


def bridged(
    solver: Solver, path: FollowedPath, point: ChangePoint, instants: Float[np.ndarray, " time"]
) -> tuple[dict[str, np.ndarray], tuple[np.ndarray, ...]] | None:
    """Return the jets of coordinates and outputs near a change point, time last; None if they cannot be determined.

    Parameters
    ----------
    solver : Solver
        Solver that followed the path.
    path : FollowedPath
        The motion followed through the change point.
    point : ChangePoint
        A change point of the path.
    instants : array of shape (time,)
        Instants within the half width around the change point, s.
    """
    width = half_width(point, solver.order)
    first, last = path.anchors[0].instant, path.anchors[-1].instant
    near_side = [a for a in path.anchors if a.instant < point.instant]
    far_side = [a for a in path.anchors if a.instant > point.instant]
    ends = []
    for anchors, end in ((near_side, max(point.instant - width, first)), (far_side, min(point.instant + width, last))):
        if abs(end - point.instant) < spoiled_width(point, solver.order):
            return None
        local = follow(solver, [a for a in anchors if a.instant <= end][-1], end, last - first)
        if local.status != Status.OK:
            return None
        ends.append(local.anchors[-1])
    before, after = ends
    return _interpolated(before, after, instants)


def _interpolated(before: Anchor, after: Anchor, instants: Float[np.ndarray, " time"]) -> Any:
    """Return the jets of the state at instants between two anchors by two-point Hermite interpolation."""
    from scipy.interpolate import BPoly  # imported late, as importing SciPy takes half a second

    duration = after.instant - before.instant
    fraction = (instants - before.instant) / duration

    def between(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        scale = np.array([math.factorial(k) * duration**k for k in range(len(left))])
        curve = BPoly.from_derivatives([0.0, 1.0], [x.reshape(len(x), -1) * scale[:, None] for x in (left, right)])
        values = np.stack([curve(fraction, nu=k).T / scale[k] for k in range(len(left))])
        return values.reshape(*left.shape[:-1], len(instants))

    return jax.tree.map(between, before.state[:2], after.state[:2])
