"""Signs of joint axes: parts assembled as drawn, or turned over.

A hinge or a guide fulfills its equations in two ways: as drawn, and with its axis reversed. Users never mean the
second, and no motion leads from one to the other.
"""

import itertools
from collections.abc import Iterator
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.modules import Module
from jounce.constraints.angles import perpendiculars
from jounce.constraints.base import rows
from jounce.constraints.facts import facts_of
from jounce.jet import Jet
from jounce.kinematics.assembly.gauss_newton import AssemblyAttempt, assemble_from_guess
from jounce.kinematics.assembly.initial_revolutions import Coordinates
from jounce.mechanism import Model
from jounce.mechanism.building.builder import model_of, named_groups
from jounce.mechanism.system import Group, System
from jounce.mechanism.transmissions.axis_angles import turned, unit
from jounce.rigid.pose import Pose

DRAWN_OPPOSITE = -0.9  # cosine: directions as far apart in the starting guess are meant to point opposite ways
DRAWN_NEARLY = 0.8  # where all are within this, the guess leaves no doubt, and nothing is gained by another

MIRRORED = 1e-6  # of the radius: distance from the position on the other side that counts as being there

AxisSigns = Bool[np.ndarray, " pair"]
"""For each pair of directions that joints hold parallel, whether they point the same way."""


class SameDirection(Module):
    """Constraint that two unit vectors point the same way; its rows grow without bound as they become opposite.

    The norm of the rows is the tangent of half the angle between the vectors.
    """

    vector_i: Float[np.ndarray, "component instance 1"]  # in the frame of body i
    vector_j: Float[np.ndarray, "component instance 1"]

    role: ClassVar[str] = "joint"
    periodic: ClassVar[bool] = False

    def residual(self, body_i: Pose, body_j: Pose, _time: Jet) -> Jet:
        """Return the rows, shape (1, ...) in the plane, (2, ...) in space."""
        if len(self.vector_i) == 2:
            sides = (jnp.stack([-self.vector_i[1], self.vector_i[0]]),)
        else:
            sides = perpendiculars(jnp.asarray(self.vector_i))
        direction = body_j.direction(self.vector_j)
        denominator = body_i.direction(self.vector_i).dot(direction) + 1.0
        return rows(*(body_i.direction(side).dot(direction) / denominator for side in sides))


def axis_signs(system: System, coordinates: Coordinates) -> AxisSigns:
    """Return, for each pair of directions that joints hold parallel, whether they point the same way.

    `coordinates` are those of all bodies, the ground first.
    """
    return _cosines(system, coordinates) >= 0


def signs_of(model: Model, attempt: AssemblyAttempt) -> AxisSigns:
    """Return the axis signs of an assembly."""
    return axis_signs(model.system, attempt.coordinates) if attempt.signs is None else attempt.signs


def drawn_axis_signs(model: Model) -> AxisSigns:
    """Return the axis signs that the starting guess means: equal, unless a pair is drawn almost opposite."""
    return _cosines(model.system, model.guess) > DRAWN_OPPOSITE


def pair_names(model: Model) -> list[str]:
    """Return the name of the joint of each pair of directions."""
    groups = named_groups(model)
    names = [members for group, members in groups for _ in facts_of(type(group.element)).held_parallel]
    return list(itertools.chain(*names))


def axis_signs_to_try(model: Model, attempt: AssemblyAttempt) -> list[AxisSigns]:
    """Return the axis signs for another assembly, the most likely first; none if the assembly is as drawn.

    Another assembly is needed if parts are turned over, or if the first one failed and directions in its guess are far
    from parallel. Signs as drawn may be impossible; all pairs pointing the same way come second.
    """
    signs = signs_of(model, attempt) if attempt.closed else None
    if signs is not None and signs.all():
        return []
    cosines = _cosines(model.system, model.guess)
    drawn_signs = cosines > DRAWN_OPPOSITE
    if signs is not None:
        as_drawn = np.array_equal(signs, drawn_signs)
    else:  # where a law has no finite value, no other start helps
        as_drawn = bool(np.all(np.abs(cosines) > DRAWN_NEARLY)) or not np.isfinite(attempt.gaps).all()
    if as_drawn:
        return []
    return [drawn_signs] if drawn_signs.all() else [drawn_signs, np.ones_like(drawn_signs)]


def starts_with_axis_signs(model: Model, signs: AxisSigns, instant: float, tolerance: float) -> Iterator[Coordinates]:
    """Yield coordinates near the starting guess that fulfill the joints with given axis signs, the most likely first.

    Drivers hold in the first half of them. In each half, one start has the attitudes aligned beforehand, since distant
    bodies otherwise pull parts around.
    """
    aligned = assemble_from_guess(_directed(model, signs, only_directions=True), instant, tolerance)
    for driven in (True, False):
        directed = _directed(model, signs, driven=driven)
        for start in (model.guess, aligned.coordinates)[: 1 + aligned.closed]:
            attempt = assemble_from_guess(directed, instant, tolerance, start)
            if attempt.closed:
                yield attempt.coordinates


def _directed(model: Model, signs: AxisSigns, *, only_directions: bool = False, driven: bool = True) -> Model:
    """Return the model with added rows that make directions point the same way, or opposite ways for a False sign.

    Parameters
    ----------
    model : Model
        The mechanism.
    signs : array of bool, shape (pairs,)
        Whether the directions of each pair point the same way.
    only_directions : bool, default False
        Whether these are the only rows; pairs that close a loop are then left out.
    driven : bool, default True
        Whether to keep the drivers.
    """
    groups = [] if only_directions else [group for group in model.system.groups if driven or not group.is_driver]
    parents, first = list(range(model.system.body_count + 1)), 0
    for group, names in _pairs(model.system):
        members = np.arange(group.instances)
        factors = np.where(signs[first + members], 1.0, -1.0)
        first += group.instances
        if only_directions:
            members = np.array([k for k in members if _joins(parents, group.bodies[0][k], group.bodies[1][k])], int)
        if len(members):
            vector_i, vector_j = (_unit(group, name)[:, members, None] for name in names)
            slots = tuple(tuple(slot[k] for k in members) for slot in group.bodies[:2])
            groups.append(Group(SameDirection(vector_i, vector_j * factors[members, None]), slots))
    unnamed = tuple(("",) * group.instances for group in groups)
    parts = ((tuple(groups), unnamed), ((), ()), ((), ()))
    return model_of(model.bodies, parts, model.guess, model.length, None)


def _joins(parents: list[int], body: int, other: int) -> bool:
    """Join the sets of two bodies (union-find by `parents`), and return whether they were separate."""
    ends = []
    for start in (body, other):
        end = start
        while parents[end] != end:
            parents[end] = end = parents[parents[end]]
        ends.append(end)
    parents[ends[0]] = ends[1]
    return ends[0] != ends[1]


def _pairs(system: System) -> Iterator[tuple[Group, tuple[str, str]]]:
    """Yield the groups of joints that hold two directions parallel, with the names of the two fields."""
    for group in system.groups:
        for names in facts_of(type(group.element)).held_parallel:
            yield group, names


def _unit(group: Group, name: str) -> Float[np.ndarray, "component instance"]:
    """Return the unit vectors of a direction field of a group, in the axes of its body."""
    vectors = np.asarray(getattr(group.element, name))[..., 0]
    return np.broadcast_to(unit(vectors), (len(vectors), group.instances))


def _cosines(system: System, coordinates: Coordinates) -> Float[np.ndarray, " pair"]:
    """Return the cosine of the angle between the directions of each pair."""
    cosines = []
    for group, names in _pairs(system):
        first, second = (
            in_global_axes(_unit(group, name), coordinates, np.array(slot))
            for name, slot in zip(names, group.bodies[:2], strict=True)
        )
        cosines.append(np.sum(first * second, axis=0))
    return np.concatenate([*cosines, np.zeros(0)])


def mirrored_discs(model: Model, coordinates: Coordinates) -> list[str]:
    """Return the names of rolling joints whose disc touches its line from the wrong side.

    Such a disc rolls in the opposite sense to that of the joint.
    """
    names: list[str] = []
    position = np.asarray(coordinates["position"])
    for group, members in named_groups(model):
        rolling = group.element
        if not (fields := facts_of(type(rolling)).rolls_along):
            continue
        slots = [np.array(slot) for slot in group.bodies]
        line, center = (
            position[:, slot, 0] + in_global_axes(np.asarray(point)[..., 0], coordinates, slot)
            for point, slot in zip((rolling.point_i, rolling.point_j), slots, strict=True)
        )
        side = in_global_axes(_right_of(*(_unit(group, name) for name in fields)), coordinates, slots[0])
        radius = np.asarray(rolling.radius)[..., 0]
        deviation = np.abs(np.sum(side * (center - line), axis=0) + radius)
        names += [name for name, x in zip(members, deviation <= MIRRORED * radius, strict=False) if x]
    return names


def _right_of(
    line: Float[np.ndarray, "component instance"], axis: Float[np.ndarray, "component instance"] | None = None
) -> Float[np.ndarray, "component instance"]:
    """Return unit vectors to the right of lines, in space as seen against the axis of the disc."""
    if axis is None:
        return np.stack([line[1], -line[0]])
    side = np.cross(line, axis, axis=0)
    return side / np.linalg.norm(side, axis=0)


def in_global_axes(
    vectors: Float[np.ndarray, "component instance"], coordinates: Coordinates, bodies: Int[np.ndarray, " instance"]
) -> Float[np.ndarray, "component instance"]:
    """Return vectors in global axes, given those in the axes of bodies."""
    if "angle" in coordinates:
        angle = np.asarray(coordinates["angle"])[bodies, 0]
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * vectors[0] - s * vectors[1], s * vectors[0] + c * vectors[1]])
    return turned(np.asarray(coordinates["quaternion"])[:, bodies, 0], vectors)
