"""Symbols of joints, drivers and forces, as textbooks of mechanisms draw them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.plot.geometry import Symbol
from jounce.plot.glyphs import (
    DASH_DOT,
    DASHES,
    PAPER,
    actuator,
    box,
    cylinder,
    normal_of,
    rail,
    spring,
    support,
    turn,
    unit_vector,
)
from jounce.plot.scene import BARS, GUIDES, INK, MARKS, SYMBOLS, WHEELS, Canvas, tinted

__all__ = ["draw_symbols"]

HINGES = ("revolute", "cylindrical", "universal", "screw", "spherical", "parallel2", "prismatic")


def draw_symbols(canvas: Canvas, mechanism: Any) -> None:
    """Draw all joints, drivers and forces of a mechanism, with the names of joints."""
    seen = canvas.skeleton
    for symbol in seen.symbols:
        draw = (_PLANAR if canvas.planar else _SPATIAL).get(symbol.kind, _unknown)
        draw(canvas, symbol, f"joints.{symbol.name}")
        if symbol.kind not in _UNSEEN:
            place = _middle(canvas, symbol) if "double" in symbol.kind else _place(canvas, symbol)
            canvas.name(symbol.name, place, INK, f"joints.{symbol.name}")
    for kind, symbols in (("drivers", seen.drivers), ("forces", seen.forces)):
        for symbol in symbols:
            _ACTIVE.get(symbol.kind, _unknown)(canvas, symbol, f"{kind}.{symbol.name}")
    for name, output in mechanism.outputs.items():
        if getattr(output, "point", None) is not None and len(output.bodies) == 1:
            _draw_output(canvas, name, output.bodies[0])


def _draw_output(canvas: Canvas, name: str, body: str) -> None:
    link = canvas.skeleton.links[body]
    for point, names in zip(link.points, link.names, strict=True):
        if name in names:
            place = canvas.flat(canvas.at(body, point))
            canvas.disc(place, 0.3 * canvas.unit, stroke="", fill=INK, layer=MARKS, owner=f"outputs.{name}")


def _slot(symbol: Symbol) -> int:
    """Return which body the symbol is fixed to: one that moves, the last of them."""
    moving = [k for k, body in enumerate(symbol.bodies[:2]) if body != GROUND]
    return moving[-1] if moving else 0


def _global(canvas: Canvas, symbol: Symbol, slot: int | None = None) -> np.ndarray:
    slot = _slot(symbol) if slot is None else slot
    return canvas.at(symbol.bodies[slot], symbol.points[slot])


def _place(canvas: Canvas, symbol: Symbol, slot: int | None = None) -> np.ndarray:
    return canvas.flat(_global(canvas, symbol, slot))


def _middle(canvas: Canvas, symbol: Symbol) -> np.ndarray:
    return 0.5 * (_place(canvas, symbol, 0) + _place(canvas, symbol, 1))


def _stand(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw the support of a joint whose one body is the ground."""
    if GROUND in symbol.bodies[:2]:
        support(canvas, _place(canvas, symbol, symbol.bodies.index(GROUND)), owner)


def _pin(canvas: Canvas, place: np.ndarray, owner: str) -> None:
    canvas.disc(place, 0.8 * canvas.unit, fill=PAPER, width=1.3, layer=SYMBOLS, owner=owner)


def _revolute(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    _stand(canvas, symbol, owner)
    _pin(canvas, _place(canvas, symbol), owner)


def _rod(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    first, second = (_place(canvas, symbol, slot) for slot in (0, 1))
    _stand(canvas, symbol, owner)
    canvas.line(first, second, width=2.6, stroke="#666666", layer=BARS, owner=owner)
    for place in (first, second):
        if symbol.kind == "double_spherical":
            _sphere(canvas, place, owner)
        else:
            _pin(canvas, place, owner)


def _block_and_rail(symbol: Symbol) -> tuple[int, int]:
    """Return the slots of the block and of the rail: the ground is a rail, else the first body."""
    return (0, 1) if symbol.bodies[1] == GROUND else (1, 0)


def _axis(symbol: Symbol, slot: int) -> np.ndarray:
    axis = symbol.axes[slot] if symbol.axes[slot] is not None else symbol.axes[1 - slot]
    return np.eye(len(symbol.points[slot]))[0] if axis is None else axis


def _prismatic(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    block, guide = _block_and_rail(symbol)
    rail(
        canvas,
        symbol.bodies[guide],
        _global(canvas, symbol, block),
        _axis(symbol, guide),
        owner,
        start=symbol.points[guide],
    )
    along = unit_vector(canvas.toward(symbol.bodies[block], _axis(symbol, block)))
    _block(canvas, symbol.bodies[block], _place(canvas, symbol, block), along, owner)


def _block(canvas: Canvas, body: str, place: np.ndarray, along: np.ndarray, owner: str) -> None:
    u, side = canvas.unit, normal_of(along)
    corners = [place + a * 1.7 * u * along + b * 0.9 * u * side for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    colour = canvas.colours.get(body, INK)
    canvas.area(*corners, stroke=colour, fill=tinted(colour, 0.35), width=1.6, layer=BARS, owner=owner)


def _pin_in_slot(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    pin = _global(canvas, symbol, 1)
    rail(canvas, symbol.bodies[0], pin, _axis(symbol, 0), owner, start=symbol.points[0])
    _pin(canvas, canvas.flat(pin), owner)


def _coordinate(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw the line along which a body may move whose x or y is fixed; a fixed angle has no symbol."""
    direction = symbol.axes[0]
    if direction is None or symbol.bodies[0] != GROUND:
        return
    free = direction[::-1].copy()
    rail(canvas, GROUND, _global(canvas, symbol, 1), free, owner)
    along = np.broadcast_to(free, (len(canvas.frames[GROUND]), 2))
    _block(canvas, symbol.bodies[1], _place(canvas, symbol, 1), along, owner)


def _wheel(canvas: Canvas, body: str, point: np.ndarray, radius: float, owner: str, *, hollow: bool = False) -> None:
    """Draw a wheel with a mark that shows how it turns; a hollow one has its teeth inside."""
    center, colour = canvas.flat(canvas.at(body, point)), canvas.colours.get(body, INK)
    fill = "" if hollow else tinted(colour, 0.15)
    if hollow:
        canvas.disc(center, radius + 1.2 * canvas.unit, stroke=colour, width=1.2, layer=WHEELS, owner=owner)
    canvas.disc(center, radius, stroke=colour, fill=fill, width=1.6, layer=WHEELS, owner=owner)
    if not canvas.skeleton.links[body].edges:  # its name stands in the wheel, or at its rim
        canvas.move_name(f"bodies.{body}", center + np.array([0.0, radius if hollow else 0.55 * radius]))
    out = canvas.at(body, point + np.array([1.0, 0.0]) * radius)
    far = (
        canvas.at(body, point + np.array([1.0, 0.0]) * (radius + 1.2 * canvas.unit))
        if hollow
        else canvas.at(body, point)
    )
    canvas.line(canvas.flat(far), canvas.flat(out), stroke=colour, width=1.2, layer=WHEELS, owner=owner)


def _gear(canvas: Canvas, symbol: Symbol, owner: str) -> None:  # noqa: ARG001  # a gear may be of two pairs
    inner, outer = (radius or 0.0 for radius in symbol.radii[:2])
    first, second = (_place(canvas, symbol, slot) for slot in (0, 1))
    apart = float(np.nanmedian(np.linalg.norm(second - first, axis=-1)))
    inside = apart < max(inner, outer)  # one turns in the other
    for slot in (0, 1):
        radius = symbol.radii[slot] or 0.0
        known = [s for s in canvas.shapes if s.kind == "disc" and s.owner == f"bodies.{symbol.bodies[slot]}"]
        if not any(abs(shape.radius - radius) < 1e-9 * radius for shape in known):
            hollow = inside and radius == max(inner, outer)
            _wheel(
                canvas, symbol.bodies[slot], symbol.points[slot], radius, f"bodies.{symbol.bodies[slot]}", hollow=hollow
            )


def _rack(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    wheel, rack = symbol.bodies[:2]
    _wheel(canvas, wheel, symbol.points[0], symbol.radius or 0.0, f"bodies.{wheel}")
    touch = canvas.at(wheel, symbol.points[0]) + np.asarray(symbol.axes[0], float)
    rail(canvas, rack, touch, symbol.axes[1], owner)


def _rolling(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    _wheel(canvas, symbol.bodies[1], symbol.points[1], symbol.radius or 0.0, f"bodies.{symbol.bodies[1]}")
    axis = _axis(symbol, 0)
    local = canvas.within(symbol.bodies[0], _global(canvas, symbol, 1)) - symbol.points[0]
    along = axis / np.linalg.norm(axis)
    on_line = symbol.points[0] + (local @ along)[:, None] * along
    frame = canvas.frames[symbol.bodies[0]]
    touch = frame[:, :, 0] + np.einsum("tck,tk->tc", frame[:, :, 1:], on_line)
    rail(canvas, symbol.bodies[0], touch, axis, owner, start=symbol.points[0])


def _sphere(canvas: Canvas, place: np.ndarray, owner: str) -> None:
    u = canvas.unit
    canvas.disc(place, 0.85 * u, fill="#BBBBBB", width=1.2, layer=SYMBOLS, owner=owner)
    canvas.disc(place + np.array([-0.25, 0.25]) * u, 0.22 * u, stroke="", fill=PAPER, layer=SYMBOLS, owner=owner)


def _spherical(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    _stand(canvas, symbol, owner)
    place = _place(canvas, symbol)
    angle = np.radians(np.linspace(150.0, 390.0, 20))
    socket = 1.3 * canvas.unit * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    canvas.curve(place[:, None] + socket, width=1.2, layer=SYMBOLS, owner=owner)
    _sphere(canvas, place, owner)


def _hinge(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    _stand(canvas, symbol, owner)
    slot = _slot(symbol)
    axes = canvas.frame_of(symbol.bodies[slot], _axis(symbol, slot))
    place, axis = _place(canvas, symbol, slot), canvas.flat(axes[:, 0])
    reach = 3.2 * canvas.unit
    canvas.line(place - reach * axis, place + reach * axis, width=0.7, dashes=DASH_DOT, layer=SYMBOLS, owner=owner)
    cylinder(canvas, place, axes, (1.5, 0.75), fill=PAPER, width=1.1, layer=SYMBOLS, owner=owner)


def _sleeve(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw a sleeve on a shaft, which it may turn about; with a thread it is a nut on a screw."""
    block, guide = _block_and_rail(symbol)
    body, shaft = symbol.bodies[block], symbol.bodies[guide]
    place = _global(canvas, symbol, block)
    rail(canvas, shaft, place, _axis(symbol, guide), owner, beyond=3.5, start=symbol.points[guide])
    if symbol.kind == "screw":
        frame = canvas.frame_of(shaft, _axis(symbol, guide))
        flat, u = canvas.flat(frame), canvas.unit
        turns = np.linspace(-3.0, 3.0, 49)
        helix = [turns, 0.45 * np.cos(5 * turns), 0.45 * np.sin(5 * turns)]
        points = canvas.flat(place)[:, None] + u * np.einsum("kn,tkc->tnc", np.array(helix), flat)
        canvas.curve(points, width=0.9, layer=SYMBOLS, owner=owner)
    axes, colour = canvas.frame_of(body, _axis(symbol, block)), canvas.colours.get(body, INK)
    look = {"stroke": colour, "fill": tinted(colour, 0.35), "width": 1.2, "layer": SYMBOLS, "owner": owner}
    cylinder(canvas, canvas.flat(place), axes, (1.9, 0.9), **look)


def _slider(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    block, guide = _block_and_rail(symbol)
    body = symbol.bodies[block]
    place = _global(canvas, symbol, block)
    rail(canvas, symbol.bodies[guide], place, _axis(symbol, guide), owner, beyond=3.0, start=symbol.points[guide])
    axes, colour = canvas.frame_of(body, _axis(symbol, block)), canvas.colours.get(body, INK)
    look = {"stroke": colour, "fill": tinted(colour, 0.35), "width": 1.2, "layer": SYMBOLS, "owner": owner}
    box(canvas, canvas.flat(place), axes, (1.7, 0.9, 0.9), **look)


def _universal(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    _stand(canvas, symbol, owner)
    place, u = _place(canvas, symbol), canvas.unit
    for body, axis in zip(symbol.bodies, symbol.axes, strict=True):
        colour = canvas.colours.get(body, INK)
        arm = canvas.flat(canvas.toward(body, np.eye(3)[0] if axis is None else axis)) * 1.7 * u
        canvas.line(place - arm, place + arm, stroke=colour, width=2.4, layer=SYMBOLS, owner=owner)
        for end in (place - arm, place + arm):
            canvas.disc(end, 0.4 * u, stroke=colour, fill=PAPER, width=1.2, layer=SYMBOLS, owner=owner)


def _plane(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw the plane of a body, as large as the point on it travels, and a ball at the point."""
    body, normal = symbol.bodies[0], _axis(symbol, 0)
    frame = canvas.frame_of(body, normal)
    place = _global(canvas, symbol, 1)
    local = canvas.within(body, place)
    local_axes = np.array([canvas.within(body, frame[:, k] + canvas.frames[body][:, :, 0])[0] for k in (1, 2)])
    spread = local @ local_axes.T  # time, 2
    foot = local - spread @ local_axes
    low, high = np.nanmin(spread, axis=0) - 3 * canvas.unit, np.nanmax(spread, axis=0) + 3 * canvas.unit
    corners = [
        np.array([x, y]) for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))
    ]
    middle = np.nanmean(foot, axis=0)
    flat = [canvas.flat(canvas.at(body, middle + corner @ local_axes)) for corner in corners]
    canvas.area(*flat, fill="#F2F2F2", stroke="#888888", width=0.8, layer=GUIDES - 1, owner=owner)
    _sphere(canvas, canvas.flat(place), owner)


def _unseen(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw nothing: what only keeps a direction has no place."""


def _unknown(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw a square at each point, and a dotted line between them: what a type of one's own is, nobody else knows."""
    u = canvas.unit
    places = [_place(canvas, symbol, slot) for slot in range(len(symbol.bodies))]
    for place in places:
        corners = [place + 0.7 * u * np.array(c, float) for c in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        canvas.area(*corners, fill=PAPER, width=1.2, layer=SYMBOLS, owner=owner)
    if len(places) > 1:
        canvas.line(*places, width=1.0, dashes=DASHES, layer=GUIDES, owner=owner)


def _spring(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    _stand(canvas, symbol, owner)
    first, second = (_place(canvas, symbol, slot) for slot in (0, 1))
    spring(canvas, first, second, owner)
    for place in (first, second):
        canvas.disc(place, 0.4 * canvas.unit, fill=PAPER, width=1.0, layer=SYMBOLS, owner=owner)


def _cylinder_drive(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    _stand(canvas, symbol, owner)
    first, second = (_place(canvas, symbol, slot) for slot in (0, 1))
    actuator(canvas, first, second, owner)
    for place in (first, second):
        if canvas.planar:
            _pin(canvas, place, owner)
        else:
            _sphere(canvas, place, owner)


def _slide_drive(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw a double arrow along the direction in which a point is driven, beside it."""
    if symbol.kind == "coordinate":
        if symbol.axes[0] is None:
            _turning(canvas, symbol, owner)
            return
        along = canvas.flat(canvas.toward(GROUND, symbol.axes[0]))
    else:
        along = canvas.flat(canvas.toward(symbol.bodies[0], _axis(symbol, 0)))
    u, side = canvas.unit, normal_of(unit_vector(along))
    place = _place(canvas, symbol, 1) + 2.0 * u * side
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
        center = _place(canvas, shared[0], shared[0].bodies.index(body) if body in shared[0].bodies else None)
    else:
        center = canvas.flat(canvas.at(body, canvas.skeleton.links[body].points[0]))
    if canvas.planar:
        return center, np.broadcast_to(np.eye(2), (len(center), 2, 2))
    axis = symbol.axes[0] if symbol.axes[0] is not None else np.array([0.0, 0.0, 1.0])
    return center, canvas.flat(canvas.frame_of(symbol.bodies[0], axis)[:, 1:])


def _load(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw a mark where a force acts: its direction changes with time."""
    place, u = _place(canvas, symbol, 0), canvas.unit
    corners = [place + u * np.array(corner) for corner in ((0.0, 0.9), (0.9, 0.0), (0.0, -0.9), (-0.9, 0.0))]
    canvas.area(*corners, fill=INK, width=0.6, layer=MARKS, owner=owner)


Drawing = Callable[[Canvas, Symbol, str], None]

_UNSEEN = ("dot1", "parallel1", "coordinate", "gear", "rack", "rolling")
_PLANAR: dict[str, Drawing] = {
    "revolute": _revolute,
    "double_revolute": _rod,
    "parallel1": _unseen,
    "parallel2": _pin_in_slot,
    "prismatic": _prismatic,
    "coordinate": _coordinate,
    "gear": _gear,
    "rack": _rack,
    "rolling": _rolling,
}
_SPATIAL: dict[str, Drawing] = {
    "spherical": _spherical,
    "double_spherical": _rod,
    "dot1": _unseen,
    "dot2": _plane,
    "universal": _universal,
    "revolute": _hinge,
    "cylindrical": _sleeve,
    "prismatic": _slider,
    "screw": _sleeve,
}
_ACTIVE: dict[str, Drawing] = {
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
