"""What mechanisms look like on the page: meshes from their joints, connectors, and points to choose from."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from jounce.kinematics import Motion
from jounce.mechanism import Mechanism, PointOutput
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve
from jounce.plot.geometry import Skeleton, skeleton
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

__all__ = ["mechanism_appearance"]

ROD, SPRING, ACTUATOR = ("rod", 0.012, GRAY), ("spring", 0.022, (90, 120, 90)), ("actuator", 0.016, (136, 34, 85))
CONNECTORS = {  # by symbol: kind, radius in sizes of the mechanism, and color
    "rod": ROD,
    "spring": SPRING,
    "distance": ACTUATOR,
}


def mechanism_appearance(motion: Motion) -> Appearance:
    """Return what the bodies of a mechanism look like; sliders get rails as long as they travel in a motion.

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
        connectors=list(_connectors(seen)),
        points=_points(mechanism, seen),
        size=seen.size,
        up=(0.0, 1.0, 0.0) if planar else upward(_gravity(mechanism)),
        front=(len(seen.links) + 1) * THICKNESS * seen.size if planar else 0.0,
    )


def _gravity(mechanism: Mechanism) -> np.ndarray:
    given = mechanism.gravity
    return np.zeros(3) if given is None else np.asarray(resolve(given, mechanism.parameter_values), float)


def _connectors(seen: Skeleton) -> Iterator[Connector]:
    """Give the rods, springs and actuators between two points."""
    for symbol in (*seen.symbols, *seen.drivers, *seen.forces):
        if symbol.kind in CONNECTORS and len(symbol.bodies) == 2:
            kind, share, color = CONNECTORS[symbol.kind]
            yield Connector(symbol.name, kind, symbol.bodies, symbol.points, share * seen.size, color)


def _points(mechanism: Mechanism, seen: Skeleton) -> list[BodyPoint]:
    """Return the points of outputs, then those where joints are, but for those of the ground."""
    points = []
    for name, output in mechanism.outputs.items():
        if isinstance(output, PointOutput):
            position = np.asarray(resolve(output.point, mechanism.parameter_values), float)
            points.append(BodyPoint(output.bodies[0], tuple(position.tolist()), name))
    known = {(point.body, point.point) for point in points}
    for body, link in seen.links.items():
        for position, names in zip(link.points, link.names, strict=True):
            if body != GROUND and (body, tuple(position.tolist())) not in known:
                words = ", ".join(names) or "center of mass"
                points.append(BodyPoint(body, tuple(position.tolist()), f"{body}: {words}"))
    return points
