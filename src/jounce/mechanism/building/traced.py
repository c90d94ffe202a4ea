"""Mechanisms with traced values: their extraction and replacement, and the model as a function of them.

Decisions by values are made outside of the traced function: whole turns, signs, the size of the mechanism. The rest of
a model is a function of the traced values, including the offsets that follow from the starting guess, and the position
from which angles about axes are counted.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.base.modules import with_fields
from jounce.constraints.angles import Datum, angle_of
from jounce.constraints.base import value_fields
from jounce.constraints.planar import length_of
from jounce.errors import UnsupportedError
from jounce.jet.turns import shifted_by_turns
from jounce.mechanism.building.builder import Model, grouped_elements, model_of
from jounce.mechanism.building.derived_values import with_offsets, with_sense, with_turn_unit
from jounce.mechanism.building.preconditions import PLAIN, fields_of
from jounce.mechanism.building.starting_guess import pose_at, starting_guess
from jounce.mechanism.mechanism import Mechanism
from jounce.mechanism.resolve import resolve
from jounce.mechanism.system import Group, with_field
from jounce.mechanism.transmissions.axis_angles import measures_angle
from jounce.mechanism.transmissions.gear_checks import check_ratios
from jounce.rigid import PlanarPose, SpatialPose
from jounce.trajectory import Expression

Part = tuple[Any, ...]
"""One array for each group (of joints and drivers, of forces, or of outputs) that measures an angle about an axis."""


class Angles(NamedTuple):
    """Angles about axes as a solution counted them, for each group that measures such angles, rad; see `Datum`.

    Attributes
    ----------
    angle : tuple of tuple of array of shape (instances, 1)
        Angles of joints and drivers, of forces and of outputs at the assembled position.
    near : tuple of tuple of array of shape (instances, time)
        Angles of forces and of outputs at all instants.
    """

    angle: tuple[Part, Part, Part]
    near: tuple[Part, Part]


def template(tree: Any) -> tuple[list[Any], Callable[[Sequence[Any]], Any]]:
    """Return the traced values of a mechanism, and a function that rebuilds the mechanism with other values.

    The function holds no traced value.
    """
    values: list[Any] = []
    maker = _maker(tree, values)
    return values, (lambda _: tree) if maker is None else lambda leaves: maker(iter(leaves))


def _maker(value: Any, values: list[Any]) -> Callable[[Iterator[Any]], Any] | None:
    """Return the function that rebuilds a nested value with other values for the traced ones; None if none is traced.

    The traced values are appended to `values`.
    """
    kind = type(value)
    if isinstance(value, Tracer):
        values.append(value)
        return next
    if kind in PLAIN or isinstance(value, type):
        return None
    if isinstance(value, Mapping):
        parts, constructor = dict(value), dict
    elif isinstance(value, list | tuple):
        parts = dict(enumerate(value))
        constructor = partial(_as_sequence, kind)
    elif dataclasses.is_dataclass(kind):
        names = [name for name in fields_of(kind) or () if hasattr(value, name)]
        parts, constructor = {name: getattr(value, name) for name in names}, partial(_copied, kind)
    else:
        return None
    makers = {key: maker for key, part in parts.items() if (maker := _maker(part, values)) is not None}
    if not makers:
        return None
    fixed = parts | dict.fromkeys(makers)  # without the traced values
    return lambda new_values: constructor(fixed | {key: maker(new_values) for key, maker in makers.items()})


def _as_sequence(kind: type[Any], parts: Mapping[Any, Any]) -> Any:
    return kind(*parts.values()) if hasattr(kind, "_fields") else kind(parts.values())


def _copied(kind: type[Any], fields: Mapping[str, Any]) -> Any:
    copy = object.__new__(kind)  # its values were checked before tracing, or are checked when it is solved
    for name, field in fields.items():
        object.__setattr__(copy, name, field)
    return copy


def traced_model(
    mechanism: Mechanism, length: Any, angles: Angles | None = None, first: Mapping[str, Any] | None = None
) -> Model:
    """Return the numeric model of a mechanism as a function of the values that JAX traces in it.

    Rows are not scaled, and there is no history of turns.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with values that may be traced.
    length : float
        Size of the mechanism, m.
    angles : Angles, optional
        Angles about axes as a solution counted them. By default, they follow from the attitude matrices, which suffices
        at the assembled position.
    first : dict of str to array, optional
        Coordinates of all bodies at the assembled position, the ground first, (..., bodies, 1).

    Raises
    ------
    UnsupportedError
        If an offset follows from a traced orientation.
    """
    posed = _with_plain_orientations(mechanism)
    planar = mechanism.space == "planar"
    components, pose_type = (2, PlanarPose) if planar else (3, SpatialPose)
    guess = starting_guess(posed, mechanism.parameter_values, components)
    (groups, names), *others = grouped_elements(mechanism)
    check_ratios(groups, names)
    groups = tuple(with_sense(with_offsets(group, pose_type, guess), pose_type, guess) for group in groups)
    groups = tuple(with_turn_unit(group, length) for group in groups)
    parts = [groups, *(part for part, _ in others)]
    if angles is not None and any(measures_angle(group) for part in parts for group in part):
        assert first is not None
        turn = (angles.angle[0], *angles.near)
        parts = [_counted(*arrays, pose_at(first, pose_type)) for arrays in zip(parts, angles.angle, turn, strict=True)]
    pairs = zip(parts, (names, *(label for _, label in others)), strict=True)
    labeled_parts: Any = tuple(pairs)
    model = model_of(tuple(mechanism.bodies), labeled_parts, guess, 1.0, None)
    scale = jnp.concatenate([jnp.full(components, length), jnp.ones(pose_type.turns)])
    return dataclasses.replace(model, system=with_fields(model.system, column_scale=scale))


def _with_plain_orientations(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism without its traced orientations, which serve as starting guesses only."""
    values = mechanism.parameter_values
    traced = [name for name, body in mechanism.bodies.items() if _depends(body.orientation, values)]
    if not traced:
        return mechanism
    for name, joint in mechanism.joints.items():
        missing = "offset" in value_fields(type(joint)) and getattr(joint, "offset", 0.0) is None
        if missing or hasattr(joint, "sense"):
            raise UnsupportedError(
                f"the offset of the joint {name} follows from the starting guess, and is not differentiated by an "
                "orientation there; give the offset",
                name=f"bodies.{traced[0]}.orientation",
            )
    bodies = {name: dataclasses.replace(mechanism.bodies[name], orientation=None) for name in traced}
    return dataclasses.replace(mechanism, bodies={**mechanism.bodies, **bodies})


def _depends(orientation: Any, values: Mapping[str, Any]) -> bool:
    """Return whether an orientation holds traced values, or expressions of them."""
    if isinstance(orientation, Mapping):
        return any(_depends(entry, values) for key, entry in orientation.items() if key != "euler")
    if isinstance(orientation, list | tuple):
        return any(_depends(entry, values) for entry in orientation)
    return isinstance(orientation, Tracer) or (
        isinstance(orientation, str | Expression) and isinstance(resolve(orientation, values), Tracer)
    )


def _counted(groups: tuple[Group, ...], angles: Part, near: Part, pose: Any) -> tuple[Group, ...]:
    """Return groups whose angles about axes are counted from a pose, with known whole turns."""
    counts = zip(angles, near, strict=True)
    return tuple(_with_datum(group, pose, *next(counts)) if measures_angle(group) else group for group in groups)


def _with_datum(group: Group, pose: SpatialPose, counted_angle: Any, near: Any) -> Group:
    element, (body_i, body_j) = group.element, (pose.take(indices) for indices in group.bodies)
    e0, e = (jet.coefficients[0] for jet in body_i.relative_quaternion(body_j.quaternion))
    attitude = jnp.concatenate([e0[None], e])
    axis = jnp.asarray(element.axis if hasattr(element, "axis") else element.axis_i)
    axis = axis / length_of(axis)[None]
    if element.vector_i is None:
        angle, is_defined = angle_of(attitude, axis)
        return with_field(
            group,
            "datum",
            Datum(attitude, jnp.where(is_defined, shifted_by_turns(angle, counted_angle), counted_angle), near),
        )
    across = None
    if hasattr(element, "role"):  # a driver or a force acts about the axis: see `axis_angles`
        second = jnp.asarray(element.vector_j)
        along = body_j.to_body(body_i.direction(axis)).coefficients[0]
        across = second - (second * along).sum(axis=0, keepdims=True) * along
    return with_field(group, "datum", Datum(attitude, counted_angle, near, across))


def angles_of(model: Model, counted: tuple[tuple[Group, ...], tuple[Group, ...]]) -> Angles:
    """Return the angles about axes of a solution.

    Parameters
    ----------
    model : Model
        Model of the solution.
    counted : tuple of tuple of Group
        Groups of its forces and of its outputs, with the turns at all instants.
    """
    system = model.system
    data = [[g.element.datum for g in part if measures_angle(g)] for part in (system.groups, *counted)]
    angle: Any = tuple(tuple(np.asarray(datum.angle) for datum in part) for part in data)
    near: Any = tuple(tuple(np.asarray(datum.near) for datum in part) for part in data[1:])
    return Angles(angle, near)
