"""Frames of gears: the body to which both centers are pinned, and the axes of shafts in the frame of their rotation.

The centers of toothed gears, and of the pulleys of most belts, keep their distance if one body carries both. The pins
and welds show this body: a center is a point of every body that is pinned or welded to it there. The joints that hold
directions parallel show the axis of a shaft in the frame m, and that of a pinion on its rack.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.base.modules import with_fields
from jounce.constraints import planar, spatial
from jounce.constraints.angles import Datum, coaxial
from jounce.constraints.cams import Cam, turns_in_space
from jounce.constraints.facts import facts_of, value_fields
from jounce.constraints.ropes import Rope, distinct, shares_points
from jounce.errors import JounceError, MechanismError
from jounce.execution.compilation import compiled
from jounce.mechanism.mechanism import GROUND, Mechanism
from jounce.mechanism.resolve import along_instances, resolve
from jounce.mechanism.system import POSITION_COMPONENTS, Group, group_elements, with_field
from jounce.mechanism.transmissions.joined_points import (
    BodyVector,
    Fixtures,
    Joined,
    as_array,
    body_vector,
    constant_attitudes,
    held_parallel,
    joined_vectors,
    on_joined_bodies,
    parallel,
    pinned,
    same_component,
    welded,
)
from jounce.mechanism.transmissions.rope_lengths import check_ropes

LARGEST_GAP = 1e-6  # of the center distance, for the rounding of written numbers
LARGEST_WHOLE = 1000  # largest whole number in a ratio of spatial gears
ACROSS = 1e-6  # largest cosine between the axis of a pinion and its rack, for the rounding of written numbers
WHOLE = 1e-9  # tolerance of a multiple of a ratio that counts as whole


Grouped = tuple[tuple[Group, ...], tuple[tuple[str, ...], ...]]
"""Groups, and the names of the elements of each group, with their kinds as prefixes."""


class Arm(NamedTuple):
    """The body that carries the centers of two gears, and the angle of the line of centers in its frame, rad."""

    body: str
    angle: Any


def is_toothed(element: Any) -> bool:
    """Return whether an element is a pair of planar gears with teeth."""
    return isinstance(element, planar.Gear) and element.ratio is None


def on_line(element: Any) -> bool:
    """Return whether an element, toothed gears or a belt, turns planar bodies relative to their line of centers."""
    return may_have_frame(type(element)) and (is_toothed(element) or isinstance(element, planar.Belt))


@lru_cache(maxsize=1000)
def may_have_frame(kind: type) -> bool:
    """Return whether elements of a class need information from the whole mechanism, such as gears, belts and ropes."""
    return issubclass(kind, (planar.Gear, planar.Belt, Rope, spatial.Gear, Cam, spatial.Rolling))


def grouped_with_frames(mechanism: Mechanism, elements: Mapping[str, Any]) -> Grouped:
    """Return the groups of some elements of a mechanism, named with their kinds; gears get their frames."""
    index = {name: k for k, name in enumerate((GROUND, *mechanism.bodies))}
    arms = _find_arms(mechanism, elements)
    given = _with_arms(_with_slots(elements), arms)
    groups, names = group_elements(given, mechanism.parameter_values, index, POSITION_COMPONENTS[mechanism.space])
    named_groups = zip(groups, names, strict=True)
    return tuple(_with_carriers(group, members, arms, mechanism, elements) for group, members in named_groups), names


def check_distances(mechanism: Mechanism) -> None:
    """Raise MechanismError for an impossible distance: of gear centers, of pulleys that overlap, or a rope length."""
    joints = {f"joints.{name}": joint for name, joint in mechanism.joints.items()}
    if any(isinstance(joint, Rope) for joint in joints.values()):
        check_ropes(*grouped_with_frames(mechanism, joints))
    _find_arms(mechanism, joints)


def carriers(mechanism: Mechanism) -> set[str]:
    """Return the bodies that carry toothed gears or both pulleys of a belt; the ground may be among them."""
    return {arm.body for arm in _find_arms(mechanism, mechanism.joints).values()}


def _find_arms(mechanism: Mechanism, elements: Mapping[str, Any]) -> dict[str, Arm]:
    """Return the arms of the toothed gears and the belts among some elements, by name, without those that have none.

    Raises
    ------
    MechanismError
        If a center distance does not suit the pitch radii, or pulleys overlap.
    """
    toothed = {name: element for name, element in elements.items() if on_line(element)}
    if not toothed:
        return {}
    pins, parameters, welds = joined_vectors(mechanism, pinned), mechanism.parameter_values, welded(mechanism)
    arms = {name: _find_arm(name, element, parameters, pins, welds) for name, element in toothed.items()}
    return {name: arm for name, arm in arms.items() if arm is not None}


def _find_arm(
    name: str, gear: planar.Gear | planar.Belt, parameters: Mapping[str, Any], pins: Joined, welds: Fixtures
) -> Arm | None:
    try:
        radii = [resolve(radius, parameters) for radius in (gear.radius_i, gear.radius_j)]
        points = [
            body_vector(body, p, parameters) for body, p in zip(gear.bodies, (gear.point_i, gear.point_j), strict=True)
        ]
    except JounceError:
        return None  # raised when the values of the gear are resolved
    untraced = not any(isinstance(radius, Tracer) for radius in radii)
    if untraced and not all(math.isfinite(radius) and radius for radius in radii):
        return None
    size = sum(abs(radius) for radius in radii) if untraced else 1.0

    def same(a: Any, b: Any) -> bool:
        return abs(a - b) <= LARGEST_GAP * size

    def coincide(a: BodyVector, b: BodyVector) -> bool:
        pairs = zip(a.value, b.value, a.given, b.given, strict=True)
        return all(same_component(x, y, of_x, of_y, same) for x, y, of_x, of_y in pairs)

    first, second = (on_joined_bodies(point, pins, coincide, welds) for point in points)
    shared = [body for body in first if body in second and body not in gear.bodies]
    if not shared:
        return None
    body = GROUND if GROUND in shared else shared[0]
    line = [b - a for a, b in zip(first[body].value, second[body].value, strict=True)]
    if untraced and not any(isinstance(x, Tracer) for x in line):
        check = _check_gap if is_toothed(gear) else _check_overlap
        check(name, body, math.hypot(*line), [float(radius) for radius in radii])
        return Arm(body, math.atan2(line[1], line[0]))
    center_distance = jnp.abs(
        radii[0] + radii[1]
    )  # of a design that JAX traces: it fails where there is a gap, or an overlap
    gap = jnp.hypot(*line) - center_distance
    meshes = jnp.abs(gap) <= LARGEST_GAP * center_distance if is_toothed(gear) else gap > 0
    return Arm(body, jnp.where(meshes, jnp.arctan2(line[1], line[0]), jnp.nan))


def _check_gap(name: str, body: str, distance: float, radii: Sequence[float]) -> None:
    """Raise MechanismError unless the distance of two centers on a body suits the pitch radii."""
    center_distance = abs(sum(radii))
    if radii[0] < 0 and radii[1] < 0:
        raise MechanismError(
            "at most one of two gears is a ring, which has a negative radius", name=f"{name}.radii", value=radii
        )
    if center_distance <= LARGEST_GAP * max(map(abs, radii)) or min(radii) < 0 < sum(radii):
        message = "a ring must be larger than the gear inside it"
        raise MechanismError(message, name=f"{name}.radii", value=radii)
    if not abs(distance - center_distance) <= LARGEST_GAP * center_distance:
        kind = "of a ring less that of the gear in it" if min(radii) < 0 else "together"
        message = (
            f"the centers are {distance:.9g} m apart on '{body}', and the pitch radii {kind} are "
            f"{center_distance:.9g} m, a gap of {distance - center_distance:.3g} m: move a center, or change a radius "
            "(a ring has one below zero)"
        )
        if abs(center_distance - 1000 * distance) <= LARGEST_GAP * center_distance:
            message += "; a number without a unit is in m: write mm"
        raise MechanismError(message, name=f"{name}.radii", value=radii)


def _check_overlap(name: str, body: str, distance: float, radii: Sequence[float]) -> None:
    """Raise MechanismError if pulleys on a body overlap."""
    if not distance > sum(radii):
        message = (
            f"the centers are {distance:.9g} m apart on '{body}', and the pulleys overlap below {sum(radii):.9g} m, "
            "the sum of the radii: move a center, or change a radius"
        )
        raise MechanismError(message, name=f"{name}.radii", value=radii)


def _with_slots(elements: Mapping[str, Any]) -> dict[str, Any]:
    """Return elements in which a rope names each body once, also one with several of its points."""
    result = dict(elements)
    for name, element in elements.items():
        if may_have_frame(type(element)) and shares_points(element):
            bodies, slots = distinct(element.bodies)
            result[name] = unchecked_copy(element, bodies=bodies, slots=slots)
    return result


def _with_arms(elements: Mapping[str, Any], arms: Mapping[str, Arm]) -> dict[str, Any]:
    """Return elements in which toothed gears and belts have a third body, their carrier."""
    result = dict(elements)
    for name, arm in arms.items():
        result[name] = unchecked_copy(result[name], bodies=(*result[name].bodies, arm.body))
    return result


def unchecked_copy(element: Any, **values: Any) -> Any:
    """Return an element with other values in some fields, without checks."""
    copy = object.__new__(type(element))
    for field in dataclasses.fields(element):
        object.__setattr__(copy, field.name, values.get(field.name, getattr(element, field.name)))
    return copy


def _with_carriers(
    group: Group, members: Sequence[str], arms: Mapping[str, Arm], mechanism: Mechanism, elements: Mapping[str, Any]
) -> Group:
    """Return a group of gears, belts, ropes or cams with its frames if they are known; other groups unchanged."""
    if not may_have_frame(type(group.element)):
        return group
    if on_line(group.element) and all(name in arms for name in members):
        return with_field(group, "arm", along_instances(*(_number(arms[name].angle) for name in members)))
    if shares_points(elements[members[0]]):
        return with_field(group, "slots", distinct(elements[members[0]].bodies)[1])
    if isinstance(group.element, spatial.Gear):
        _check_points_on_axes({name: elements[name] for name in members}, mechanism)
        return _on_frames(group, [elements[name] for name in members], mechanism)
    if isinstance(group.element, Cam):
        return _on_hinges(group, [elements[name] for name in members], mechanism)
    if isinstance(group.element, spatial.Rolling):
        _check_racks({name: elements[name] for name in members}, mechanism)
    return group


def _number(value: Any) -> Any:
    return value if isinstance(value, Tracer) else np.float64(value)


def _on_frames(group: Group, gears: Sequence[spatial.Gear], mechanism: Mechanism) -> Group:
    """Return spatial gears with the axes of their shafts in the frames, if known, and whole turns."""
    hinges, parameters = joined_vectors(mechanism, held_parallel), mechanism.parameter_values
    attitudes = constant_attitudes(mechanism)
    for slot, field in enumerate(("held_i", "held_j")):
        data = []
        for gear in gears:
            axis = body_vector(gear.bodies[slot], (gear.axis_i, gear.axis_j)[slot], parameters)
            frame_axis = on_joined_bodies(axis, hinges, parallel, attitudes).get(gear.bodies[2])
            if frame_axis is None:
                break
            data.append((as_array(axis.value), as_array(frame_axis.value)))
        if len(data) == len(gears):
            axis, frame_axis = (along_instances(*vectors) for vectors in zip(*data, strict=True))
            group = with_field(group, field, _coaxial(axis, frame_axis))
    return with_field(group, "whole", _whole_multiples(group.element.ratio))


def _check_points_on_axes(gears: Mapping[str, spatial.Gear], mechanism: Mechanism) -> None:
    """Raise MechanismError if a point on the axis of a gear is not on the axis of any of its hinges."""
    parameters, fixed = mechanism.parameter_values, (constant_attitudes(mechanism), welded(mechanism))
    hinges = [
        [body_vector(body, getattr(joint, field + side), parameters) for field in ("axis", "point")]
        for joint in mechanism.joints.values()
        if _is_hinge(type(joint))
        for body, side in zip(joint.bodies, ("_i", "_j"), strict=True)
    ]
    for name, gear in gears.items():
        if gear.point_m is None:
            continue
        for slot, suffix in enumerate(("_i", "_j")):
            body = gear.bodies[slot]
            line = [body_vector(body, getattr(gear, field + suffix), parameters) for field in ("axis", "point")]
            axes, points = (on_joined_bodies(x, (), parallel, held) for x, held in zip(line, fixed, strict=True))
            on_shaft = [
                (*hinge, axes[hinge[0].body], points[hinge[0].body]) for hinge in hinges if hinge[0].body in points
            ]
            if any(isinstance(x, Tracer) for vectors in (line, *on_shaft) for vector in vectors for x in vector.value):
                continue
            distances, sizes = [], []
            for vectors in on_shaft:
                hinge_axis, hinge_point, axis, point = (np.asarray(vector.value, float) for vector in vectors)
                axis = axis / np.linalg.norm(axis)
                if np.linalg.norm(np.cross(axis, hinge_axis)) <= ACROSS * np.linalg.norm(hinge_axis):
                    distances.append(np.linalg.norm(np.cross(axis, hinge_point - point)))
                    sizes.append(np.linalg.norm(hinge_point - point) + np.linalg.norm(point))
            if distances and all(a > LARGEST_GAP * size for a, size in zip(distances, sizes, strict=True)):
                message = (
                    f"this point of '{body}' is {min(distances):.6g} m from the axis of its hinge: "
                    "give one that is on it"
                )
                raise MechanismError(message, name=f"{name}.points", value=list(line[1].value))


def _is_hinge(kind: type[Any]) -> bool:
    """Return whether a class of joints hinges bodies about an axis through points of both."""
    fields = {"point_i", "point_j", "axis_i", "axis_j"}
    return facts_of(kind).symbol in ("revolute", "cylindrical") and fields <= value_fields(kind).keys()


def _check_racks(racks: Mapping[str, spatial.Rolling], mechanism: Mechanism) -> None:
    """Raise MechanismError unless a pinion turns on the rack about its axis, which is perpendicular to the rack."""
    hinges, parameters = joined_vectors(mechanism, held_parallel), mechanism.parameter_values
    for name, rack in racks.items():
        on_rack, pinion_axis, line = (
            body_vector(body, vector, parameters)
            for body, vector in zip(
                (*rack.bodies, rack.bodies[0]), (rack.axis_i, rack.axis_j, rack.vector_i), strict=True
            )
        )
        if any(isinstance(x, Tracer) for vector in (on_rack, pinion_axis, line) for x in vector.value):
            continue
        u, v = (np.asarray(vector.value, float) for vector in (on_rack, line))
        if abs(u @ v) > ACROSS * np.linalg.norm(u) * np.linalg.norm(v):
            tilt = math.degrees(math.asin(min(1.0, abs(u @ v) / (np.linalg.norm(u) * np.linalg.norm(v)))))
            message = (
                f"the axis of a pinion is across its rack, and this one leans along it by {tilt:.3g} deg: give it at "
                "right angles to the vector, both on the first body"
            )
            raise MechanismError(message, name=f"{name}.axes", value=[float(x) for x in u])
        rack_axis = on_joined_bodies(pinion_axis, hinges, parallel, constant_attitudes(mechanism)).get(rack.bodies[0])
        if rack_axis is None or not _same_direction(np.asarray(rack_axis.value, float), u):
            message = (
                "the pinion does not turn about this axis on the rack: hinge it, and guide the rack so that it keeps "
                "its attitude, by joints that have the axes, such as a revolute and a prismatic joint to one body"
            )
            if rack_axis is not None:
                components = ", ".join(f"{float(x):.6g}" for x in rack_axis.value)
                message = (
                    f"by the joints between them, the axis of the pinion is [{components}] on the rack: give that "
                    "one, or the opposite on both bodies"
                )
            raise MechanismError(message, name=f"{name}.axes", value=[float(x) for x in u])


def _same_direction(first: Any, second: Any) -> bool:
    sizes = np.linalg.norm(first) * np.linalg.norm(second)
    return bool(first @ second > 0 and np.linalg.norm(np.cross(first, second)) <= ACROSS * sizes)


def _on_hinges(group: Group, cams: Sequence[Cam], mechanism: Mechanism) -> Group:
    """Return cams whose spatial angles have their axes on both bodies, if known."""
    hinges, attitudes = None, ()
    for field in ("follower", "leader"):
        if not turns_in_space(getattr(group.element, field)):
            continue
        if hinges is None:
            hinges, attitudes = joined_vectors(mechanism, held_parallel), constant_attitudes(mechanism)
        parts = [getattr(cam, field) for cam in cams]
        axes = [body_vector(part.bodies[0], part.axis_i, mechanism.parameter_values) for part in parts]
        other_axes = [
            on_joined_bodies(axis, hinges, parallel, attitudes).get(part.bodies[1])
            for axis, part in zip(axes, parts, strict=True)
        ]
        if any(other is None for other in other_axes):
            continue
        first, second = (along_instances(*(as_array(x.value) for x in vectors if x)) for vectors in (axes, other_axes))
        part, datum = getattr(group.element, field), _coaxial(first, second)
        if part.vector_j is not None:  # the component along the axis has no effect
            datum = with_fields(datum, across=_across(part.vector_j, second))
        group = with_field(group, field, with_fields(part, datum=datum))
    return group


def _across(vector: Any, axis: Any) -> Any:
    unit = axis / ((axis * axis).sum(axis=0) ** 0.5)
    return vector - (vector * unit).sum(axis=0) * unit


_coaxial_of = compiled(brief=True)(coaxial)


def _coaxial(axis: Any, other_axis: Any) -> Datum:
    datum = _coaxial_of(axis, other_axis)
    if isinstance(datum.attitude, Tracer):  # the call is inside a function that JAX compiles
        return datum
    return Datum(*(np.asarray(x) for x in (datum.attitude, datum.angle, datum.near)))


def _whole_multiples(ratio: Any) -> Any:
    """Return the smallest factors, (instances, 1), that make ratios whole; NaN if there is none."""
    namespace = jnp if isinstance(ratio, Tracer) else np
    counts = np.arange(1.0, LARGEST_WHOLE + 1)
    products = ratio[..., None] * counts
    fits = namespace.abs(products - namespace.round(products)) <= WHOLE * namespace.maximum(
        1.0, namespace.abs(products)
    )
    return namespace.where(fits.any(axis=-1), 1.0 + namespace.argmax(fits, axis=-1), np.nan)
