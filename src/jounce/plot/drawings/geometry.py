"""Drawn geometry of a mechanism: links through the points of their joints, joints as symbols.

A mechanism has no shapes. Its drawing follows from the points, axes and radii of its joints, drivers, forces and
outputs of all types, including those of users.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.constraints.base import AbstractConstraint
from jounce.constraints.facts import facts_of, field_kinds
from jounce.errors import JounceError
from jounce.forces.base import AbstractForce
from jounce.mechanism import Mechanism
from jounce.mechanism.mechanism import GROUND, check_mechanism
from jounce.mechanism.resolve import check_value, resolve
from jounce.mechanism.system import POSITION_COMPONENTS
from jounce.plot.drawings.cams import cam_disc
from jounce.plot.drawings.curve_lines import NONE, CurveLines, curve_lines
from jounce.plot.drawings.frames import guessed, points_at
from jounce.plot.drawings.gears import pitch_radii, shaft_wheels

Point = Float[np.ndarray, " components"]
Points = Float[np.ndarray, "points components"]
Element = AbstractConstraint | AbstractForce
Values = Mapping[str, np.ndarray]  # numbers and vectors of an element by field

SLOTS = {"_i": 0, "_j": 1, "_m": 2}  # suffixes of fields, and the body of each
SAME = 1e-9  # sizes of the mechanism: points nearer to each other coincide


@dataclass(frozen=True)
class DrawnLink:
    """Drawn shape of a body: the points of its joints and other elements, and the bars between them.

    Parameters
    ----------
    body : str
        Name of the body; ``"ground"`` has no bars.
    points : numpy.ndarray of shape (points, components)
        Points in the frame of the body, m; at least one.
    names : tuple of tuple of str
        Joints, drivers, forces and outputs at each point; none at a center of mass or an origin added as a substitute.
    edges : tuple of tuple of int
        Pairs of points with a bar between them: a single bar, the closed outline of a plate with bars to further
        points, or a tree for points that are not in a plane.
    """

    body: str
    points: Points
    names: tuple[tuple[str, ...], ...]
    edges: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Symbol:
    """Drawn symbol of a joint, driver or force.

    Parameters
    ----------
    name, kind : str
        Name of the element, and symbol of its class; also ``gear`` for a fixed ratio of two angles, ``rack`` for a
        wheel that rolls along x or y, ``cam`` for a plate cam.
    bodies : tuple of str
        Bodies of the element, in the order i, j, m.
    points : tuple of numpy.ndarray
        A point on each body, in its frame, m; for gears the center.
    axes : tuple of numpy.ndarray or None
        Axis, direction of travel or normal on each body, in its frame, of any length. The first axis of a rack points
        from the center of the wheel to the contact, and that of a coordinate is its direction, both in the global
        frame.
    radii : tuple of float or None
        Pitch radius of a gear, or radius of a wheel, of each body, m.
    internal : bool, default False
        Whether gears form an internal pair.
    curve : CurveLines
        Lines on the first body that constrain the point of the second.
    crossed : bool, default False
        Whether the strands of a belt cross.
    """

    name: str
    kind: str
    bodies: tuple[str, ...]
    points: tuple[Point, ...]
    axes: tuple[Point | None, ...]
    radii: tuple[float | None, ...]
    internal: bool = False
    curve: CurveLines = NONE
    crossed: bool = False

    @property
    def moving_slot(self) -> int:
        """Number of the body to which the symbol is fixed: the last one that moves."""
        slots = [k for k, body in enumerate(self.bodies[:2]) if body != GROUND]
        return slots[-1] if slots else 0

    @property
    def block_and_rail(self) -> tuple[int, int]:
        """Numbers of the sliding body and of the body with the rail: the ground, or else the first body."""
        return (0, 1) if self.bodies[1] == GROUND else (1, 0)

    def axis_on(self, slot: int) -> Point:
        """Return the axis or direction on one of the bodies, in its frame; x if it has none."""
        axes = [axis for axis in (self.axes[slot], self.axes[1 - slot]) if axis is not None]
        return axes[0] if axes else np.eye(len(self.points[slot]))[0]


@dataclass(frozen=True)
class Wheel:
    """A gear, or a rolling wheel.

    Parameters
    ----------
    body : str
    center : numpy.ndarray of shape (2,)
        Center in the frame of the body, m.
    radius : float
        Pitch radius, m.
    internal : bool
        Whether it is a ring gear with internal teeth.
    partner : float or None
        Pitch radius of the meshing gear, m; None for a wheel without teeth.
    """

    body: str
    center: Point
    radius: float
    internal: bool
    partner: float | None


@dataclass(frozen=True)
class Skeleton:
    """Drawn geometry of a mechanism: links by body, including the ground, symbols, and the size.

    Parameters
    ----------
    links : dict of str to DrawnLink
        Links by name of the body.
    symbols, drivers, forces : tuple of Symbol
        Joints, drivers and applied forces, in the order of the mechanism.
    size : float
        Diagonal of the bounding box of all points at the starting guess, m.
    """

    links: dict[str, DrawnLink]
    symbols: tuple[Symbol, ...]
    drivers: tuple[Symbol, ...]
    forces: tuple[Symbol, ...]
    size: float

    @cached_property
    def wheels(self) -> list[Wheel]:
        """Gears and wheels in the plane, in the order of their joints; a gear of several pairs occurs once."""
        wheels: list[Wheel] = []
        for symbol in self.symbols:
            radii = [radius for radius in symbol.radii if radius is not None]
            for body, center, radius in zip(symbol.bodies, symbol.points, symbol.radii, strict=True):
                if radius is None or len(center) > 2:  # spatial wheels are drawn about their axes
                    continue
                gap = SAME * self.size
                matches = (w for w in wheels if w.body == body and np.allclose(w.center, center, rtol=0, atol=gap))
                if not any(abs(wheel.radius - radius) <= gap for wheel in matches):
                    partner = sum(radii) - radius if symbol.kind == "gear" else None
                    wheels.append(Wheel(body, center, radius, symbol.internal and radius == max(radii), partner))
        return wheels


@dataclass
class _Points:
    """Collected points of a body, with the names of the elements at each."""

    positions: list[np.ndarray] = field(default_factory=list)
    names: list[list[str]] = field(default_factory=list)

    def add(self, point: Point, name: str, gap: float) -> None:
        for position, names in zip(self.positions, self.names, strict=True):
            if np.linalg.norm(position - point) <= gap:
                if name and name not in names:
                    names.append(name)
                return
        self.positions.append(point)
        self.names.append([name] if name else [])


def skeleton(mechanism: Mechanism) -> Skeleton:
    """Return the drawn geometry of a mechanism, with its parameters resolved.

    Parameters
    ----------
    mechanism : Mechanism
        A planar or spatial mechanism.

    Returns
    -------
    Skeleton
        The geometry, lengths in m, in the frames of the bodies.

    Raises
    ------
    MechanismError
        If the argument is not a mechanism, or a value in it is not valid.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.drawings.geometry import skeleton
    >>> seen = skeleton(jn.load("examples/four_bar.yaml"))
    >>> seen.links["crank"].names, seen.links["crank"].edges
    ((('A',), ('BC',)), ((0, 1),))
    >>> [symbol.kind for symbol in seen.symbols]
    ['revolute', 'revolute', 'rod']
    """
    check_mechanism(mechanism)
    components = POSITION_COMPONENTS[mechanism.space]
    parameters = mechanism.parameter_values
    kinds = {
        kind: {name: _values(element, parameters, components, f"{kind}.{name}") for name, element in elements.items()}
        for kind, elements in mechanism.elements.items()
    }
    touches = [touch for kind, values in kinds.items() for touch in _element_points(mechanism.elements[kind], values)]
    start = guessed(mechanism)
    all_points = [points_at(start[body], local)[0] for _, body, local in touches]
    curves = {name: curve_lines(mechanism, name) for name, joint in mechanism.joints.items() if joint.hidden}
    for name, curve in curves.items():
        lines = curve.lines if curve.whole else ()
        all_points += [point for x in lines for point in points_at(start[mechanism.joints[name].bodies[0]], x)[0]]
    size = float(np.linalg.norm(np.ptp(all_points or [[0.0]], axis=0)))
    if not size:
        size = 2 * _largest([local for _, _, local in touches], mechanism, kinds) or 1.0
    bodies = {body: _Points() for body in start}
    for name, body, local in touches:
        bodies[body].add(local, name, SAME * size)
    holding = {*mechanism.joints, *mechanism.drivers, *mechanism.forces}
    links = {}
    for body, points in bodies.items():
        _complete(body, points, mechanism, components, SAME * size)
        positions = np.array(points.positions)
        is_held = [bool(holding.intersection(names)) for names in points.names]  # other points are outputs only
        bars = () if body == GROUND else _bars(positions, SAME * size, is_held)
        links[body] = DrawnLink(body, positions, tuple(map(tuple, points.names)), bars)
    joints, drivers, forces = (
        tuple(
            _symbol(mechanism, name, element, kinds[kind][name], components, curves.get(name))
            for name, element in mechanism.elements[kind].items()
        )
        for kind in ("joints", "drivers", "forces")
    )
    return Skeleton(links, joints, drivers, forces, size)


def _values(element: Any, parameters: Mapping[str, Any], components: int, name: str) -> dict[str, np.ndarray]:
    """Return the numbers and vectors of an element by field, without laws and words."""
    values, signs = {}, facts_of(type(element)).signs
    for field_name, kind in field_kinds(type(element)).items():
        value = getattr(element, field_name)
        if kind in ("scalar", "vector") and value is not None:
            try:
                value = resolve(value, parameters)
                check_value(kind, value, components, signs[field_name])
            except JounceError as error:
                raise error.located(name=f"{name}.{field_name}") from None
            values[field_name] = np.asarray(value, float)
        if kind == "points":
            values[field_name] = np.asarray(resolve(value, parameters), float)
    return values


def _slot(field_name: str) -> int:
    return SLOTS.get(field_name[-2:], 0)


def _element_points(elements: Mapping[str, Any], values: Mapping[str, Values]) -> Iterator[tuple[str, str, Point]]:
    """Yield the element, the body and the position in its frame of all points of elements."""
    for name, element in elements.items():
        for field_name, value in values[name].items():
            if value.ndim == 2:
                yield from ((name, body, point) for body, point in zip(element.bodies, value, strict=True))
            elif field_name.startswith("point") and _slot(field_name) < len(element.bodies):
                yield name, element.bodies[_slot(field_name)], value


def _complete(body: str, points: _Points, mechanism: Mechanism, components: int, gap: float) -> None:
    """Add the center of mass, or the origin, to a body with too few points to be visible."""
    if body != GROUND and len(points.positions) < 2:
        center = mechanism.bodies[body].center_of_mass
        if center is not None:
            points.add(np.asarray(resolve(center, mechanism.parameter_values), float), "", gap)
    if not points.positions:
        points.add(np.zeros(components), "", gap)


def _largest(points: list[Point], mechanism: Mechanism, kinds: Mapping[str, Mapping[str, Values]]) -> float:
    """Return the largest known length of a mechanism whose points all coincide."""
    lengths = [float(np.linalg.norm(point)) for point in points]
    for kind, values in kinds.items():
        for name, values_of_kind in values.items():
            dimensions = facts_of(type(mechanism.elements[kind][name])).dimensions
            lengths += [
                abs(float(x)) for field, x in values_of_kind.items() if x.ndim == 0 and dimensions[field] == "length"
            ]
    return max(lengths, default=0.0)


def _bars(points: Points, gap: float, is_held: list[bool]) -> tuple[tuple[int, int], ...]:
    """Return the bars of a link: one between two points, the outline of points in a plane, or else a tree."""
    count = len(points)
    if count < 2:
        return ()
    if count == 2:
        return ((0, 1),)
    centered = points - points.mean(axis=0)
    _, sizes, directions = np.linalg.svd(centered, full_matrices=False)
    if sizes[1] <= gap:  # all on one line
        order = np.argsort(centered @ directions[0]).tolist()
        return tuple(pairwise(order))
    if points.shape[1] == 2 or sizes[2] <= gap:  # a plate
        from scipy.spatial import ConvexHull

        hull = ConvexHull(centered @ directions[:2].T).vertices.tolist()
        return tuple(pairwise([*hull, hull[0]]))
    corners = np.flatnonzero(is_held)
    if 3 <= len(corners) < count:
        inner = _bars(points[corners], gap, [True] * len(corners))
        if len(inner) >= 3 and inner[-1][1] == inner[0][0]:  # a plate, with bars to points of outputs
            ring = tuple((int(corners[i]), int(corners[j])) for i, j in inner)
            free_points = (k for k in range(count) if not is_held[k])
            distance = np.linalg.norm(points[:, None] - points[None, corners], axis=-1)
            return (*ring, *((k, int(corners[np.argmin(distance[k])])) for k in free_points))
    from scipy.sparse.csgraph import minimum_spanning_tree

    tree = minimum_spanning_tree(np.linalg.norm(points[:, None] - points[None], axis=-1)).tocoo()
    return tuple(sorted((min(i, j), max(i, j)) for i, j in zip(tree.row.tolist(), tree.col.tolist(), strict=True)))


def _symbol(
    mechanism: Mechanism, name: str, element: Element, values: Values, components: int, curve: CurveLines | None
) -> Symbol:
    bodies, facts = element.bodies, facts_of(type(element))
    points: list[np.ndarray] = [np.zeros(components)] * len(bodies)
    axes: list[np.ndarray | None] = [None] * len(bodies)
    radii: list[float | None] = [None] * len(bodies)
    for field_name, value in values.items():
        slot = _slot(field_name)
        if value.ndim == 2:
            points = list(value)
        elif slot < len(bodies) and field_name.startswith("point"):
            points[slot] = value
        if slot < len(bodies) and facts.dimensions[field_name] == "direction" and axes[slot] is None:
            axes[slot] = value
    if facts.symbol in ("rolling", "wheel"):
        radii[1] = float(values["radius"])
    coordinate = element.coordinate if facts.symbol == "coordinate" else "angle"
    if coordinate != "angle":
        axes[0] = np.array([1.0, 0.0]) if coordinate == "x" else np.array([0.0, 1.0])
    if disc := cam_disc(mechanism, element):
        return Symbol(name, "cam", *disc, (None, None), (None, None))
    symbol = Symbol(name, facts.symbol, bodies, tuple(points), tuple(axes), tuple(radii))
    if curve is not None:
        symbol = replace(symbol, curve=curve)
    if facts.symbol == "gear" and components == 3:
        centers, wheels = shaft_wheels(mechanism, element)
        return replace(symbol, points=(*centers, *symbol.points[2:]), radii=(*wheels, *symbol.radii[2:]))
    if "radius_j" in values:
        signed = [float(values[name]) for name in ("radius_i", "radius_j")]
        crossed = getattr(element, "crossed", False)
        return replace(symbol, radii=tuple(map(abs, signed)), internal=min(signed) < 0, crossed=crossed)
    if element.role == "joint" and facts.symbol in ("gear", "coordinate"):
        return _geared(mechanism, symbol, coordinate, float(values.get("ratio", 1.0)))
    return symbol


def _geared(mechanism: Mechanism, symbol: Symbol, coordinate: str, ratio: float) -> Symbol:
    """Return the symbol of a joint of coordinates, as two gears or as a wheel on a rack if it is one."""
    if ratio == 0 or symbol.bodies[0] == GROUND:
        return symbol
    if coordinate != "angle":
        centers, _ = pitch_radii(mechanism, symbol.bodies, -1.0)
        side = np.array([0.0, -ratio]) if coordinate == "x" else np.array([ratio, 0.0])
        points, axes = (centers[0], symbol.points[1]), (side, symbol.axes[0])
        return replace(symbol, kind="rack", points=points, axes=axes, radii=(abs(ratio), None))
    centers, radii = pitch_radii(mechanism, symbol.bodies, ratio)
    if radii is None:
        return symbol
    points, radii = (*centers, *symbol.points[2:]), (*radii, *symbol.radii[2:])
    return replace(symbol, kind="gear", points=points, radii=radii, internal=ratio > 0)
