"""Planar bodies as flat plates in layers, with pins, slides, wheels and gears, as they are seen from the front."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jounce.mechanism.mechanism import GROUND
from jounce.viewer.solids import DARK, GREY, Solid, annulus, box, cylinder, gear, merged, plate, prism

__all__ = ["planar_solids", "travel"]

STAND = (104, 110, 120)
THICKNESS, WIDTH, PIN = 0.02, 0.017, 0.011  # in sizes of the mechanism
WHEELS = ("gear", "coordinate", "rolling", "rack")


def planar_solids(motion: Any, seen: Any, colours: Any) -> tuple[dict[str, tuple[Solid, ...]], float]:
    """Return the solids of planar bodies, each in a layer of its own, and the z in front of all."""
    size, bodies = seen.size, (GROUND, *motion.mechanism.bodies)
    layer = {body: (k - 1) * THICKNESS * size for k, body in enumerate(bodies)}
    front = (len(bodies) + 1) * THICKNESS * size
    found: dict[str, list[Solid]] = {body: [] for body in bodies}

    def add(body: str, mesh: Any, colour: Any) -> None:
        vertices, faces = mesh
        found[body].append(Solid(vertices, faces, colour))

    wheels = _wheels(seen)
    for body, link in seen.links.items():
        low, high = layer[body], layer[body] + 0.8 * THICKNESS * size
        if body == GROUND:
            for point, names in zip(link.points, link.names, strict=True):
                if names:
                    add(body, _pedestal(point, size, layer[body]), STAND)
            continue
        for step, wheel in enumerate(wheels.get(body, ())):
            _add_wheel(add, body, wheel, low, high + 0.2 * step * (high - low), colours[body])
        if len(link.points) > 1:
            add(body, plate(link.points, WIDTH * size, low, high), colours[body])
        elif body not in wheels:
            add(body, gear(1.6 * WIDTH * size, low, high, link.points[0]), colours[body])
    for symbol in seen.symbols:
        _add_symbol(add, motion, symbol, layer, size)
    for symbol in seen.drivers:
        if symbol.kind == "slide":
            _add_slide(add, motion, symbol, layer, size, block=False)
    return {body: tuple(solids) for body, solids in found.items()}, front


class _Wheel(NamedTuple):
    center: np.ndarray
    radius: float
    module: float  # of its teeth, zero for none
    ring: bool  # teeth inside


def _wheels(seen: Any) -> dict[str, list[_Wheel]]:
    """Return the wheels of each body, the largest first."""
    found: dict[str, list[_Wheel]] = {}
    for symbol in seen.symbols:
        if symbol.kind not in WHEELS:
            continue
        radii = [radius for radius in symbol.radii if radius]
        module = min(radii, default=0.0) / 9 if symbol.kind == "gear" else 0.0
        for body, point, radius in zip(symbol.bodies, symbol.points, symbol.radii, strict=True):
            if not radius or body == GROUND:
                continue
            wheel = _Wheel(np.asarray(point, float), radius, module, symbol.internal and radius == max(radii))
            known = found.setdefault(body, [])
            if not any(np.allclose([*w.center, w.radius], [*point, radius], atol=1e-9 * seen.size) for w in known):
                known.append(wheel)
    return {body: sorted(known, key=lambda wheel: -wheel.radius) for body, known in found.items()}


def _add_wheel(add: Any, body: str, wheel: _Wheel, low: float, high: float, colour: Any) -> None:
    """Draw a wheel with its teeth, and a mark that shows how it turns."""
    center, radius, module, ring = wheel
    x, y = (float(value) for value in center)
    if ring:
        add(body, annulus(radius, 1.16 * radius, low, high, center, module), colour)
        mark, long = 1.09 * radius, 0.12 * radius
    else:
        add(body, gear(radius, low, high, center, module), colour)
        add(body, gear(0.62 * radius, low, high + 0.1 * (high - low), center), _lighter(colour))
        mark, long = 0.5 * radius, 0.9 * radius
    add(body, box([long, 0.1 * radius, 0.2 * (high - low)], [x + mark, y, high]), DARK)


def _lighter(colour: tuple[int, int, int]) -> tuple[int, int, int]:
    red, green, blue = (int(c + 0.35 * (255 - c)) for c in colour)
    return red, green, blue


def _pedestal(point: np.ndarray, size: float, low: float) -> Any:
    """Return the triangle with a base that stands for the ground, its tip in a point."""
    high, width, radius = 0.06 * size, 0.034 * size, 1.3 * PIN * size
    x, y = point
    bottom, top = low - 0.5 * THICKNESS * size, low + 0.7 * THICKNESS * size
    angle = np.linspace(0.12 * np.pi, 0.88 * np.pi, 12)
    tip = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)
    stand = prism(np.concatenate([tip, [[x - width, y - high], [x + width, y - high]]]), bottom, top)
    foot = box([3.1 * width, 0.16 * high, top - bottom], [x, y - 1.08 * high, 0.5 * (bottom + top)])
    return merged([stand, foot])


def _add_symbol(add: Any, motion: Any, symbol: Any, layer: Any, size: float) -> None:
    thick = THICKNESS * size
    if symbol.kind in ("revolute", "double_revolute", "parallel2"):
        rod = symbol.kind == "double_revolute"
        for k in (0, 1) if rod else (1,):
            levels = [layer[body] for body in ((symbol.bodies[k],) if rod else symbol.bodies)]
            low, high = min(levels) - 0.15 * thick, max(levels) + 1.1 * thick
            center = [*symbol.points[k], 0.5 * (low + high)]
            add(symbol.bodies[k], cylinder(PIN * size, high - low, center=center), DARK)
    if symbol.kind in ("prismatic", "parallel2"):
        _add_slide(add, motion, symbol, layer, size, block=symbol.kind == "prismatic")


def _add_slide(add: Any, motion: Any, symbol: Any, layer: Any, size: float, block: bool) -> None:
    """Draw a rail on the first body, as long as what slides travels, and a block on the second."""
    along = np.asarray(symbol.axes[0], float) / np.linalg.norm(symbol.axes[0])
    low, high = travel(motion, symbol)
    margin, first, second = 0.06 * size, *symbol.bodies[:2]
    turn = np.array([[along[0], -along[1], 0], [along[1], along[0], 0], [0, 0, 1.0]])
    middle = np.asarray(symbol.points[0]) + along * 0.5 * (low + high)
    depth = layer[first] - (0.6 if first == GROUND else -0.2) * THICKNESS * size
    add(first, box([high - low + 2 * margin, 0.022 * size, 0.3 * THICKNESS * size], [*middle, depth], turn), GREY)
    if block:
        axis = np.asarray(symbol.axes[1] if symbol.axes[1] is not None else along, float)
        axis = axis / np.linalg.norm(axis)
        turn = np.array([[axis[0], -axis[1], 0], [axis[1], axis[0], 0], [0, 0, 1.0]])
        center = [*symbol.points[1], layer[second] + 0.2 * THICKNESS * size]
        add(second, box([0.085 * size, 0.05 * size, 0.9 * THICKNESS * size], center, turn), DARK)


def travel(motion: Any, symbol: Any) -> tuple[float, float]:
    """Return how far the point on the second body is from that on the first, along the axis on the first, m."""
    from jounce.plot.geometry import placed

    first, second = symbol.bodies[:2]
    axis = np.asarray(symbol.axes[0], float)
    ends = np.stack([symbol.points[0], symbol.points[0] + axis / np.linalg.norm(axis)])
    base = placed(motion, first, ends)[:, 0]
    there = placed(motion, second, np.asarray(symbol.points[1])[None])[:, 0, 0]
    along = np.einsum("tc,tc->t", there - base[:, 0], base[:, 1] - base[:, 0])
    along = along[np.isfinite(along)]
    return float(along.min()), float(along.max())
