"""Instants next to a change point, interpolated from the motion on both sides.

At a change point the Jacobian is singular, and near it derivatives lose digits: a distance in time of d radii of the
Taylor series away, that of order k is good to about ``eps k! / d^(k + 1)``. The motion itself is smooth there. Its jets
a little way off on both sides, where they are good, determine it in between: two-point Hermite interpolation.
"""

import math
from collections.abc import Iterable
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float

from jounce.kinematics.continuation.path_following import Anchor, ChangePoint, FollowedPath, follow
from jounce.kinematics.continuation.solver import Solver
from jounce.kinematics.status import Status

ROUNDING = 1e-16
LARGEST_NOISE = 1e-3  # of the highest derivative, as a part of what the radius of the series lets it be
LARGEST_WIDTH = 0.5  # radii
TRUNCATION = 1e-3  # of the highest derivative by interpolation over a width of one radius, as measured
LARGEST_DISAGREEMENT = 1e-7  # of an interpolated position with a solved one, rad or m


def half_width(point: ChangePoint, order: int) -> float:
    """Return how far from a change point interpolation is as good as the jets that it starts from, s."""
    balance = (ROUNDING * math.factorial(order) / TRUNCATION) ** (1 / (2 * order + 3))
    return point.radius * min(LARGEST_WIDTH, balance)


def spoiled_width(point: ChangePoint, order: int) -> float:
    """Return within what distance of a change point a derivative of an order is mostly rounding, s."""
    return point.radius * (ROUNDING * math.factorial(order) / LARGEST_NOISE) ** (1 / (order + 1))


def spoiled(
    points: Iterable[ChangePoint], instants: Float[np.ndarray, " time"], order: int
) -> Bool[np.ndarray, " time"]:
    """Tell at which instants solutions by the factored Jacobian are mostly rounding at an order."""
    affected = np.zeros(len(instants), bool)
    for point in points:
        affected |= np.abs(instants - point.instant) < spoiled_width(point, order)
    return affected


def bridged(
    solver: Solver, path: FollowedPath, point: ChangePoint, instants: Float[np.ndarray, " time"]
) -> tuple[dict[str, np.ndarray], tuple[np.ndarray, ...]] | None:
    """Return the jets of coordinates and outputs next to a change point, time last; None where they cannot be had.

    Parameters
    ----------
    solver : Solver
        What solved the path.
    path : FollowedPath
        The motion followed, through the change point.
    point : ChangePoint
        One of the path.
    instants : array of shape (time,)
        Within the half width around it, s.
    """
    width = half_width(point, solver.order)
    first, last = path.anchors[0].instant, path.anchors[-1].instant
    near = [a for a in path.anchors if a.instant < point.instant]
    far = [a for a in path.anchors if a.instant > point.instant]
    ends = []
    for anchors, end in ((near, max(point.instant - width, first)), (far, min(point.instant + width, last))):
        if abs(end - point.instant) < spoiled_width(point, solver.order):
            return None
        local = follow(solver, [a for a in anchors if a.instant <= end][-1], end, last - first)
        if local.status != Status.OK:
            return None
        ends.append(local.anchors[-1])
    before, after = ends
    return _interpolated(before, after, instants)


def _interpolated(before: Anchor, after: Anchor, instants: Float[np.ndarray, " time"]) -> Any:
    """Return the jets of the state at instants between two anchors, by Hermite interpolation of both their jets."""
    from scipy.interpolate import BPoly  # here, since importing SciPy takes half a second

    duration = after.instant - before.instant
    share = (instants - before.instant) / duration

    def between(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        scale = np.array([math.factorial(k) * duration**k for k in range(len(left))])
        curve = BPoly.from_derivatives([0.0, 1.0], [x.reshape(len(x), -1) * scale[:, None] for x in (left, right)])
        values = np.stack([curve(share, nu=k).T / scale[k] for k in range(len(left))])
        return values.reshape(*left.shape[:-1], len(instants))

    return jax.tree.map(between, before.state[:2], after.state[:2])
