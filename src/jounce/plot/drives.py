"""Symbols of drivers and forces: arrows, cylinders, springs."""

from __future__ import annotations

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.plot.anchors import axis_of, ball, pin, place_of, stand
from jounce.plot.canvas import INK, MARKS, SYMBOLS, Canvas
from jounce.plot.geometry import Symbol
from jounce.plot.glyphs import PAPER, actuator, normal_of, spring, turn, unit_vector

__all__ = ["DRIVES"]

HINGES = ("revolute", "cylindrical", "universal", "screw", "spherical", "parallel2", "prismatic")


def _spring(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    stand(canvas, symbol, owner)
    first, second = (place_of(canvas, symbol, slot) for slot in (0, 1))
    spring(canvas, first, second, owner)
    for place in (first, second):
        canvas.disc(place, 0.4 * canvas.unit, fill=PAPER, width=1.0, layer=SYMBOLS, owner=owner)


def _cylinder_drive(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    stand(canvas, symbol, owner)
    first, second = (place_of(canvas, symbol, slot) for slot in (0, 1))
    actuator(canvas, first, second, owner)
    for place in (first, second):
        if canvas.planar:
            pin(canvas, place, owner)
        else:
            ball(canvas, place, owner)


def _slide_drive(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw a double arrow along the direction in which a point is driven, beside it."""
    if symbol.kind == "coordinate":
        if symbol.axes[0] is None:
            _turning(canvas, symbol, owner)
            return
        along = canvas.flat(canvas.toward(GROUND, symbol.axes[0]))
    else:
        along = canvas.flat(canvas.toward(symbol.bodies[0], axis_of(symbol, 0)))
    u, side = canvas.unit, normal_of(unit_vector(along))
    place = place_of(canvas, symbol, 1) + 2.0 * u * side
    canvas.line(place - 2.4 * u * along, place + 2.4 * u * along, width=1.3, layer=MARKS, owner=owner)
    for sign in (-1.0, 1.0):
        tip = place + sign * 3.4 * u * along
        back = place + sign * 2.2 * u * along
        canvas.area(tip, back + 0.55 * u * side, back - 0.55 * u * side, fill=INK, width=0.4, layer=MARKS, owner=owner)


def _turning(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw an arrow, or a spring, about the axis of a turn, at the joint of its bodies where they have one."""
    center, plane = _pivot(canvas, symbol)
    turn(canvas, center, plane, owner, spiral=symbol.kind == "torsional_spring")


def _pivot(canvas: Canvas, symbol: Symbol) -> tuple[np.ndarray, np.ndarray]:
    """Return the place about which two bodies turn, and two flat vectors across the axis there."""
    between = set(symbol.bodies)
    shared = [s for s in canvas.skeleton.symbols if s.kind in HINGES and between <= set(s.bodies[:2]) | {GROUND}]
    shared = [s for s in shared if set(symbol.bodies) - {GROUND} <= set(s.bodies)] or [
        s for s in canvas.skeleton.symbols if s.kind in HINGES and symbol.bodies[-1] in s.bodies
    ]
    body = next(body for body in reversed(symbol.bodies) if body != GROUND)
    if shared:
        center = place_of(canvas, shared[0], shared[0].bodies.index(body) if body in shared[0].bodies else None)
    else:
        center = canvas.flat(canvas.at(body, canvas.skeleton.links[body].points[0]))
    if canvas.planar:
        return center, np.broadcast_to(np.eye(2), (len(center), 2, 2))
    axis = symbol.axes[0] if symbol.axes[0] is not None else np.array([0.0, 0.0, 1.0])
    return center, canvas.flat(canvas.frame_of(symbol.bodies[0], axis)[:, 1:])


def _load(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw a mark where a force acts: its direction changes with time."""
    place, u = place_of(canvas, symbol, 0), canvas.unit
    corners = [place + u * np.array(corner) for corner in ((0.0, 0.9), (0.9, 0.0), (0.0, -0.9), (-0.9, 0.0))]
    canvas.area(*corners, fill=INK, width=0.6, layer=MARKS, owner=owner)


DRIVES = {
    "coordinate": _slide_drive,
    "slide": _slide_drive,
    "distance": _cylinder_drive,
    "rotation": _turning,
    "spring": _spring,
    "slide_spring": _spring,
    "distance_force": _cylinder_drive,
    "slide_force": _slide_drive,
    "torque": _turning,
    "torsional_spring": _turning,
    "moment": _turning,
    "point_force": _load,
}
