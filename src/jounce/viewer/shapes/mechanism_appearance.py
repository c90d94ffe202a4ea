"""Appearance of mechanisms on the page: meshes from their joints, connectors, and selectable points."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from jounce.kinematics import Motion
from jounce.mechanism import Mechanism, PointOutput
from jounce.mechanism.building.belts import belt_course, belt_outline
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve
from jounce.plot.drawings.frames import frames, points_at
from jounce.plot.drawings.geometry import Skeleton, skeleton
from jounce.viewer.shapes.appearance import (
    BODY_COLORS,
    DARK,
    GRAY,
    Appearance,
    BodyPoint,
    ColoredMesh,
    Connector,
    upward,
)
from jounce.viewer.shapes.mechanism_meshes import THICKNESS, planar_meshes, spatial_meshes
from jounce.viewer.shapes.recording import spatial_vectors

ROD, SPRING, ACTUATOR = ("rod", 0.012, GRAY), ("spring", 0.022, (90, 120, 90)), ("actuator", 0.016, (136, 34, 85))
ROPE, BROWN = 0.005, (138, 90, 43)
CONNECTORS = {  # by symbol: kind, radius in sizes of the mechanism, and color
    "rod": ROD,
    "spring": SPRING,
    "distance": ACTUATOR,
}


def mechanism_appearance(motion: Motion) -> Appearance:
    """Return the appearance of a mechanism, with rails as long as the travel of sliders in a motion.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.viewer.shapes.mechanism_appearance import mechanism_appearance
    >>> found = mechanism_appearance(jn.solve(jn.load("examples/four_bar.yaml"), [0.0], order=0))
    >>> sorted(found.meshes), [rod.name for rod in found.connectors]
    (['crank', 'ground', 'rocker'], ['BC'])
    """
    mechanism = motion.mechanism
    seen, planar = skeleton(mechanism), mechanism.space == "planar"
    colors = {body: BODY_COLORS[k % len(BODY_COLORS)] for k, body in enumerate(mechanism.rigid_bodies)} | {GROUND: DARK}
    meshes: dict[str, list[ColoredMesh]] = {body: [] for body in seen.links}
    for body, mesh, color in (planar_meshes if planar else spatial_meshes)(motion, seen, colors):
        meshes[body].append(ColoredMesh(mesh, color))
    return Appearance(
        meshes=meshes,
        connectors=[*_connectors(seen), *_lines(motion, seen)],
        points=_points(mechanism, seen),
        size=seen.size,
        up=(0.0, 1.0, 0.0) if planar else upward(_gravity(mechanism)),
        front=(len(seen.links) + 1) * THICKNESS * seen.size if planar else 0.0,
    )


def _gravity(mechanism: Mechanism) -> np.ndarray:
    given = mechanism.gravity
    return np.zeros(3) if given is None else np.asarray(resolve(given, mechanism.parameter_values), float)


def _connectors(skeleton_: Skeleton) -> Iterator[Connector]:
    """Yield the rods, springs and actuators between two points."""
    for symbol in (*skeleton_.symbols, *skeleton_.drivers, *skeleton_.forces):
        if symbol.kind in CONNECTORS and len(symbol.bodies) == 2:
            kind, fraction, color = CONNECTORS[symbol.kind]
            yield Connector(symbol.name, kind, symbol.bodies, symbol.points, fraction * skeleton_.size, color)


def _lines(motion: Motion, seen: Skeleton) -> Iterator[Connector]:
    """Yield the spans of ropes, and the strands of belts."""
    for symbol in seen.symbols:
        if symbol.kind == "rope":
            for k, slots in enumerate(pairwise(range(len(symbol.bodies)))):
                bodies = tuple(symbol.bodies[slot] for slot in slots)
                points = tuple(symbol.points[slot] for slot in slots)
                yield Connector(f"{symbol.name} {k + 1}", "line", bodies, points, ROPE * seen.size, BROWN)
        elif symbol.kind == "belt":
            poses, radii = frames(motion), [radius or 0.0 for radius in symbol.radii]
            centers = [points_at(poses[symbol.bodies[slot]], symbol.points[slot]).T for slot in (0, 1)]
            course = belt_course(centers[0], centers[1], radii, symbol.crossed)
            outline = spatial_vectors(belt_outline(course, centers, radii, symbol.crossed))
            half = outline.shape[1] // 2
            for k, (first, last) in enumerate(((-1, 0), (half - 1, half))):
                ends = outline[:, first], outline[:, last]
                yield Connector(f"{symbol.name} {k + 1}", "line", (), (), ROPE * seen.size, DARK, ends)


def _points(mechanism: Mechanism, seen: Skeleton) -> list[BodyPoint]:
    """Return the points of outputs, then those of joints, except on the ground."""
    points = []
    for name, output in mechanism.outputs.items():
        if isinstance(output, PointOutput):
            position = np.asarray(resolve(output.point, mechanism.parameter_values), float)
            points.append(BodyPoint(output.bodies[0], tuple(position.tolist()), name))
    pairs = {(point.body, point.point) for point in points}
    for body, link in seen.links.items():
        for position, names in zip(link.points, link.names, strict=True):
            if body != GROUND and (body, tuple(position.tolist())) not in pairs:
                label = ", ".join(names) or "center of mass"
                points.append(BodyPoint(body, tuple(position.tolist()), f"{body}: {label}"))
    return points
