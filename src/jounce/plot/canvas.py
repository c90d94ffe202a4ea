"""Where symbols are drawn: bodies at many instants, seen from one side, and the flat shapes that come of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.plot.geometry import Skeleton
from jounce.plot.style import BODY_COLOURS

__all__ = ["Canvas", "Label", "Shape", "screen_of", "tinted"]

AZIMUTH, ELEVATION = -60.0, 25.0  # degrees, of the viewer of a spatial mechanism
UNIT = 0.021  # half a pin, in diagonals of what is drawn
INK = "#222222"
BARS, PLATES, GUIDES, WHEELS, SYMBOLS, MARKS = 4, 3, 2, 1, 6, 7  # layers


@dataclass(frozen=True)
class Shape:
    """A line, an area or a disc that moves.

    Parameters
    ----------
    kind : str
        ``line``, ``area`` (closed) or ``disc`` (one point and a radius).
    points : numpy.ndarray of shape (time, n, 2)
        In the plane of the drawing, m.
    stroke, fill : str
        Colours; empty where there is none.
    width : float
        Of the line, in points of print.
    dashes : tuple of float
        Lengths of strokes and gaps, in widths; a full line when empty.
    layer : int
        Higher ones hide lower ones.
    radius : float
        Of a disc, m.
    owner : str
        The body or element that it shows, with its kind: ``bodies.crank``.
    """

    kind: str
    points: np.ndarray
    stroke: str = INK
    fill: str = ""
    width: float = 1.0
    dashes: tuple[float, ...] = ()
    layer: int = SYMBOLS
    radius: float = 0.0
    owner: str = ""


@dataclass(frozen=True)
class Label:
    """A name and the place it belongs to, (time, 2) m."""

    text: str
    anchor: np.ndarray
    colour: str
    owner: str


def screen_of(view: tuple[float, float]) -> np.ndarray:
    """Return unit vectors to the right, upward and toward a viewer, in rows, from azimuth and elevation in degrees.

    Examples
    --------
    >>> screen_of((-90.0, 0.0)).round(12).tolist()  # from the front: x to the right, z upward
    [[1.0, 0.0, 0.0], [-0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
    """
    azimuth, elevation = np.radians(view)
    sa, ca, se, ce = np.sin(azimuth), np.cos(azimuth), np.sin(elevation), np.cos(elevation)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


@dataclass
class Canvas:
    """Where symbols are drawn: bodies at many instants, seen from one side.

    Parameters
    ----------
    skeleton : Skeleton
        What the mechanism looks like.
    frames : dict of str to numpy.ndarray
        Of each body, (time, components, 1 + components).
    view : tuple of float
        Azimuth and elevation of the viewer, degrees; of no account in the plane.
    """

    skeleton: Skeleton
    frames: dict[str, np.ndarray]
    view: tuple[float, float] = (AZIMUTH, ELEVATION)
    shapes: list[Shape] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)
    supports: list[np.ndarray] = field(default_factory=list)

    @cached_property
    def planar(self) -> bool:
        """Whether the mechanism is planar."""
        return self.frames[GROUND].shape[1] == 2

    @cached_property
    def screen(self) -> np.ndarray:
        """Unit vectors to the right, upward and toward the viewer, in rows."""
        return screen_of(self.view)

    @cached_property
    def colours(self) -> dict[str, str]:
        """Colour of each moving body."""
        moving = [body for body in self.skeleton.links if body != GROUND]
        return {body: BODY_COLOURS[k % len(BODY_COLOURS)] for k, body in enumerate(moving)}

    @cached_property
    def unit(self) -> float:
        """Half a pin, m: a share of what all links ever cover, but no more than fits the links."""
        places = [self.flat(self.at(link.body, link.points)).reshape(-1, 2) for link in self.skeleton.links.values()]
        for symbol in self.skeleton.symbols:
            for body, point, radius in zip(symbol.bodies, symbol.points, symbol.radii, strict=True):
                if radius is not None:
                    center = self.flat(self.at(body, point))
                    places += [center - radius, center + radius]
        everywhere = np.concatenate(places)
        everywhere = everywhere[np.isfinite(everywhere).all(axis=1)]
        extent = np.linalg.norm(np.ptp(everywhere, axis=0)) if len(everywhere) else 0.0
        return UNIT * float(extent or self.skeleton.size)

    def at(self, body: str, points: Any) -> np.ndarray:
        """Return points of a body in the global frame, (time, ..., components)."""
        frame, local = self.frames[body], np.asarray(points, float)
        turned = np.einsum("tck,...k->t...c", frame[:, :, 1:], local)
        return turned + frame[:, :, 0].reshape(len(frame), *[1] * (local.ndim - 1), -1)

    def toward(self, body: str, vector: Any) -> np.ndarray:
        """Return a unit vector along a vector of a body, in the global frame, (time, components)."""
        turned = np.einsum("tck,k->tc", self.frames[body][:, :, 1:], np.asarray(vector, float))
        return turned / np.linalg.norm(turned, axis=-1, keepdims=True)

    def within(self, body: str, places: np.ndarray) -> np.ndarray:
        """Return global places, (time, components), in the frame of a body."""
        frame = self.frames[body]
        return np.einsum("tkc,tk->tc", frame[:, :, 1:], places - frame[:, :, 0])

    def flat(self, places: np.ndarray) -> np.ndarray:
        """Return places or vectors as they are seen, (..., 2)."""
        return places if self.planar else places @ self.screen[:2].T

    def depth(self, vectors: np.ndarray) -> np.ndarray:
        """Return how far vectors point toward the viewer, (...)."""
        return vectors @ self.screen[2]

    def frame_of(self, body: str, axis: Any) -> np.ndarray:
        """Return three global unit vectors, (time, 3, 3) in rows, of which the first is along an axis of a body."""
        first = np.asarray(axis, float) / np.linalg.norm(axis)
        second = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
        second /= np.linalg.norm(second)
        return np.stack([self.toward(body, v) for v in (first, second, np.cross(first, second))], axis=1)

    def line(self, *points: np.ndarray, **look: Any) -> None:
        """Draw a line through points, each (time, 2) or constant, (2,)."""
        self._add("line", self._joined(points), look)

    def area(self, *points: np.ndarray, **look: Any) -> None:
        """Draw a closed outline."""
        self._add("area", self._joined(points), look)

    def curve(self, points: np.ndarray, *, closed: bool = False, **look: Any) -> None:
        """Draw a line through points, (time, n, 2)."""
        self._add("area" if closed else "line", points, look)

    def disc(self, center: np.ndarray, radius: float, **look: Any) -> None:
        """Draw a disc around a place, (time, 2)."""
        self._add("disc", center[:, None], {"radius": float(radius), **look})

    def name(self, text: str, anchor: np.ndarray, colour: str, owner: str) -> None:
        """Write a name near a place."""
        self.labels.append(Label(text, anchor, colour, owner))

    def move_name(self, owner: str, anchor: np.ndarray) -> None:
        """Write a name near another place."""
        self.labels = [replace(label, anchor=anchor) if label.owner == owner else label for label in self.labels]

    def _joined(self, points: Sequence[np.ndarray]) -> np.ndarray:
        count = len(self.frames[GROUND])
        return np.stack([np.broadcast_to(point, (count, 2)) for point in points], axis=1)

    def _add(self, kind: str, points: np.ndarray, look: dict[str, Any]) -> None:
        self.shapes.append(Shape(kind, points, **look))


def tinted(colour: str, share: float = 0.2) -> str:
    """Return a colour mixed with white.

    Examples
    --------
    >>> tinted("#0072B2"), tinted("#000000", 0.5)
    ('#cce3f0', '#808080')
    """
    parts = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return "#" + "".join(f"{round(255 - share * (255 - part)):02x}" for part in parts)
