"""Points and directions that joints hold together, such as a center pinned to several bodies, or an axis of rotation.

Traced values are the same if they are given by the same numbers or expressions.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.constraints import planar, spatial
from jounce.constraints.facts import PAIRS, facts_of
from jounce.errors import JounceError
from jounce.mechanism.mechanism import Mechanism
from jounce.mechanism.resolve import resolve

SAME_DIRECTION = 1e-9  # largest sine of the angle between equal directions


class BodyVector(NamedTuple):
    """A point or a direction of a body: the components in numbers, and as given."""

    body: str
    value: tuple[Any, ...]
    given: tuple[Any, ...]


class Axes(NamedTuple):
    """Orthonormal directions of a body, in the rows of a matrix, and, for points, the origin of the axes."""

    body: str
    directions: Float[np.ndarray, "axis component"]
    origin: Any = 0.0


Joined = Sequence[tuple[BodyVector, BodyVector]]
"""Pairs of points or directions that a joint holds together."""

Fixtures = Sequence[tuple[Axes, Axes]]
"""Common axes of two bodies whose relative attitude, or for points pose, is constant."""


def joined_vectors(
    mechanism: Mechanism, pairs_of: Callable[[Any], Sequence[tuple[str, str]]]
) -> list[tuple[BodyVector, BodyVector]]:
    """Return the points or directions that joints hold together; `pairs_of` returns the pairs of fields of a joint."""
    pairs = []
    for joint in mechanism.joints.values():
        for names in pairs_of(joint):
            try:
                first, second = (
                    body_vector(body, getattr(joint, name), mechanism.parameter_values)
                    for body, name in zip(joint.bodies, names, strict=False)
                )
            except JounceError:
                continue
            pairs.append((first, second))
    return pairs


def constant_attitudes(mechanism: Mechanism) -> list[tuple[Axes, Axes]]:
    """Return pairs of bodies with a constant relative attitude, by joints that hold two directions of each parallel."""
    attitude_pairs = (_held_axes(joint, mechanism.parameter_values) for joint in mechanism.joints.values())
    return [pair for pair in attitude_pairs if pair is not None]


def _held_axes(joint: Any, parameters: Mapping[str, Any]) -> tuple[Axes, Axes] | None:
    """Return axes that a joint holds parallel on its two bodies; None if it leaves a rotation, or they are traced."""
    pairs = held_parallel(joint)
    if len(pairs) < 2:
        return None
    try:
        vectors = [
            [body_vector(body, getattr(joint, pair[slot]), parameters).value for pair in pairs]
            for slot, body in enumerate(joint.bodies[:2])
        ]
    except JounceError:
        return None
    if any(isinstance(x, Tracer) for part in vectors for vector in part for x in vector):
        return None
    first, second = (_triad(*(np.asarray(vector, float) for vector in part[:2])) for part in vectors)
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        return None
    return Axes(joint.bodies[0], first), Axes(joint.bodies[1], second)


def welded(mechanism: Mechanism) -> list[tuple[Axes, Axes]]:
    """Return axes that a weld holds together, with their origins, on each of its two bodies."""
    parameters = mechanism.parameter_values
    welds = []
    for joint in mechanism.joints.values():
        if not isinstance(joint, planar.Fixed | spatial.Fixed):
            continue
        try:
            points = [
                body_vector(*pair, parameters).value
                for pair in zip(joint.bodies, (joint.point_i, joint.point_j), strict=True)
            ]
            axes = _held_axes(joint, parameters) if isinstance(joint, spatial.Fixed) else _turned(joint, mechanism)
        except JounceError:
            continue
        if axes is not None and not any(isinstance(x, Tracer) for point in points for x in point):
            first, second = (part._replace(origin=np.asarray(x)) for part, x in zip(axes, points, strict=True))
            welds.append((first, second))
    return welds


def _turned(weld: planar.Fixed, mechanism: Mechanism) -> tuple[Axes, Axes] | None:
    """Return the axes of the first body of a planar weld, on both of its bodies; None if they are traced."""
    parameters, bodies = mechanism.parameter_values, mechanism.bodies
    first, second = (resolve(bodies[body].angle, parameters) if body in bodies else 0.0 for body in weld.bodies)
    angle = second - first if weld.offset is None else resolve(weld.offset, parameters)
    if isinstance(angle, Tracer):
        return None
    c, s = np.cos(angle), np.sin(angle)
    return Axes(weld.bodies[0], np.eye(2)), Axes(weld.bodies[1], np.array([[c, -s], [s, c]]))


def _triad(axis: Float[np.ndarray, " 3"], normal: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return orthonormal vectors, in rows: along an axis, toward a normal, and perpendicular to both."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first = axis / np.linalg.norm(axis)
        second = normal - (normal @ first) * first
        second = second / np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])


def pinned(joint: Any) -> list[tuple[str, str]]:
    """Return the fields of the points that a planar revolute joint holds together; empty for other joints."""
    facts = facts_of(type(joint))
    return [("point_i", "point_j")] if facts.pair == "revolute" and PAIRS["revolute"] else []


def held_parallel(joint: Any) -> Sequence[tuple[str, str]]:
    """Return the pairs of fields of the directions that a joint holds parallel."""
    return facts_of(type(joint)).held_parallel


def body_vector(body: str, given: Any, parameters: Mapping[str, Any]) -> BodyVector:
    """Return a point or a direction of a body with numbers in the place of parameters."""
    entries = tuple(given.tolist() if isinstance(given, np.ndarray) else given)
    return BodyVector(body, tuple(resolve(entry, parameters) for entry in entries), entries)


def same_component(a: Any, b: Any, given_a: Any, given_b: Any, is_close: Callable[[Any, Any], bool]) -> bool:
    """Return whether components are the same; traced values are compared as given."""
    if isinstance(a, Tracer) or isinstance(b, Tracer):
        traced = isinstance(given_a, Tracer) or isinstance(given_b, Tracer)
        return a is b or (not traced and bool(given_a == given_b))
    return bool(is_close(a, b))


def parallel(a: BodyVector, b: BodyVector) -> int:
    """Return 1 for equal directions, -1 for opposite ones, else 0."""
    if any(isinstance(x, Tracer) for x in (*a.value, *b.value)):
        pairs = zip(a.value, b.value, a.given, b.given, strict=True)
        return int(all(same_component(x, y, of_x, of_y, lambda p, q: p == q) for x, y, of_x, of_y in pairs))
    u, v = (np.asarray(x.value, float) / (np.linalg.norm(x.value) or 1.0) for x in (a, b))
    return int(np.sign(u @ v)) if np.linalg.norm(np.cross(u, v)) <= SAME_DIRECTION else 0


def on_joined_bodies(
    start: BodyVector,
    joined: Joined,
    match: Callable[[BodyVector, BodyVector], int | bool],
    fixed: Fixtures = (),
) -> dict[str, BodyVector]:
    """Return a point or direction on each body to which a chain of joints connects it.

    Parameters
    ----------
    start : BodyVector
        The point or direction on its own body.
    joined : sequence of tuple of BodyVector
        Pairs of points or directions that joints hold together.
    match : callable
        Returns whether two vectors of a body are the same: 1, or -1 for opposite directions.
    fixed : sequence of tuple of Axes, optional
        Common axes of two bodies whose relative attitude, or for points pose, is constant: every direction, or point,
        is then known on both.
    """
    reached, pending = {start.body: start}, [start]
    while pending:
        vector = pending.pop(0)
        for pair in joined:
            for near, far in (pair, pair[::-1]):
                if near.body != vector.body or far.body in reached:
                    continue
                if sign := int(match(vector, near)):
                    image = far if sign > 0 else BodyVector(far.body, tuple(-x for x in far.value), far.given)
                    reached[far.body] = image
                    pending.append(image)
        for first, second in () if any(isinstance(x, Tracer) for x in vector.value) else fixed:
            for near, far in ((first, second), (second, first)):
                if near.body == vector.body and far.body not in reached:
                    from_origin = np.asarray(vector.value, float) - near.origin
                    image = tuple((far.origin + far.directions.T @ (near.directions @ from_origin)).tolist())
                    reached[far.body] = BodyVector(far.body, image, image)
                    pending.append(reached[far.body])
    return reached


def as_array(value: tuple[Any, ...]) -> Any:
    """Return components as an array, of JAX if one of them is traced."""
    return (
        jnp.stack([jnp.asarray(x, float) for x in value])
        if any(isinstance(x, Tracer) for x in value)
        else np.array(value, float)
    )
