"""Symbols of joints, as textbooks of mechanisms draw them, with those of drivers and forces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.mechanism import Mechanism
from jounce.mechanism.building.belts import belt_course, belt_outline
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.outputs.linkage_outputs import SymmetricRollCenterOutput
from jounce.plot.drawings import symbol_parts as parts
from jounce.plot.drawings.cams import pitch_curve
from jounce.plot.drawings.curve_lines import shown
from jounce.plot.drawings.drawing import BARS, GUIDES, INK, MARKS, SYMBOLS, WHEELS, Drawing, Flat, Label, tinted
from jounce.plot.drawings.driver_symbols import DRIVERS_AND_FORCES
from jounce.plot.drawings.frames import frame_along
from jounce.plot.drawings.geometry import Symbol, Wheel
from jounce.plot.style import GRAY


def draw_symbols(drawing: Drawing, mechanism: Mechanism) -> None:
    """Draw all joints, drivers and forces of a mechanism, with the names of joints."""
    skeleton = drawing.skeleton
    for wheel in skeleton.wheels:
        _draw_wheel(drawing, wheel)
    for symbol in skeleton.symbols:
        drawing.owner = f"joints.{symbol.name}"
        (_PLANAR if drawing.planar else _SPATIAL).get(symbol.kind, _unknown)(drawing, symbol)
        if symbol.kind not in _UNNAMED:
            center = np.mean(drawing.ends(symbol), axis=0) if symbol.kind in _BETWEEN else drawing.point(symbol)
            drawing.name(symbol.name, center, INK)
    for kind, symbols in (("drivers", skeleton.drivers), ("forces", skeleton.forces)):
        for symbol in symbols:
            drawing.owner = f"{kind}.{symbol.name}"
            DRIVERS_AND_FORCES.get(symbol.kind, _unknown)(drawing, symbol)
    for name, output in mechanism.outputs.items():
        bodies = getattr(output, "bodies", ())
        is_contact = isinstance(output, SymmetricRollCenterOutput)  # its point is the contact point
        if getattr(output, "point", None) is not None and len(bodies) == 1 and not is_contact:
            link = skeleton.links[bodies[0]]
            for center in (point for point, names in zip(link.points, link.names, strict=True) if name in names):
                drawing.owner, flat = f"outputs.{name}", drawing.flat(drawing.at(link.body, center))
                drawing.disc(flat, 0.3 * drawing.unit, stroke="", fill=INK, layer=MARKS)
                if not any(_says(label, name, link.body, flat, drawing.unit) for label in drawing.labels):
                    drawing.name(name, flat, GRAY)


def _says(label: Label, name: str, body: str, place: Flat, unit: float) -> bool:
    """Return whether an output has the name of its body, or of a joint at its position, which is already written."""
    is_near = np.linalg.norm(label.anchor - place, axis=1) < 3.0 * unit
    return label.text == name and (label.owner == f"bodies.{body}" or bool(is_near.all()))


def _draw_wheel(drawing: Drawing, wheel: Wheel) -> None:
    """Draw a wheel with a mark that shows its rotation; a ring gear is hollow."""
    body, radius, rim = wheel.body, wheel.radius, 1.2 * drawing.unit
    center, color = drawing.flat(drawing.at(body, wheel.center)), drawing.colors.get(body, INK)
    look = {"stroke": color, "layer": WHEELS, "owner": f"bodies.{body}"}
    if wheel.internal:
        drawing.disc(center, radius + rim, width=1.2, **look)
    drawing.disc(center, radius, fill="" if wheel.internal else tinted(color, 0.15), width=1.6, **look)
    if not drawing.skeleton.links[body].edges:  # its name is in the wheel, or at its rim
        offset = np.array([0.0, radius if wheel.internal else 0.55 * radius])
        drawing.move_name(f"bodies.{body}", center + offset)
    ends = (radius + rim, radius) if wheel.internal else (0.0, radius)
    far, out = (drawing.flat(drawing.at(body, wheel.center + np.array([reach, 0.0]))) for reach in ends)
    drawing.line(far, out, width=1.2, **look)


def _revolute(drawing: Drawing, symbol: Symbol) -> None:
    parts.draw_ground_support(drawing, symbol)
    parts.pin(drawing, drawing.point(symbol))


def _rod(drawing: Drawing, symbol: Symbol) -> None:
    parts.draw_ground_support(drawing, symbol)
    ends = drawing.ends(symbol)
    drawing.line(*ends, width=2.6, stroke="#666666", layer=BARS)
    for end in ends:
        (parts.pin if drawing.planar else parts.ball)(drawing, end)


def _slide(drawing: Drawing, symbol: Symbol, beyond: float) -> tuple[int, str]:
    """Draw the rail of a joint, and return the slot and the name of the sliding body."""
    block, guide = symbol.block_and_rail
    point, start = drawing.global_point(symbol, block), symbol.points[guide]
    parts.rail(drawing, symbol.bodies[guide], point, symbol.axis_on(guide), beyond=beyond, start=start)
    return block, symbol.bodies[block]


def _prismatic(drawing: Drawing, symbol: Symbol) -> None:
    block, body = _slide(drawing, symbol, 2.6)
    along = parts.unit_vector(drawing.toward(body, symbol.axis_on(block)))
    _draw_block(drawing, body, drawing.point(symbol, block), along)


def _draw_block(drawing: Drawing, body: str, point: Flat, along: Flat) -> None:
    u, side = drawing.unit, parts.normal_of(along)
    corners = [point + a * 1.7 * u * along + b * 0.9 * u * side for a, b in parts.CORNERS]
    color = drawing.colors.get(body, INK)
    drawing.area(*corners, stroke=color, fill=tinted(color, 0.35), width=1.6, layer=BARS)


def _pin_in_slot(drawing: Drawing, symbol: Symbol) -> None:
    pin_point = drawing.global_point(symbol, 1)
    parts.rail(drawing, symbol.bodies[0], pin_point, symbol.axis_on(0), start=symbol.points[0])
    parts.pin(drawing, drawing.flat(pin_point))


def _curve(drawing: Drawing, symbol: Symbol) -> None:
    """Draw the curve of a body as a groove, or the lines of a surface, with the point held on it."""
    body, guided = symbol.bodies[0], drawing.global_point(symbol, 1)
    color = "#888888" if body == GROUND else drawing.colors.get(body, INK)
    for line in shown(symbol.curve, drawing.within(body, guided), 4 * drawing.unit):
        flat = drawing.flat(drawing.at(body, line))
        if symbol.kind == "curve":
            drawing.curve(flat, stroke=color, width=5.0, layer=GUIDES)
            drawing.curve(flat, stroke=parts.PAPER, width=3.2, layer=GUIDES)
        else:
            drawing.curve(flat, stroke=tinted(color, 0.6), width=0.6, layer=GUIDES - 1)
    (parts.pin if drawing.planar else parts.ball)(drawing, drawing.flat(guided))


def _cam(drawing: Drawing, symbol: Symbol) -> None:
    """Draw the pitch curve of a plate cam, which a point of its follower traces, and the point as a roller."""
    disc, _ = symbol.bodies
    guided, color = drawing.global_point(symbol, 1), drawing.colors.get(disc, INK)
    pitch, whole = pitch_curve(drawing.within(disc, guided))
    if len(pitch) > 1:
        flat = drawing.flat(drawing.at(disc, pitch))
        drawing.curve(flat, closed=whole, stroke=color, width=1.6, layer=WHEELS, owner=f"bodies.{disc}")
    drawing.disc(drawing.flat(guided), 0.9 * drawing.unit, stroke=INK, fill=parts.PAPER, width=1.2, layer=SYMBOLS)


def _coordinate(drawing: Drawing, symbol: Symbol) -> None:
    """Draw the line along which a body with a fixed x or y may move; a fixed angle has no symbol."""
    direction = symbol.axes[0]
    if direction is None or symbol.bodies[0] != GROUND:
        return
    free, point = direction[::-1].copy(), drawing.point(symbol, 1)
    parts.rail(drawing, GROUND, point, free)
    _draw_block(drawing, symbol.bodies[1], point, np.broadcast_to(free, point.shape))


def _rack(drawing: Drawing, symbol: Symbol) -> None:
    wheel, rack = symbol.bodies[:2]
    touch = drawing.at(wheel, symbol.points[0]) + symbol.axis_on(0)
    parts.rail(drawing, rack, touch, symbol.axis_on(1))


def _rolling(drawing: Drawing, symbol: Symbol) -> None:
    body, start, axis = symbol.bodies[0], symbol.points[0], symbol.axis_on(0)
    along = axis / np.linalg.norm(axis)
    travel = (drawing.within(body, drawing.global_point(symbol, 1)) - start) @ along
    frame = drawing.frames[body]
    touch = frame[:, :, 0] + np.einsum("tck,tk->tc", frame[:, :, 1:], start + travel[:, None] * along)
    parts.rail(drawing, body, touch, axis, start=start)
    if not drawing.planar:
        _shafts(drawing, symbol)


def _belt(drawing: Drawing, symbol: Symbol) -> None:
    """Draw a belt around its pulleys, which are drawn as wheels."""
    centers = [drawing.global_point(symbol, slot).T for slot in (0, 1)]
    radii = [radius or 0.0 for radius in symbol.radii]
    course = belt_course(centers[0], centers[1], radii, symbol.crossed)
    outline = belt_outline(course, centers, radii, symbol.crossed)
    drawing.curve(outline, closed=True, stroke="#444444", width=2.2, layer=GUIDES)


def _rope(drawing: Drawing, symbol: Symbol) -> None:
    """Draw a rope through its points, with its ends and its guides."""
    points = [drawing.point(symbol, slot) for slot in range(len(symbol.bodies))]
    drawing.line(*points, width=1.4, stroke="#8A5A2B", layer=GUIDES)
    for k, (body, point) in enumerate(zip(symbol.bodies, points, strict=True)):
        end = k in (0, len(points) - 1)
        color = drawing.colors.get(body, INK)
        drawing.disc(point, (0.35 if end else 0.7) * drawing.unit, stroke=color, fill=parts.PAPER, layer=SYMBOLS)


def _spherical(drawing: Drawing, symbol: Symbol) -> None:
    parts.draw_ground_support(drawing, symbol)
    point = drawing.point(symbol)
    angle = np.radians(np.linspace(150.0, 390.0, 20))
    socket = 1.3 * drawing.unit * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    drawing.curve(point[:, None] + socket, width=1.2, layer=SYMBOLS)
    parts.ball(drawing, point)


def _hinge(drawing: Drawing, symbol: Symbol) -> None:
    parts.draw_ground_support(drawing, symbol)
    slot = symbol.moving_slot
    axes = drawing.frame_along(symbol.bodies[slot], symbol.axis_on(slot))
    point, arm = drawing.point(symbol, slot), 3.2 * drawing.unit * drawing.flat(axes[:, 0])
    drawing.line(point - arm, point + arm, width=0.7, dashes=parts.DASH_DOT, layer=SYMBOLS)
    parts.cylinder(drawing, point, axes, (1.5, 0.75), fill=parts.PAPER, width=1.1, layer=SYMBOLS)


def _sliding_body(drawing: Drawing, symbol: Symbol, block: int) -> tuple[Flat, Float[np.ndarray, "time 3 3"], Any]:
    """Return the position, axes and style of a body that slides in space."""
    body = symbol.bodies[block]
    axes, color = drawing.frame_along(body, symbol.axis_on(block)), drawing.colors.get(body, INK)
    return drawing.point(symbol, block), axes, {"stroke": color, "fill": tinted(color, 0.35), "width": 1.2}


def _sleeve(drawing: Drawing, symbol: Symbol) -> None:
    """Draw a sleeve that may turn on a shaft, or a nut on a screw."""
    block, _ = _slide(drawing, symbol, 3.5)
    point, axes, look = _sliding_body(drawing, symbol, block)
    if symbol.kind == "screw":
        shaft = drawing.flat(drawing.frame_along(symbol.bodies[1 - block], symbol.axis_on(1 - block)))
        turns = np.linspace(-3.0, 3.0, 49)
        helix = np.array([turns, 0.45 * np.cos(5 * turns), 0.45 * np.sin(5 * turns)])
        points = point[:, None] + drawing.unit * np.einsum("kn,tkc->tnc", helix, shaft)
        drawing.curve(points, width=0.9, layer=SYMBOLS)
    parts.cylinder(drawing, point, axes, (1.9, 0.9), layer=SYMBOLS, **look)


def _slider(drawing: Drawing, symbol: Symbol) -> None:
    block, _ = _slide(drawing, symbol, 3.0)
    point, axes, look = _sliding_body(drawing, symbol, block)
    parts.box(drawing, point, axes, (1.7, 0.9, 0.9), layer=SYMBOLS, **look)


def _universal(drawing: Drawing, symbol: Symbol) -> None:
    parts.draw_ground_support(drawing, symbol)
    point, u = drawing.point(symbol), drawing.unit
    for slot, body in enumerate(symbol.bodies):
        color = drawing.colors.get(body, INK)
        arm = drawing.flat(drawing.toward(body, symbol.axis_on(slot))) * 1.7 * u
        drawing.line(point - arm, point + arm, stroke=color, width=2.4, layer=SYMBOLS)
        for end in (point - arm, point + arm):
            drawing.disc(end, 0.4 * u, stroke=color, fill=parts.PAPER, width=1.2, layer=SYMBOLS)


def _shafts(drawing: Drawing, symbol: Symbol) -> None:
    """Draw the wheels of two shafts, or a rolling wheel, each with a mark that shows its rotation."""
    for slot, (body, radius) in enumerate(zip(symbol.bodies[:2], symbol.radii, strict=False)):
        if radius is None or body == GROUND:
            continue
        axes, color = drawing.frame_along(body, symbol.axis_on(slot)), drawing.colors.get(body, INK)
        center, look = drawing.point(symbol, slot), {"stroke": color, "layer": WHEELS, "owner": f"bodies.{body}"}
        parts.cylinder(drawing, center, axes, (0.7, radius / drawing.unit), fill=tinted(color, 0.15), width=1.2, **look)
        rim = center + radius * drawing.flat(axes[:, 1])
        drawing.line(center, rim, width=1.0, **look)


def _plane(drawing: Drawing, symbol: Symbol) -> None:
    """Draw the plane of a body, as large as the travel of the point on it, and a ball at the point."""
    body, point = symbol.bodies[0], drawing.global_point(symbol, 1)
    across = frame_along(symbol.axis_on(0))[1:]
    local = drawing.within(body, point)
    spread = local @ across.T  # time, 2
    middle = np.nanmean(local - spread @ across, axis=0)
    low, high = np.nanmin(spread, axis=0) - 3 * drawing.unit, np.nanmax(spread, axis=0) + 3 * drawing.unit
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    corners = [middle + (center + half * np.array(corner)) @ across for corner in parts.CORNERS]
    flat = [drawing.flat(drawing.at(body, corner)) for corner in corners]
    drawing.area(*flat, fill="#F2F2F2", stroke="#888888", width=0.8, layer=GUIDES - 1)
    parts.ball(drawing, drawing.flat(point))


def _nothing(drawing: Drawing, symbol: Symbol) -> None:
    """Draw nothing, as a constraint of directions has no position, and gears are drawn as wheels."""


def _unknown(drawing: Drawing, symbol: Symbol) -> None:
    """Draw a square at each point, and a dotted line between them, for a class without a symbol."""
    points = [drawing.point(symbol, slot) for slot in range(len(symbol.bodies))]
    for point in points:
        corners = [point + 0.7 * drawing.unit * np.array(corner) for corner in parts.CORNERS]
        drawing.area(*corners, fill=parts.PAPER, width=1.2, layer=SYMBOLS)
    if len(points) > 1:
        drawing.line(*points, width=1.0, dashes=parts.DASHES, layer=GUIDES)


_UNNAMED = ("none", "coordinate", "gear", "rack", "rolling", "wheel")
_BETWEEN = ("rod", "belt", "rope")  # named between their first two points
_PLANAR: dict[str, Callable[[Drawing, Symbol], None]] = {
    "revolute": _revolute,
    "rod": _rod,
    "slot": _pin_in_slot,
    "prismatic": _prismatic,
    "coordinate": _coordinate,
    "gear": _nothing,
    "rack": _rack,
    "rolling": _rolling,
    "curve": _curve,
    "cam": _cam,
    "belt": _belt,
    "rope": _rope,
    "none": _nothing,
}
_SPATIAL: dict[str, Callable[[Drawing, Symbol], None]] = {
    "spherical": _spherical,
    "rod": _rod,
    "plane": _plane,
    "universal": _universal,
    "revolute": _hinge,
    "cylindrical": _sleeve,
    "prismatic": _slider,
    "screw": _sleeve,
    "curve": _curve,
    "surface": _curve,
    "gear": _shafts,
    "wheel": _shafts,
    "rolling": _rolling,
    "rope": _rope,
    "none": _nothing,
}
