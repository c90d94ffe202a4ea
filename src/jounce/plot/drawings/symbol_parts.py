"""Parts of symbols: supports, pins, balls, rails, springs, cylinders, boxes, arrows of rotation."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.mechanism.mechanism import GROUND
from jounce.plot.drawings.drawing import GUIDES, INK, MARKS, SYMBOLS, Drawing, Flat
from jounce.plot.drawings.geometry import Point, Symbol

Axes = Float[np.ndarray, "time 3 3"]
DOWN = np.array([0.0, -1.0])
PAPER = "#FFFFFF"
DASHES = (4.0, 2.0)
CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))  # of a square
DASH_DOT = (7.0, 2.0, 1.5, 2.0)
LARGE = 3.0  # units: larger circles need more points than a pin to look round


def unit_vector(vectors: Flat) -> Flat:
    """Return plane vectors of unit length; vectors toward the viewer are drawn to the right."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    is_short = length < 1e-9
    return np.where(is_short, np.array([1.0, 0.0]), vectors / np.where(is_short, 1.0, length))


def normal_of(vectors: Flat) -> Flat:
    """Return plane vectors rotated by 90 degrees."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def _hatching(drawing: Drawing, start: Flat, stop: Flat, side: np.ndarray, count: int) -> None:
    """Draw the ground as a line with hatching on one side."""
    u = drawing.unit
    drawing.line(start, stop, width=1.3, layer=GUIDES)
    direction = unit_vector(stop - start)
    for k in range(count):
        foot = start + (stop - start) * ((k + 0.7) / count)
        drawing.line(foot, foot + side * 0.75 * u - direction * 0.55 * u, width=0.8, layer=GUIDES)


def draw_ground_support(drawing: Drawing, symbol: Symbol) -> None:
    """Draw the support of a joint to the ground, once for several joints at the same point."""
    if GROUND not in symbol.bodies[:2]:
        return
    u, point = drawing.unit, drawing.point(symbol, symbol.bodies.index(GROUND))
    if any(np.allclose(support, point, rtol=0, atol=0.1 * u, equal_nan=True) for support in drawing.supports):
        return
    drawing.supports.append(point)
    left, right = (point + np.array([sign * 1.1, -2.0]) * u for sign in (-1, 1))
    drawing.area(point, left, right, fill=PAPER, width=1.1, layer=GUIDES)
    half_width = np.array([0.7 * u, 0.0])
    _hatching(drawing, left - half_width, right + half_width, DOWN, 6)


def pin(drawing: Drawing, point: Flat) -> None:
    """Draw a pin."""
    drawing.disc(point, 0.8 * drawing.unit, fill=PAPER, width=1.3, layer=SYMBOLS)


def ball(drawing: Drawing, point: Flat) -> None:
    """Draw the ball of a spherical joint."""
    u = drawing.unit
    drawing.disc(point, 0.85 * u, fill="#BBBBBB", width=1.2, layer=SYMBOLS)
    drawing.disc(point + np.array([-0.25, 0.25]) * u, 0.22 * u, stroke="", fill=PAPER, layer=SYMBOLS)


def rail(
    drawing: Drawing,
    body: str,
    points: Float[np.ndarray, "time components"],
    axis: Point,
    *,
    beyond: float = 2.6,
    start: Point | None = None,
) -> None:
    """Draw the line of a body along which global points move, hatched if the body is the ground.

    The line extends beyond the points by `beyond`, in units. The line of a moving body starts at its joint.
    """
    u = drawing.unit
    local = drawing.within(body, points)
    along = axis / np.linalg.norm(axis)
    travel = local @ along
    foot = local - travel[:, None] * along
    if not np.isfinite(travel).any():
        return
    low, high = float(np.nanmin(travel)) - beyond * u, float(np.nanmax(travel)) + beyond * u
    if start is not None and body != GROUND:
        low, high = min(low, float(start @ along)), max(high, float(start @ along))
    middle = np.nanmean(foot, axis=0)
    first, last = (drawing.flat(drawing.at(body, middle + end * along)) for end in (low, high))
    if body != GROUND:
        drawing.line(first, last, stroke=drawing.colors[body], width=2.2, layer=GUIDES)
        return
    direction = unit_vector(last - first)
    side = normal_of(direction)
    side = np.where(side[:, 1:] > 1e-9, -side, side)  # hatching below the line, or to the left of a vertical one
    side = np.where((np.abs(side[:, 1:]) <= 1e-9) & (side[:, :1] > 0), -side, side)
    if drawing.planar:
        shift, count = 0.9 * u * side, int(np.clip((high - low) / (0.8 * u), 4, 40))
        _hatching(drawing, first + shift, last + shift, side, count)
        return
    drawing.line(first, last, width=1.0, layer=GUIDES)
    for end in (first, last):
        _hatching(drawing, end - side * 0.9 * u, end + side * 0.9 * u, direction * 0.5, 3)


def spring(drawing: Drawing, first: Flat, second: Flat, *, turns: int = 6) -> None:
    """Draw a zigzag spring between two points."""
    u = drawing.unit
    fractions = np.concatenate([[0.0], np.linspace(0.14, 0.86, 2 * turns + 1), [1.0]])
    offset = np.zeros(len(fractions))
    offset[2:-2] = 0.8 * np.where(np.arange(len(fractions) - 4) % 2 == 0, 1.0, -1.0)
    side = normal_of(unit_vector(second - first))
    points = first[:, None] + fractions[:, None] * (second - first)[:, None] + (offset * u)[:, None] * side[:, None]
    drawing.curve(points, width=1.1, layer=SYMBOLS)


def actuator(drawing: Drawing, first: Flat, second: Flat) -> None:
    """Draw a cylinder at the first point, with its rod to the second."""
    u = drawing.unit
    distance = np.linalg.norm(second - first, axis=-1)
    finite = distance[np.isfinite(distance)]
    length = 0.62 * float(finite.min()) if finite.size else 0.0
    direction = unit_vector(second - first)
    side = normal_of(direction) * 0.55 * u
    head = first + direction * np.minimum(length, distance)[:, None]
    drawing.line(first, second, width=1.5, layer=SYMBOLS)
    drawing.area(first - side, first + side, head + side, head - side, fill="#DDDDDD", width=1.0, layer=SYMBOLS)


def turn(drawing: Drawing, center: Flat, plane: Float[np.ndarray, "time 2 2"], *, spiral: bool = False) -> None:
    """Draw an arrow of rotation about a point, or a spiral spring.

    Parameters
    ----------
    drawing : Drawing
        The drawing.
    center : numpy.ndarray of shape (time, 2)
        Projected center.
    plane : numpy.ndarray of shape (time, 2, 2)
        Projections of two unit vectors perpendicular to the axis, in rows.
    spiral : bool, default False
        Whether to draw a spring.
    """
    u = drawing.unit
    angle = np.linspace(0.0, 5.0 * np.pi, 61) if spiral else np.radians(np.linspace(-50.0, 195.0, 25))
    radius = np.linspace(0.9, 2.3, len(angle)) if spiral else np.full(len(angle), 2.4)

    def point_at(fraction: Any, distance: Any) -> np.ndarray:
        circle = np.stack([distance * np.cos(fraction), distance * np.sin(fraction)], axis=-1) * u
        return center[:, None] + np.einsum("nk,tkc->tnc", circle, plane)

    drawing.curve(point_at(angle, radius), width=1.2, layer=MARKS)
    if not spiral:
        last = np.array([angle[-1], angle[-1], angle[-1] + 0.42])
        head = point_at(last, np.array([1.95, 2.85, 2.4]))
        drawing.curve(head, closed=True, fill=INK, width=0.5, layer=MARKS)


def cylinder(drawing: Drawing, center: Flat, axes: Axes, size: tuple[float, float], **style: Any) -> None:
    """Draw a cylinder around an axis in space.

    Parameters
    ----------
    drawing : Drawing
        The drawing.
    center : numpy.ndarray of shape (time, 2)
        Projected center.
    axes : numpy.ndarray of shape (time, 3, 3)
        Global unit vectors in rows, the first along the axis.
    size : tuple of float
        Half the length and the radius, in units.
    **look
        Style of the shapes.
    """
    half, radius = (value * drawing.unit for value in size)
    axis = half * drawing.flat(axes[:, 0])
    along, depth = unit_vector(axis), drawing.depth(axes[:, 0])
    across, squeeze = normal_of(along), np.abs(depth)[:, None, None]

    def around(angle: Float[np.ndarray, " points"]) -> np.ndarray:
        sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
        return radius * (sine * across[:, None] + squeeze * cosine * along[:, None])

    count = 10 if size[1] < LARGE else 40
    cap = around(np.linspace(-0.5 * np.pi, 0.5 * np.pi, count))
    outline = np.concatenate([(center + axis)[:, None] + cap, (center - axis)[:, None] - cap], axis=1)
    drawing.curve(outline, closed=True, **style)
    face = center + axis * np.where(depth >= 0, 1.0, -1.0)[:, None]
    drawing.curve(face[:, None] + around(np.linspace(0.0, 2 * np.pi, 2 * count + 1)[:-1]), closed=True, **style)


def box(drawing: Drawing, center: Flat, axes: Axes, size: tuple[float, float, float], **style: Any) -> None:
    """Draw the three sides of a box that face the viewer, in space.

    The arguments are those of `cylinder`; the size is half of the edges along the three axes, in units.
    """
    halves = drawing.flat(axes) * np.array(size)[:, None] * drawing.unit  # time, 3, 2
    facing = np.where(drawing.depth(axes) >= 0, 1.0, -1.0)  # time, 3
    for k in range(3):
        middle = center + facing[:, k, None] * halves[:, k]
        drawing.area(*(middle + a * halves[:, k - 2] + b * halves[:, k - 1] for a, b in CORNERS), **style)
