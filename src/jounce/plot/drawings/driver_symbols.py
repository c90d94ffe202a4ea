"""Symbols of drivers and forces: arrows, cylinders, springs."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from jounce.mechanism.mechanism import GROUND
from jounce.plot.drawings.drawing import INK, MARKS, SYMBOLS, Drawing, Flat
from jounce.plot.drawings.geometry import Symbol
from jounce.plot.drawings.symbol_parts import (
    PAPER,
    actuator,
    ball,
    draw_ground_support,
    normal_of,
    pin,
    spring,
    turn,
    unit_vector,
)

HINGES = ("revolute", "cylindrical", "universal", "screw", "spherical", "slot", "prismatic")  # joints at one point


def _spring(drawing: Drawing, symbol: Symbol) -> None:
    draw_ground_support(drawing, symbol)
    ends = drawing.ends(symbol)
    spring(drawing, *ends)
    for end in ends:
        drawing.disc(end, 0.4 * drawing.unit, fill=PAPER, width=1.0, layer=SYMBOLS)


def _cylinder_and_rod(drawing: Drawing, symbol: Symbol) -> None:
    draw_ground_support(drawing, symbol)
    ends = drawing.ends(symbol)
    actuator(drawing, *ends)
    for end in ends:
        (pin if drawing.planar else ball)(drawing, end)


def _sliding(drawing: Drawing, symbol: Symbol) -> None:
    """Draw a double arrow beside a point, along the direction in which it is driven."""
    if symbol.kind == "coordinate" and symbol.axes[0] is None:
        _turning(drawing, symbol)
        return
    body = GROUND if symbol.kind == "coordinate" else symbol.bodies[0]
    direction = drawing.flat(drawing.toward(body, symbol.axis_on(0)))
    u, side = drawing.unit, normal_of(unit_vector(direction))
    point = drawing.point(symbol, 1) + 2.0 * u * side
    drawing.line(point - 2.4 * u * direction, point + 2.4 * u * direction, width=1.3, layer=MARKS)
    for sign in (-1.0, 1.0):
        tip = point + sign * 3.4 * u * direction
        tail = point + sign * 2.2 * u * direction
        drawing.area(tip, tail + 0.55 * u * side, tail - 0.55 * u * side, fill=INK, width=0.4, layer=MARKS)


def _turning(drawing: Drawing, symbol: Symbol) -> None:
    """Draw an arrow or a spring about an axis of rotation, at the joint of the bodies if they have one."""
    turn(drawing, *_pivot(drawing, symbol), spiral=symbol.kind == "spiral")


def _pivot(drawing: Drawing, symbol: Symbol) -> tuple[Flat, Float[np.ndarray, "time 2 2"]]:
    """Return the point about which two bodies turn, and the projections of two vectors perpendicular to the axis."""
    hinges = [s for s in drawing.skeleton.symbols if s.kind in HINGES]
    pair = set(symbol.bodies)
    common = [s for s in hinges if pair - {GROUND} <= set(s.bodies) and pair <= {*s.bodies[:2], GROUND}]
    common = common or [s for s in hinges if symbol.bodies[-1] in s.bodies]
    body = next(body for body in reversed(symbol.bodies) if body != GROUND)
    if common:
        center = drawing.point(common[0], common[0].bodies.index(body) if body in common[0].bodies else None)
    else:
        center = drawing.flat(drawing.at(body, drawing.skeleton.links[body].points[0]))
    if drawing.planar:
        return center, np.broadcast_to(np.eye(2), (len(center), 2, 2))
    axis = symbol.axes[0] if symbol.axes[0] is not None else np.array([0.0, 0.0, 1.0])
    return center, drawing.flat(drawing.frame_along(symbol.bodies[0], axis)[:, 1:])


def _point_force(drawing: Drawing, symbol: Symbol) -> None:
    """Draw a mark at the point of application of a force, whose direction varies."""
    point, u = drawing.point(symbol, 0), drawing.unit
    corners = [point + u * np.array(corner) for corner in ((0.0, 0.9), (0.9, 0.0), (0.0, -0.9), (-0.9, 0.0))]
    drawing.area(*corners, fill=INK, width=0.6, layer=MARKS)


DRIVERS_AND_FORCES = {
    "coordinate": _sliding,
    "slide": _sliding,
    "distance": _cylinder_and_rod,
    "rotation": _turning,
    "spring": _spring,
    "slide spring": _spring,
    "spiral": _turning,
    "point force": _point_force,
    "none": lambda *_: None,
}
