"""Bounds of rope lengths, from the distances of points that hold in every position of the mechanism.

Points of one body keep their distance, pinned points coincide, and rods have their length. The triangle inequality
bounds all other distances: bound smoothing, as for the geometry of molecules.
Crippen and Havel, Distance Geometry and Molecular Conformation, 1988.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.constraints.facts import facts_of
from jounce.constraints.ropes import Rope
from jounce.errors import MechanismError

ROUNDING = 1e-9  # of lengths, for the rounding of written numbers
Bounds = Float[np.ndarray, "point point"]


def check_ropes(groups: Sequence[Any], names: Sequence[Sequence[str]]) -> None:
    """Raise MechanismError if a rope is longer, or shorter, than the path along its points can be in any position.

    Parameters
    ----------
    groups : sequence of Group
        Groups of joints and drivers; traced values are not checked.
    names : sequence of sequence of str
        Names of the elements of each group, with their kinds as prefixes.
    """
    ropes = [(group, members) for group, members in zip(groups, names, strict=True) if isinstance(group.element, Rope)]
    if not ropes:
        return
    points = _Points()
    for group in groups:
        distance = _fixed_distance(group.element)
        if distance is not None and not _is_traced((group.element.point_i, group.element.point_j, distance)):
            points.hold(group, distance)
    for group, members in ropes:
        if not _is_traced(group.element):
            for k in range(group.instances):
                _check(group, k, members[k], points)


def _is_traced(values: Any) -> bool:
    return any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(values))


class _Points:
    """Points of bodies, and pairs of points with fixed distances."""

    def __init__(self) -> None:
        self.bodies: list[int] = []
        self.positions: list[np.ndarray] = []
        self.distances: list[tuple[int, int, float]] = []

    def hold(self, group: Any, distance: Any) -> None:
        """Add the points of all joints of a group, which hold pairs of points at a distance."""
        element, size = group.element, len(self.bodies)
        distance = np.broadcast_to(distance, (group.instances, 1))
        for k in range(group.instances):
            for slot, point in zip(group.bodies, (element.point_i, element.point_j), strict=False):
                self.bodies.append(slot[k])
                self.positions.append(np.asarray(point)[:, k, 0])
            self.distances.append((size + 2 * k, size + 2 * k + 1, float(distance[k, 0])))

    def bounds(self, bodies: Sequence[int], positions: Sequence[np.ndarray]) -> tuple[Bounds, Bounds]:
        """Return lower and upper bounds of the distances of given points, which come first, and stored ones, m."""
        all_bodies, points = np.array([*bodies, *self.bodies]), np.stack([*positions, *self.positions])
        same_body = all_bodies[:, None] == all_bodies[None]
        distances = np.linalg.norm(points[:, None] - points[None], axis=-1)
        lower, upper = np.where(same_body, distances, 0.0), np.where(same_body, distances, np.inf)
        for i, j, distance in self.distances:
            pair = len(positions) + i, len(positions) + j
            for entry in (pair, pair[::-1]):
                lower[entry], upper[entry] = max(lower[entry], distance), min(upper[entry], distance)
        for k in range(len(points)):
            upper = np.minimum(upper, upper[:, k, None] + upper[None, k])
        for k in range(len(points)):
            with np.errstate(invalid="ignore"):
                excess = np.maximum(lower[:, k, None] - upper[None, k], lower[None, k] - upper[:, k, None])
            lower = np.maximum(lower, np.where(np.isfinite(excess), excess, 0.0))
        return lower, upper


def _check(group: Any, instance: int, name: str, points: _Points) -> None:
    rope = group.element
    slots = rope.slots or range(len(rope.points))
    bodies = [group.bodies[slot][instance] for slot in slots]
    positions, length = list(np.asarray(rope.points)[:, :, instance, 0]), float(np.asarray(rope.length)[instance, 0])
    lower, upper = points.bounds(bodies, positions)
    for k in range(len(positions) - 1):
        if upper[k, k + 1] <= ROUNDING * length:
            message = "coincides with the point before it, where the rope has no direction; leave one of them out"
            raise MechanismError(message, name=f"{name}.points", value=positions[k + 1].tolist())
    low, high = (float(sum(bound[i, j] for i, j in pairwise(range(len(positions))))) for bound in (lower, upper))
    if length < low * (1 - ROUNDING):
        message = (
            f"the rope is too short: along its points it is {low:.6g} m at least, wherever the bodies are; give a "
            "greater length, or move its points"
        )
        raise MechanismError(message, name=f"{name}.length", value=length)
    if length > high * (1 + ROUNDING):
        message = (
            f"the rope is too long: along its points it is {high:.6g} m at most, wherever the bodies are, so that it "
            "is always slack; give a smaller length, or move its points"
        )
        raise MechanismError(message, name=f"{name}.length", value=length)


def _fixed_distance(joint: Any) -> Any:
    """Return the distance at which a joint holds its two points: zero for pins; None if it holds none."""
    fact = facts_of(type(joint)).point_distance
    return 0.0 if fact == "zero" else getattr(joint, fact) if fact else None
