"""The pieces that symbols are made of: supports with hatching, rails, springs, cylinders, boxes, turning arrows."""

from __future__ import annotations

from typing import Any

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.plot.canvas import GUIDES, INK, MARKS, SYMBOLS, Canvas

__all__ = ["actuator", "box", "cylinder", "hatching", "rail", "spring", "support", "turn", "unit_vector"]

DOWN = np.array([0.0, -1.0])
PAPER = "#FFFFFF"
DASHES = (4.0, 2.0)
DASH_DOT = (7.0, 2.0, 1.5, 2.0)


def unit_vector(vectors: np.ndarray) -> np.ndarray:
    """Return flat vectors, (time, 2), of length one; those that point at the viewer are drawn to the right."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    small = length < 1e-9
    return np.where(small, np.array([1.0, 0.0]), vectors / np.where(small, 1.0, length))


def normal_of(vectors: np.ndarray) -> np.ndarray:
    """Return flat vectors, (..., 2), turned by 90 degrees."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def hatching(canvas: Canvas, start: np.ndarray, stop: np.ndarray, side: np.ndarray, count: int, owner: str) -> None:
    """Draw the line of the ground with short strokes on one side of it."""
    u = canvas.unit
    canvas.line(start, stop, width=1.3, layer=GUIDES, owner=owner)
    along = unit_vector(stop - start)
    for k in range(count):
        foot = start + (stop - start) * ((k + 0.7) / count)
        canvas.line(foot, foot + side * 0.75 * u - along * 0.55 * u, width=0.8, layer=GUIDES, owner=owner)


def support(canvas: Canvas, place: np.ndarray, owner: str) -> None:
    """Draw the stand of a joint on the ground, once where several joints share it."""
    u = canvas.unit
    for known in canvas.supports:
        if np.allclose(known, place, rtol=0, atol=0.1 * u, equal_nan=True):
            return
    canvas.supports.append(place)
    left, right = (place + np.array([sign * 1.1, -2.0]) * u for sign in (-1, 1))
    canvas.area(place, left, right, fill=PAPER, width=1.1, layer=GUIDES, owner=owner)
    wide = np.array([0.7 * u, 0.0])
    hatching(canvas, left - wide, right + wide, DOWN, 6, owner)


def rail(
    canvas: Canvas, body: str, places: np.ndarray, axis: Any, owner: str, *, beyond: float = 2.6, start: Any = None
) -> None:
    """Draw the line of a body along which global places, (time, components), move, hatched where it is the ground.

    The places stand on the line, at least about; `beyond` is how far it goes on, in units. A moving body has its line
    from where it is held, `start` in its frame.
    """
    u = canvas.unit
    local = canvas.within(body, places)
    along = np.asarray(axis, float) / np.linalg.norm(axis)
    travel = local @ along
    foot = local - travel[:, None] * along
    if not np.isfinite(travel).any():
        return
    low, high = float(np.nanmin(travel)) - beyond * u, float(np.nanmax(travel)) + beyond * u
    if start is not None and body != GROUND:
        low, high = min(low, float(start @ along)), max(high, float(start @ along))
    middle = np.nanmean(foot, axis=0)
    first, last = (canvas.flat(canvas.at(body, middle + end * along)) for end in (low, high))
    if body != GROUND:
        canvas.line(first, last, stroke=canvas.colours[body], width=2.2, layer=GUIDES, owner=owner)
        return
    direction = unit_vector(last - first)
    side = normal_of(direction)
    side = np.where(side[:, 1:] > 1e-9, -side, side)  # strokes below the line, or to its left where it stands
    side = np.where((np.abs(side[:, 1:]) <= 1e-9) & (side[:, :1] > 0), -side, side)
    shift = side * (0.9 * u if canvas.planar else 0.0)
    if not canvas.planar:
        canvas.line(first, last, width=1.0, layer=GUIDES, owner=owner)
        for end in (first, last):
            hatching(canvas, end - side * 0.9 * u, end + side * 0.9 * u, direction * 0.5, 3, owner)
        return
    count = int(np.clip((high - low) / (0.8 * u), 4, 40))
    hatching(canvas, first + shift, last + shift, side, count, owner)


def spring(canvas: Canvas, first: np.ndarray, second: np.ndarray, owner: str, *, turns: int = 6) -> None:
    """Draw a zigzag between two places, (time, 2)."""
    u = canvas.unit
    share = np.concatenate([[0.0], np.linspace(0.14, 0.86, 2 * turns + 1), [1.0]])
    offset = np.zeros(len(share))
    offset[2:-2] = 0.8 * np.where(np.arange(len(share) - 4) % 2 == 0, 1.0, -1.0)
    side = normal_of(unit_vector(second - first))
    points = first[:, None] + share[:, None] * (second - first)[:, None] + (offset * u)[:, None] * side[:, None]
    canvas.curve(points, width=1.1, layer=SYMBOLS, owner=owner)


def actuator(canvas: Canvas, first: np.ndarray, second: np.ndarray, owner: str, *, fill: str = "#DDDDDD") -> None:
    """Draw a cylinder that stands at the first place, (time, 2), and its rod, which reaches to the second."""
    u = canvas.unit
    span = np.linalg.norm(second - first, axis=-1)
    finite = span[np.isfinite(span)]
    length = 0.62 * float(finite.min()) if finite.size else 0.0
    direction = unit_vector(second - first)
    side = normal_of(direction) * 0.55 * u
    head = first + direction * np.minimum(length, span)[:, None]
    canvas.line(first, second, width=1.5, layer=SYMBOLS, owner=owner)
    canvas.area(first - side, first + side, head + side, head - side, fill=fill, width=1.0, layer=SYMBOLS, owner=owner)


def turn(canvas: Canvas, center: np.ndarray, plane: np.ndarray, owner: str, *, spiral: bool = False) -> None:
    """Draw an arrow that turns about a place, or a spiral spring.

    Parameters
    ----------
    canvas : Canvas
        Drawn on.
    center : numpy.ndarray of shape (time, 2)
        Flat.
    plane : numpy.ndarray of shape (time, 2, 2)
        Two unit vectors across the axis, flat, in rows.
    owner : str
        What it shows.
    spiral : bool, default False
        Whether it is a spring.
    """
    u = canvas.unit
    angle = np.linspace(0.0, 5.0 * np.pi, 61) if spiral else np.radians(np.linspace(-50.0, 195.0, 25))
    radius = np.linspace(0.9, 2.3, len(angle)) if spiral else np.full(len(angle), 2.4)

    def place(at: Any, distance: Any) -> np.ndarray:
        circle = np.stack([distance * np.cos(at), distance * np.sin(at)], axis=-1) * u
        return center[:, None] + np.einsum("nk,tkc->tnc", circle, plane)

    canvas.curve(place(angle, radius), width=1.2, layer=MARKS, owner=owner)
    if not spiral:
        last = np.array([angle[-1], angle[-1], angle[-1] + 0.42])
        head = place(last, np.array([1.95, 2.85, 2.4]))
        canvas.curve(head, closed=True, fill=INK, width=0.5, layer=MARKS, owner=owner)


def cylinder(canvas: Canvas, center: np.ndarray, axes: np.ndarray, size: tuple[float, float], **look: Any) -> None:
    """Draw a cylinder around an axis in space.

    Parameters
    ----------
    canvas : Canvas
        Drawn on.
    center : numpy.ndarray of shape (time, 2)
        Flat.
    axes : numpy.ndarray of shape (time, 3, 3)
        Global unit vectors in rows, the first along the axis.
    size : tuple of float
        Half the length and the radius, in units.
    **look
        Of the shapes.
    """
    half, radius = (value * canvas.unit for value in size)
    axis = canvas.flat(axes[:, 0])
    along, depth = unit_vector(axis), canvas.depth(axes[:, 0])
    across = normal_of(along)
    squeeze = np.abs(depth)[:, None, None]
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 10)
    cap = radius * (np.sin(angle)[:, None] * across[:, None] + squeeze * np.cos(angle)[:, None] * along[:, None])
    outline = np.concatenate(
        [center[:, None] + half * axis[:, None] + cap, (center - half * axis)[:, None] - cap], axis=1
    )
    canvas.curve(outline, closed=True, **look)
    around = np.linspace(0.0, 2 * np.pi, 21)[:-1]
    face = radius * (np.sin(around)[:, None] * across[:, None] + squeeze * np.cos(around)[:, None] * along[:, None])
    near = center + half * axis * np.where(depth >= 0, 1.0, -1.0)[:, None]
    canvas.curve(near[:, None] + face, closed=True, **look)


def box(canvas: Canvas, center: np.ndarray, axes: np.ndarray, size: tuple[float, float, float], **look: Any) -> None:
    """Draw the three sides of a box that face the viewer, in space.

    The arguments are those of `cylinder`; the size is half of each edge, along the three axes, in units.
    """
    halves = np.array(size) * canvas.unit
    flat, facing = canvas.flat(axes), np.where(canvas.depth(axes) >= 0, 1.0, -1.0)  # time, 3, 2 and time, 3
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        middle = center + (facing[:, k] * halves[k])[:, None] * flat[:, k]
        corners = [
            middle + a * halves[i] * flat[:, i] + b * halves[j] * flat[:, j]
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        canvas.area(*corners, **look)
