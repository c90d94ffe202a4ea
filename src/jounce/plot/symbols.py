"""Symbols of joints, drivers and forces, as textbooks of mechanisms draw them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.plot.anchors import axis_of, ball, global_place, middle_of, pin, place_of, slot_of, stand
from jounce.plot.canvas import BARS, GUIDES, INK, MARKS, SYMBOLS, WHEELS, Canvas, tinted
from jounce.plot.drives import DRIVES
from jounce.plot.geometry import Symbol
from jounce.plot.glyphs import (
    DASH_DOT,
    DASHES,
    PAPER,
    box,
    cylinder,
    normal_of,
    rail,
    unit_vector,
)

__all__ = ["draw_symbols"]


def draw_symbols(canvas: Canvas, mechanism: Any) -> None:
    """Draw all joints, drivers and forces of a mechanism, with the names of joints."""
    seen = canvas.skeleton
    for symbol in seen.symbols:
        draw = (_PLANAR if canvas.planar else _SPATIAL).get(symbol.kind, _unknown)
        draw(canvas, symbol, f"joints.{symbol.name}")
        if symbol.kind not in _UNSEEN:
            place = middle_of(canvas, symbol) if "double" in symbol.kind else place_of(canvas, symbol)
            canvas.name(symbol.name, place, INK, f"joints.{symbol.name}")
    for kind, symbols in (("drivers", seen.drivers), ("forces", seen.forces)):
        for symbol in symbols:
            DRIVES.get(symbol.kind, _unknown)(canvas, symbol, f"{kind}.{symbol.name}")
    for name, output in mechanism.outputs.items():
        if getattr(output, "point", None) is not None and len(output.bodies) == 1:
            _draw_output(canvas, name, output.bodies[0])


def _draw_output(canvas: Canvas, name: str, body: str) -> None:
    link = canvas.skeleton.links[body]
    for point, names in zip(link.points, link.names, strict=True):
        if name in names:
            place = canvas.flat(canvas.at(body, point))
            canvas.disc(place, 0.3 * canvas.unit, stroke="", fill=INK, layer=MARKS, owner=f"outputs.{name}")


def _revolute(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    stand(canvas, symbol, owner)
    pin(canvas, place_of(canvas, symbol), owner)


def _rod(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    first, second = (place_of(canvas, symbol, slot) for slot in (0, 1))
    stand(canvas, symbol, owner)
    canvas.line(first, second, width=2.6, stroke="#666666", layer=BARS, owner=owner)
    for place in (first, second):
        if symbol.kind == "double_spherical":
            ball(canvas, place, owner)
        else:
            pin(canvas, place, owner)


def _block_and_rail(symbol: Symbol) -> tuple[int, int]:
    """Return the slots of the block and of the rail: the ground is a rail, else the first body."""
    return (0, 1) if symbol.bodies[1] == GROUND else (1, 0)


def _prismatic(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    block, guide = _block_and_rail(symbol)
    rail(
        canvas,
        symbol.bodies[guide],
        global_place(canvas, symbol, block),
        axis_of(symbol, guide),
        owner,
        start=symbol.points[guide],
    )
    along = unit_vector(canvas.toward(symbol.bodies[block], axis_of(symbol, block)))
    _block(canvas, symbol.bodies[block], place_of(canvas, symbol, block), along, owner)


def _block(canvas: Canvas, body: str, place: np.ndarray, along: np.ndarray, owner: str) -> None:
    u, side = canvas.unit, normal_of(along)
    corners = [place + a * 1.7 * u * along + b * 0.9 * u * side for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    colour = canvas.colours.get(body, INK)
    canvas.area(*corners, stroke=colour, fill=tinted(colour, 0.35), width=1.6, layer=BARS, owner=owner)


def _pin_in_slot(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    held = global_place(canvas, symbol, 1)
    rail(canvas, symbol.bodies[0], held, axis_of(symbol, 0), owner, start=symbol.points[0])
    pin(canvas, canvas.flat(held), owner)


def _coordinate(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw the line along which a body may move whose x or y is fixed; a fixed angle has no symbol."""
    direction = symbol.axes[0]
    if direction is None or symbol.bodies[0] != GROUND:
        return
    free = direction[::-1].copy()
    rail(canvas, GROUND, global_place(canvas, symbol, 1), free, owner)
    along = np.broadcast_to(free, (len(canvas.frames[GROUND]), 2))
    _block(canvas, symbol.bodies[1], place_of(canvas, symbol, 1), along, owner)


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
    largest = max(radius or 0.0 for radius in symbol.radii[:2])
    for slot in (0, 1):
        radius = symbol.radii[slot] or 0.0
        known = [s for s in canvas.shapes if s.kind == "disc" and s.owner == f"bodies.{symbol.bodies[slot]}"]
        if not any(abs(shape.radius - radius) < 1e-9 * radius for shape in known):
            hollow = symbol.internal and radius == largest
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
    axis = axis_of(symbol, 0)
    local = canvas.within(symbol.bodies[0], global_place(canvas, symbol, 1)) - symbol.points[0]
    along = axis / np.linalg.norm(axis)
    on_line = symbol.points[0] + (local @ along)[:, None] * along
    frame = canvas.frames[symbol.bodies[0]]
    touch = frame[:, :, 0] + np.einsum("tck,tk->tc", frame[:, :, 1:], on_line)
    rail(canvas, symbol.bodies[0], touch, axis, owner, start=symbol.points[0])


def _spherical(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    stand(canvas, symbol, owner)
    place = place_of(canvas, symbol)
    angle = np.radians(np.linspace(150.0, 390.0, 20))
    socket = 1.3 * canvas.unit * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    canvas.curve(place[:, None] + socket, width=1.2, layer=SYMBOLS, owner=owner)
    ball(canvas, place, owner)


def _hinge(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    stand(canvas, symbol, owner)
    slot = slot_of(symbol)
    axes = canvas.frame_of(symbol.bodies[slot], axis_of(symbol, slot))
    place, axis = place_of(canvas, symbol, slot), canvas.flat(axes[:, 0])
    reach = 3.2 * canvas.unit
    canvas.line(place - reach * axis, place + reach * axis, width=0.7, dashes=DASH_DOT, layer=SYMBOLS, owner=owner)
    cylinder(canvas, place, axes, (1.5, 0.75), fill=PAPER, width=1.1, layer=SYMBOLS, owner=owner)


def _sleeve(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw a sleeve on a shaft, which it may turn about; with a thread it is a nut on a screw."""
    block, guide = _block_and_rail(symbol)
    body, shaft = symbol.bodies[block], symbol.bodies[guide]
    place = global_place(canvas, symbol, block)
    rail(canvas, shaft, place, axis_of(symbol, guide), owner, beyond=3.5, start=symbol.points[guide])
    if symbol.kind == "screw":
        frame = canvas.frame_of(shaft, axis_of(symbol, guide))
        flat, u = canvas.flat(frame), canvas.unit
        turns = np.linspace(-3.0, 3.0, 49)
        helix = [turns, 0.45 * np.cos(5 * turns), 0.45 * np.sin(5 * turns)]
        points = canvas.flat(place)[:, None] + u * np.einsum("kn,tkc->tnc", np.array(helix), flat)
        canvas.curve(points, width=0.9, layer=SYMBOLS, owner=owner)
    axes, colour = canvas.frame_of(body, axis_of(symbol, block)), canvas.colours.get(body, INK)
    look = {"stroke": colour, "fill": tinted(colour, 0.35), "width": 1.2, "layer": SYMBOLS, "owner": owner}
    cylinder(canvas, canvas.flat(place), axes, (1.9, 0.9), **look)


def _slider(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    block, guide = _block_and_rail(symbol)
    body = symbol.bodies[block]
    place = global_place(canvas, symbol, block)
    rail(canvas, symbol.bodies[guide], place, axis_of(symbol, guide), owner, beyond=3.0, start=symbol.points[guide])
    axes, colour = canvas.frame_of(body, axis_of(symbol, block)), canvas.colours.get(body, INK)
    look = {"stroke": colour, "fill": tinted(colour, 0.35), "width": 1.2, "layer": SYMBOLS, "owner": owner}
    box(canvas, canvas.flat(place), axes, (1.7, 0.9, 0.9), **look)


def _universal(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    stand(canvas, symbol, owner)
    place, u = place_of(canvas, symbol), canvas.unit
    for body, axis in zip(symbol.bodies, symbol.axes, strict=True):
        colour = canvas.colours.get(body, INK)
        arm = canvas.flat(canvas.toward(body, np.eye(3)[0] if axis is None else axis)) * 1.7 * u
        canvas.line(place - arm, place + arm, stroke=colour, width=2.4, layer=SYMBOLS, owner=owner)
        for end in (place - arm, place + arm):
            canvas.disc(end, 0.4 * u, stroke=colour, fill=PAPER, width=1.2, layer=SYMBOLS, owner=owner)


def _plane(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw the plane of a body, as large as the point on it travels, and a ball at the point."""
    body, normal = symbol.bodies[0], axis_of(symbol, 0)
    frame = canvas.frame_of(body, normal)
    place = global_place(canvas, symbol, 1)
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
    ball(canvas, canvas.flat(place), owner)


def _unseen(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw nothing: what only keeps a direction has no place."""


def _unknown(canvas: Canvas, symbol: Symbol, owner: str) -> None:
    """Draw a square at each point, and a dotted line between them: what a type of one's own is, nobody else knows."""
    u = canvas.unit
    places = [place_of(canvas, symbol, slot) for slot in range(len(symbol.bodies))]
    for place in places:
        corners = [place + 0.7 * u * np.array(c, float) for c in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        canvas.area(*corners, fill=PAPER, width=1.2, layer=SYMBOLS, owner=owner)
    if len(places) > 1:
        canvas.line(*places, width=1.0, dashes=DASHES, layer=GUIDES, owner=owner)


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
