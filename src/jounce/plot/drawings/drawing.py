"""A drawing of a mechanism: moving plane shapes of bodies at many instants, in one projection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.mechanism.mechanism import GROUND
from jounce.plot.drawings.frames import Frame, frame_along, points_at, within
from jounce.plot.drawings.geometry import Point, Skeleton, Symbol
from jounce.plot.style import BODY_COLORS

Flat = Float[np.ndarray, "time 2"]
"""A moving point or vector in the plane of the drawing."""
Curve = Float[np.ndarray, "time points 2"]
View = tuple[float, float]
"""Azimuth and elevation of the viewer of a spatial mechanism, degrees."""
VIEW: View = (-60.0, 25.0)
UNIT = 0.021  # half the size of a pin, relative to the diagonal of the drawing
INK = "#222222"
BARS, PLATES, GUIDES, WHEELS, SYMBOLS, MARKS = 4, 3, 2, 1, 6, 7  # layers


@dataclass(frozen=True)
class Shape:
    """A moving line, area or disc.

    Parameters
    ----------
    kind : str
        ``line``, ``area`` (closed) or ``disc`` (one point and a radius).
    points : numpy.ndarray of shape (time, points, 2)
        Points in the plane of the drawing, m.
    stroke, fill : str
        Colors; empty for none.
    width : float
        Width of the line, in typographic points.
    dashes : tuple of float
        Lengths of dashes and gaps, in widths; empty for a solid line.
    layer : int
        Layer; higher layers hide lower ones.
    radius : float
        Radius of a disc, m.
    owner : str
        The body or element shown, with its kind: ``bodies.crank``.
    """

    kind: str
    points: Curve
    stroke: str = INK
    fill: str = ""
    width: float = 1.0
    dashes: tuple[float, ...] = ()
    layer: int = SYMBOLS
    radius: float = 0.0
    owner: str = ""


@dataclass(frozen=True)
class Label:
    """A name and its anchor, (time, 2), m."""

    text: str
    anchor: Flat
    color: str
    owner: str


def screen_of(view: View) -> Float[np.ndarray, "3 3"]:
    """Return the unit vectors to the right, upward and toward the viewer, in rows, for azimuth and elevation, degrees.

    Examples
    --------
    >>> screen_of((-90.0, 0.0)).round(12).tolist()  # from the front: x to the right, z upward
    [[1.0, 0.0, 0.0], [-0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
    """
    azimuth, elevation = np.radians(view)
    sa, ca, se, ce = np.sin(azimuth), np.cos(azimuth), np.sin(elevation), np.cos(elevation)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


@dataclass
class Drawing:
    """Bodies at many instants in one projection, with their drawn shapes and names.

    Parameters
    ----------
    skeleton : Skeleton
        Drawn geometry of the mechanism.
    frames : dict of str to numpy.ndarray
        Frames of each body, (time, components, 1 + components).
    view : tuple of float
        Azimuth and elevation of the viewer, degrees; ignored for planar mechanisms.

    Attributes
    ----------
    shapes, labels : list
        Drawn shapes and names.
    supports : list of numpy.ndarray
        Positions of drawn supports.
    owner : str
        Default owner of shapes.
    """

    skeleton: Skeleton
    frames: dict[str, Frame]
    view: View = VIEW
    shapes: list[Shape] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)
    supports: list[Flat] = field(default_factory=list)
    owner: str = ""

    @cached_property
    def planar(self) -> bool:
        """Whether the mechanism is planar."""
        return self.frames[GROUND].shape[1] == 2

    @cached_property
    def screen(self) -> np.ndarray:
        """Unit vectors to the right, upward and toward the viewer, in rows."""
        return screen_of(self.view)

    @cached_property
    def colors(self) -> dict[str, str]:
        """Color of each moving body."""
        bodies = [body for body in self.skeleton.links if body != GROUND]
        return {body: BODY_COLORS[k % len(BODY_COLORS)] for k, body in enumerate(bodies)}

    @cached_property
    def unit(self) -> float:
        """Half the size of a pin, m: a fraction of the extent of all links, limited by the size of the links."""
        points = [self.flat(self.at(link.body, link.points)).reshape(-1, 2) for link in self.skeleton.links.values()]
        for wheel in self.skeleton.wheels:
            center = self.flat(self.at(wheel.body, wheel.center))
            points += [center - wheel.radius, center + wheel.radius]
        all_points = np.concatenate(points)
        all_points = all_points[np.isfinite(all_points).all(axis=1)]
        extent = np.linalg.norm(np.ptp(all_points, axis=0)) if len(all_points) else 0.0
        return UNIT * float(extent or self.skeleton.size)

    def at(
        self, body: str, points: Float[np.ndarray, "*points components"]
    ) -> Float[np.ndarray, "time *points components"]:
        """Return points of a body, (..., components), in the global frame."""
        return points_at(self.frames[body], points)

    def toward(self, body: str, vector: Point) -> Float[np.ndarray, "time components"]:
        """Return the unit vector along a vector of a body, in the global frame."""
        rotated = self.at(body, vector) - self.frames[body][:, :, 0]
        return rotated / np.linalg.norm(rotated, axis=-1, keepdims=True)

    def within(self, body: str, points: Float[np.ndarray, "time components"]) -> Float[np.ndarray, "time components"]:
        """Return global points in the frame of a body."""
        return within(self.frames[body], points)

    def flat(self, points: np.ndarray) -> np.ndarray:
        """Return the projections of points or vectors, (..., components), (..., 2)."""
        return points if self.planar else points @ self.screen[:2].T

    def depth(self, vectors: np.ndarray) -> np.ndarray:
        """Return the components of vectors, (..., 3), toward the viewer, (...)."""
        return vectors @ self.screen[2]

    def frame_along(self, body: str, axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "time 3 3"]:
        """Return three global unit vectors, in rows, the first one along an axis of a body."""
        return np.stack([self.toward(body, unit) for unit in frame_along(axis)], axis=1)

    def global_point(self, symbol: Symbol, slot: int | None = None) -> Float[np.ndarray, "time components"]:
        """Return the point of a symbol on one of its bodies, by default a moving one, in the global frame."""
        slot = symbol.moving_slot if slot is None else slot
        return self.at(symbol.bodies[slot], symbol.points[slot])

    def point(self, symbol: Symbol, slot: int | None = None) -> Flat:
        """Return the projection of the point of a symbol on one of its bodies."""
        return self.flat(self.global_point(symbol, slot))

    def ends(self, symbol: Symbol) -> tuple[Flat, Flat]:
        """Return the projections of the points of a symbol on its first two bodies."""
        return self.point(symbol, 0), self.point(symbol, 1)

    def line(self, *points: np.ndarray, **style: Any) -> None:
        """Draw a line through points, each (time, 2) or constant, (2,)."""
        self._add("line", self._joined(points), style)

    def area(self, *points: np.ndarray, **style: Any) -> None:
        """Draw a closed outline."""
        self._add("area", self._joined(points), style)

    def curve(self, points: Curve, *, closed: bool = False, **style: Any) -> None:
        """Draw a line through points."""
        self._add("area" if closed else "line", points, style)

    def disc(self, center: Flat, radius: float, **style: Any) -> None:
        """Draw a disc around a point."""
        self._add("disc", center[:, None], {"radius": float(radius), **style})

    def name(self, text: str, anchor: Flat, color: str) -> None:
        """Write a name near an anchor."""
        self.labels.append(Label(text, anchor, color, self.owner))

    def move_name(self, owner: str, anchor: Flat) -> None:
        """Move a name to another anchor."""
        self.labels = [replace(label, anchor=anchor) if label.owner == owner else label for label in self.labels]

    def _joined(self, points: Sequence[np.ndarray]) -> Curve:
        count = len(self.frames[GROUND])
        return np.stack([np.broadcast_to(point, (count, 2)) for point in points], axis=1)

    def _add(self, kind: str, points: Curve, style: dict[str, Any]) -> None:
        self.shapes.append(Shape(kind, points, **{"owner": self.owner, **style}))


def tinted(color: str, share: float = 0.2) -> str:
    """Return a color mixed with white.

    Examples
    --------
    >>> tinted("#0072B2"), tinted("#000000", 0.5)
    ('#cce3f0', '#808080')
    """
    parts = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    return "#" + "".join(f"{round(255 - share * (255 - part)):02x}" for part in parts)
