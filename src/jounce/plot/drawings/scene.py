"""A mechanism as plane shapes at many instants, for sketches, animations and reports.

Every shape has the same number of points at each instant, so that a drawing is created once and then moved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from jounce.kinematics import Motion
from jounce.mechanism import Mechanism
from jounce.mechanism.mechanism import GROUND
from jounce.plot.drawings.drawing import BARS, PLATES, VIEW, WHEELS, Drawing, Label, Shape, View, tinted
from jounce.plot.drawings.frames import assembled, frames
from jounce.plot.drawings.geometry import DrawnLink, skeleton
from jounce.plot.drawings.joint_symbols import draw_symbols

Instants = Int[np.ndarray, " time"]


@dataclass(frozen=True)
class Scene:
    """All shapes of a mechanism.

    Parameters
    ----------
    shapes : list of Shape
        Shapes in drawing order.
    labels : list of Label
        Names of bodies and joints.
    unit : float
        Half the size of a pin, m.
    """

    shapes: list[Shape]
    labels: list[Label]
    unit: float

    @classmethod
    def of(cls, drawing: Drawing) -> Scene:
        """Return the scene of a drawing, lower layers first."""
        return cls(sorted(drawing.shapes, key=lambda shape: shape.layer), drawing.labels, drawing.unit)

    @cached_property
    def limits(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper end of the shapes over all instants, m."""
        low, high = [], []
        for shape in self.shapes:
            flat = shape.points.reshape(-1, 2)
            flat = flat[np.isfinite(flat).all(axis=1)]
            if len(flat):
                low.append(flat.min(axis=0) - shape.radius)
                high.append(flat.max(axis=0) + shape.radius)
        if not low:
            return -1.0, 1.0, -1.0, 1.0
        (left, lower), (right, upper) = np.min(low, axis=0).tolist(), np.max(high, axis=0).tolist()
        return left, right, lower, upper

    def only(self, instant: int) -> Scene:
        """Return the scene at one instant, by index."""
        shapes = [replace(s, points=s.points[[min(instant, len(s.points) - 1)]]) for s in self.shapes]
        labels = [replace(label, anchor=label.anchor[[instant]]) for label in self.labels]
        return Scene(shapes, labels, self.unit)


def scene_of(moving: Motion | Mechanism, *, view: View = VIEW, instants: Instants | None = None) -> Scene:
    """Return the scene of a mechanism; the arguments are those of `drawing_of`.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot.drawings.scene import scene_of
    >>> scene = scene_of(jn.load("examples/four_bar.yaml"))
    >>> [label.text for label in scene.labels]
    ['crank', 'rocker', 'A', 'D', 'BC', 'C']
    """
    return Scene.of(drawing_of(moving, view=view, instants=instants))


def drawing_of(moving: Motion | Mechanism, *, view: View = VIEW, instants: Instants | None = None) -> Drawing:
    """Return the drawing of a mechanism, at the instants of a motion or as assembled at the start.

    Parameters
    ----------
    moving : Motion or Mechanism
        The motion or mechanism to draw.
    view : tuple of float, optional
        Azimuth and elevation of the viewer of a spatial mechanism, degrees.
    instants : array_like of int, optional
        Indices of instants of the motion; all by default.
    """
    mechanism = moving if isinstance(moving, Mechanism) else moving.mechanism
    frames_of_bodies = assembled(moving) if isinstance(moving, Mechanism) else frames(moving)
    if instants is not None:
        frames_of_bodies = {body: frame[instants] for body, frame in frames_of_bodies.items()}
    drawing = Drawing(skeleton(mechanism), frames_of_bodies, view)
    for link in drawing.skeleton.links.values():
        if link.body != GROUND:
            _draw_link(drawing, link)
    draw_symbols(drawing, mechanism)
    return drawing


def _draw_link(drawing: Drawing, link: DrawnLink) -> None:
    """Draw the bars or the plate of a body, and write its name."""
    color, drawing.owner = drawing.colors[link.body], f"bodies.{link.body}"
    points = drawing.flat(drawing.at(link.body, link.points))  # time, n, 2
    ring = _ring(link)
    if ring:
        fill = tinted(color)
        if any(wheel.body != link.body for wheel in drawing.skeleton.wheels):  # a carrier hides no gear
            drawing.curve(points[:, ring], closed=True, stroke="", fill=fill, layer=WHEELS - 1)
            fill = ""
        drawing.curve(points[:, ring], closed=True, stroke=color, fill=fill, width=2.0, layer=PLATES)
    for edge in link.edges[len(ring) :]:
        drawing.curve(points[:, [*edge]], stroke=color, width=2.0 if ring else 4.0, layer=BARS)
    longest = max(link.edges, key=lambda edge: np.linalg.norm(np.diff(link.points[[*edge]], axis=0)), default=(0,))
    drawing.name(link.body, points[:, ring or [*longest]].mean(axis=1), color)


def _ring(link: DrawnLink) -> list[int]:
    """Return the corners of the plate of a link, whose outline is the first of its bars; none without a plate."""
    corners: list[int] = []
    for first, second in link.edges:
        corners.append(first)
        if second == corners[0]:
            return corners if len(corners) > 2 else []
    return []


def outline(shape: Shape, instant: int) -> Float[np.ndarray, "points 2"]:
    """Return the outline of a shape at an instant, m."""
    points = shape.points[min(instant, len(shape.points) - 1)]
    if shape.kind == "disc":
        angle = np.linspace(0.0, 2 * np.pi, 13)
        return points + shape.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return points if shape.kind == "line" else np.concatenate([points, points[:1]])
