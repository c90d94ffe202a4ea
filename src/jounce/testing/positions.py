"""Contracts at positions where a joint holds: the number of independent equations, and the facts of the class."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.constraints import planar
from jounce.constraints.facts import dimension_of_field, facts_of, field_kinds
from jounce.jet import Jet
from jounce.mechanism.system import Group
from jounce.testing.samples import (
    INSTANT,
    Motion,
    directions,
    displaced,
    group_of,
    pose_of,
    random_motion,
    with_unknowns,
)
from jounce.testing.subject import Broken, SkippedContract, Subject, evaluated, random_start, residual

STARTS, STEPS = 8, 40
NEEDED = 2  # positions
CLOSED, NEARLY = 1e-13, 1e-10  # last corrections, m or rad: while they decrease, and if rounding limits them
DEPENDENT = 1e-9  # ratio of the smallest singular value to the largest
FACTOR = 3.0  # factor on lengths and directions
PAIRS = {"revolute": planar.Revolute, "rod": planar.DoubleRevolute, "prismatic": planar.Prismatic}


def rank(subject: Subject) -> None:
    """Check that a joint that holds has as many independent equations as rows, or as the subject claims."""
    group = group_of([_sample(subject)], subject.space)
    for _, slopes in _positions(subject, group):
        sizes = np.linalg.svd(slopes, compute_uv=False)
        count, rows = int((sizes > DEPENDENT * sizes[0]).sum()), len(slopes)
        equations = rows if subject.equations is None else subject.equations
        if count != equations:
            raise Broken(
                f"where it holds, its {rows} rows are {count} independent equations, not {equations}; leave out rows "
                "that follow from others, and square none that vanishes by itself"
            )


def facts(subject: Subject) -> None:
    """Check the facts that the class states: directions held parallel, a squared distance, a pair, dimensions."""
    element = _sample(subject)
    declared, group = facts_of(type(element)), group_of([element], subject.space)
    positions = _positions(subject, group)
    for motion, _ in positions:
        _held_parallel(group, motion)
        if declared.point_distance and not declared.pair:
            _point_distance(group, motion, declared.point_distance)
        if declared.pair:
            _is_pair(subject, element, motion)
        _dimensions(subject, element, motion)
    if declared.squared_distance:
        _squared_distance(subject, element)


def _sample(subject: Subject) -> Any:
    """Return a random joint; directions that must not be parallel are perpendicular to each other."""
    element = subject.samples.element(subject.random())
    variant = {}
    for name, other in facts_of(type(element)).never_parallel:
        vector, axis = getattr(element, name), getattr(element, other)
        if vector is not None and axis is not None and name not in subject.samples.given:
            vector, axis = np.asarray(vector, float), np.asarray(axis, float)
            variant[name] = (vector - axis * (vector @ axis) / (axis @ axis)).tolist()
    return dataclasses.replace(element, **variant)


def _positions(subject: Subject, group: Group) -> list[tuple[Motion, np.ndarray]]:
    """Return positions where a joint holds, with their Jacobians, shape (rows, coordinates)."""
    random, positions = subject.random(), subject.positions
    for _ in range(STARTS):
        if len(positions) == NEEDED:
            break
        position = _closed(subject, group, random_start(subject, random))
        if position is not None:
            positions.append(position)
    if not positions:
        raise Broken(
            f"from {STARTS} random positions of its bodies none was found in which the joint holds; give `values` of "
            "its fields with which it can, or see whether its residual has a zero"
        )
    return positions


def _closed(subject: Subject, group: Group, motion: Motion) -> tuple[Motion, np.ndarray] | None:
    """Return a position near a given one where a joint holds, by Gauss-Newton, or None."""
    unit = directions(subject.space)
    unknowns = np.stack([np.zeros_like(unit), unit])
    clock = Jet.constant(jnp.full((1, unit.shape[-1]), INSTANT), 1)
    for k in range(STEPS + 1):
        values = evaluated(group, with_unknowns(motion, unknowns), clock)[..., 0, :]
        gap, slopes = values[0, :, 0], values[1]
        if not np.isfinite(values).all():
            return None
        step = np.linalg.lstsq(slopes, -gap, rcond=1e-12)[0]
        size = float(np.abs(step).max())
        if size <= (CLOSED if k < STEPS else NEARLY):
            return motion, slopes
        direction = step * min(1.0, 0.5 / size)
        shift = np.tensordot(unit, direction, axes=1)[..., None]
        motion = displaced(motion, shift)
        if "quaternion" in motion:
            motion["quaternion"][0] /= np.linalg.norm(motion["quaternion"][0], axis=0)
    return None


def _held_parallel(group: Group, motion: Motion) -> None:
    pose = pose_of(motion)
    for names in facts_of(type(group.element)).held_parallel:
        first, second = (
            np.array(pose.take(bodies).direction(getattr(group.element, name)).coefficients[0])[:, 0, 0]
            for name, bodies in zip(names, group.bodies[:2], strict=True)
        )
        size = np.linalg.norm(first) * np.linalg.norm(second)
        if abs(abs(first @ second) / size - 1.0) > 1e-12:
            angle = np.degrees(np.arccos(np.clip(first @ second / size, -1, 1)))
            raise Broken(
                f"held_parallel {names}: where the joint holds, they are at an angle of {angle:.3g} deg; leave the "
                "pair out, or have the residual hold it"
            )


def _point_distance(group: Group, motion: Motion, fact: str) -> None:
    """Check the distance between the points of a joint that holds."""
    pose = pose_of(motion)
    first, second = (
        np.array(pose.take(bodies).point(getattr(group.element, name)).coefficients[0])[:, 0, 0]
        for name, bodies in zip(("point_i", "point_j"), group.bodies[:2], strict=True)
    )
    distance = float(np.linalg.norm(second - first))
    expected = 0.0 if fact == "zero" else float(np.squeeze(getattr(group.element, fact)))
    if abs(distance - abs(expected)) > 1e-10 * max(1.0, abs(expected)):
        raise Broken(f"point_distance {fact!r}: where the joint holds, its points are {distance:.6g} m apart")


def _is_pair(subject: Subject, element: Any, motion: Motion) -> None:
    """Check that a joint and its pair hold at the same positions."""
    pair = facts_of(type(element)).pair
    kind = PAIRS[pair]
    values = {name: getattr(element, name, None) for name in field_kinds(kind)}
    if pair == "prismatic" and values["vector_j"] is None:
        raise SkippedContract("a prismatic pair without vector_j is not compared with that of the library")
    paired = group_of([kind(element.bodies, **values)], subject.space)
    subject.same(residual(paired, motion)[0], 0 * residual(paired, motion)[0], 1e-11, f"pair {pair}: it does not hold")
    other = _closed(subject, paired, random_start(subject, subject.random()))
    if other is not None:
        gap = residual(group_of([element], subject.space), other[0])[0]
        subject.same(gap, 0 * gap, 1e-11, f"pair {pair}: the joint does not hold where it does")


def _squared_distance(subject: Subject, element: Any) -> None:
    """Check that the residual plus the square of the value is that of a distance, for any value."""
    field = facts_of(type(element)).squared_distance
    motion = random_motion(subject.random(), subject.space, 0, batch=20)
    is_law = field_kinds(type(element))[field] == "motion"
    squares = []
    for value in (0.5, 1.2):
        variant = dataclasses.replace(element, **{field: str(value) if is_law else value})
        squares.append(residual(group_of([variant], subject.space), motion)[0] + value**2)
    message = f"squared_distance {field!r}: the residual is not the square of a distance less the square of it"
    subject.same(squares[0], squares[1], 1e-14, message)
    if squares[0].min() < 0 or len(squares[0]) != 1:
        raise Broken(message)


def _dimensions(subject: Subject, element: Any, motion: Motion) -> None:
    """Check that a joint still holds after all lengths and directions are multiplied by a factor."""
    variant: dict[str, Any] = {}
    for name, kind in field_kinds(type(element)).items():
        value = getattr(element, name)
        dimension = dimension_of_field(element, name)
        scales = dimension in ("length", "length per angle", "direction")
        if kind == "curve" and dimension == "length":
            variant[name] = tuple(f"{FACTOR}*({entry})" for entry in value)
            continue
        if kind not in ("scalar", "vector", "points", "motion") or (value is None and not scales):
            continue
        if value is None or not (scales or dimension in ("angle", "ratio")):
            return  # without a dimension of a field or the default of a length
        if scales:
            variant[name] = f"{FACTOR}*({value})" if kind == "motion" else (FACTOR * np.asarray(value)).tolist()
    scaled = {**motion, "position": FACTOR * motion["position"]}
    gap = residual(group_of([dataclasses.replace(element, **variant)], subject.space), scaled)[0]
    if period := subject.period_of(group_of([element], subject.space)):
        period = FACTOR * period if isinstance(subject.period, str) else period
        gap[-1] -= period * np.round(gap[-1] / period)
    message = (
        f"dimensions: a joint that holds no longer does where all lengths are multiplied by {FACTOR:g}; one of its "
        "fields has another dimension than the class states"
    )
    subject.same(gap, 0 * gap, 1e-10, message)
