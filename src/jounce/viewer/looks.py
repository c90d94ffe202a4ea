"""What bodies look like on the page: solids from the joints of a mechanism, springs and rods between two points."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.mechanism import Mechanism, PointOutput
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve_element
from jounce.viewer.planar import planar_solids
from jounce.viewer.solids import DARK, GREY, Solid
from jounce.viewer.spatial import spatial_solids
from jounce.viewer.take import Spot, spatial_vectors

__all__ = ["BODIES", "Looks", "Stretch", "looks_of"]

# the light colours of Tol, told apart by the colour-blind; arrows have the strong ones
BODIES = (
    (119, 170, 221),
    (238, 136, 102),
    (68, 187, 153),
    (238, 221, 136),
    (187, 204, 51),
    (255, 170, 187),
    (153, 221, 255),
    (170, 170, 0),
)


@dataclasses.dataclass(frozen=True, eq=False)
class Stretch:
    """What joins a point of one body to a point of another: a rod, a spring, an actuator.

    Parameters
    ----------
    name : str
    kind : {"rod", "spring", "actuator"}
    bodies : tuple of str
    points : tuple of array of shape (3,)
        One on each body, in its frame, m.
    radius : float
        m.
    colour : tuple of int
    """

    name: str
    kind: str
    bodies: tuple[str, str]
    points: tuple[np.ndarray, np.ndarray]
    radius: float
    colour: tuple[int, int, int]


@dataclasses.dataclass(frozen=True, eq=False)
class Looks:
    """Shapes of all bodies.

    Parameters
    ----------
    solids : dict of str to tuple of Solid
        By body, in its frame.
    stretches : tuple of Stretch
    spots : tuple of Spot
        Points that the page offers for arrows and paths; outputs first.
    size : float
        A length of the whole, m.
    up : tuple of float
        What is up.
    front : float
        z in front of all planar bodies, m; zero in space.
    colours : dict of str to tuple of int
        The main colour of each body.
    """

    solids: Mapping[str, tuple[Solid, ...]]
    stretches: tuple[Stretch, ...]
    spots: tuple[Spot, ...]
    size: float
    up: tuple[float, float, float]
    front: float = 0.0
    colours: Mapping[str, tuple[int, int, int]] = dataclasses.field(default_factory=dict)

    def extents(self) -> dict[str, np.ndarray]:
        """Return the corners of the box of each body, (8, 3), in its frame."""
        found = {}
        for body, solids in self.solids.items():
            if not solids:
                continue
            low = np.min([solid.vertices.min(axis=0) for solid in solids], axis=0)
            high = np.max([solid.vertices.max(axis=0) for solid in solids], axis=0)
            found[body] = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
        return found


def looks_of(motion: Any) -> Looks:
    """Return what the bodies of a mechanism look like; sliders get rails as long as they travel.

    Parameters
    ----------
    motion : Motion
        Of the mechanism.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.viewer.looks import looks_of
    >>> looks = looks_of(jn.solve(jn.load("examples/four_bar.yaml"), [0.0], order=0))
    >>> sorted(looks.solids), [rod.name for rod in looks.stretches]
    (['crank', 'ground', 'rocker'], ['BC'])
    """
    from jounce.plot.geometry import skeleton

    mechanism = motion.mechanism
    seen = skeleton(mechanism)
    planar = mechanism.space == "planar"
    colours = {body: BODIES[k % len(BODIES)] for k, body in enumerate(mechanism.bodies)} | {GROUND: DARK}
    solids, front = (planar_solids if planar else spatial_solids)(motion, seen, colours)
    return Looks(
        solids=solids,
        stretches=stretches(seen),
        spots=spots(mechanism, seen),
        size=seen.size,
        up=(0.0, 1.0, 0.0) if planar else up_of(mechanism.gravity),
        front=front,
        colours=colours,
    )


def up_of(gravity: Any) -> tuple[float, float, float]:
    """Return the axis nearest to what is up: against gravity, or z.

    Examples
    --------
    >>> up_of([0, -9.81, 0]), up_of(None), up_of([0, 0, 0])
    ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    """
    try:
        down = np.zeros(3) if gravity is None else np.asarray(gravity, float)
    except (TypeError, ValueError):  # expressions
        down = np.zeros(3)
    if down.shape != (3,) or not np.any(down):
        return 0.0, 0.0, 1.0
    k = int(np.argmax(np.abs(down)))
    x, y, z = (float(v) + 0.0 for v in -np.sign(down[k]) * np.eye(3)[k])
    return x, y, z


def stretches(seen: Any) -> tuple[Stretch, ...]:
    """Return the rods, springs and actuators between two points."""
    rod, spring, actuator = ("rod", 0.012, GREY), ("spring", 0.022, (90, 120, 90)), ("actuator", 0.016, (136, 34, 85))
    kinds = {"double_revolute": rod, "double_spherical": rod, "spring": spring}
    kinds |= {"distance": actuator, "distance_force": actuator}
    found = []
    for symbol in (*seen.symbols, *seen.drivers, *seen.forces):
        if symbol.kind not in kinds or len(symbol.bodies) != 2:
            continue
        points = tuple(spatial_vectors(np.asarray(point, float)) for point in symbol.points)
        kind, share, colour = kinds[symbol.kind]
        bodies = symbol.bodies[0], symbol.bodies[1]
        found.append(Stretch(symbol.name, kind, bodies, (points[0], points[1]), share * seen.size, colour))
    return tuple(found)


def spots(mechanism: Any, seen: Any) -> tuple[Spot, ...]:
    """Return the points of outputs, then those where joints are, but for those of the ground."""
    found = output_spots(mechanism)
    known = {(spot.body, spot.point) for spot in found}
    for body, link in seen.links.items():
        if body == GROUND:
            continue
        for point, names in zip(link.points, link.names, strict=True):
            place = tuple(float(x) for x in point)
            if (body, place) not in known:
                words = ", ".join(names) or "centre of mass"
                found.append(Spot(body, place, f"{body}: {words}"))
                known.add((body, place))
    return tuple(found)


def output_spots(mechanism: Mechanism) -> list[Spot]:
    """Return the points that are outputs, with their numbers."""
    components = 2 if mechanism.space == "planar" else 3
    found = []
    for name, output in mechanism.outputs.items():
        if isinstance(output, PointOutput):
            point = resolve_element(output, mechanism.parameter_values, components, f"outputs.{name}")["point"]
            found.append(Spot(output.bodies[0], tuple(float(x) for x in point), name))
    return found
