"""Meshes of mechanisms: planar bodies as plates in layers, viewed from the front, spatial bodies as round bars."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Float
from shapely.geometry import Polygon
from trimesh import Trimesh

from jounce.kinematics import Motion
from jounce.mechanism.mechanism import GROUND
from jounce.plot.drawings.cams import pitch_curve
from jounce.plot.drawings.curve_lines import shown
from jounce.plot.drawings.frames import frames, points_at, within
from jounce.plot.drawings.geometry import Point, Skeleton, Symbol, Wheel
from jounce.viewer.shapes.appearance import DARK, GRAY, Color
from jounce.viewer.shapes.meshes import (
    box,
    capsule,
    cylinder,
    extruded,
    merged,
    plate,
    rotation_to,
    sleeve,
    sphere,
    tube,
    wheel,
)

Pieces = Iterator[tuple[str, Trimesh, Color]]  # body, mesh in its frame, color

STAND = (104, 110, 120)
THICKNESS, WIDTH, PIN = 0.02, 0.017, 0.011  # of plates, and radius of pins, in sizes of the mechanism
BAR = 0.013  # radius of spatial bars
THREADS = 15  # drawn turns of a screw


def planar_meshes(motion: Motion, skeleton: Skeleton, colors: Mapping[str, Color]) -> Pieces:
    """Yield the meshes of planar bodies, each body in its own layer."""
    size = skeleton.size
    layer = {body: (k - 1) * THICKNESS * size for k, body in enumerate(skeleton.links)}
    yield from _plates_and_wheels(skeleton, layer, colors)
    for symbol in skeleton.symbols:
        if symbol.kind in ("revolute", "rod", "slot"):
            yield from _pins(symbol, layer, size)
        if symbol.kind in ("prismatic", "slot"):
            yield from _planar_slide(motion, symbol, layer, size)
        if symbol.kind == "curve":
            yield from _pins(symbol, layer, size)
            yield from _groove(motion, symbol, size, layer[symbol.bodies[0]])
        if symbol.kind == "cam":
            yield from _disc_cam(motion, symbol, layer, size, colors[symbol.bodies[0]])
    for symbol in skeleton.drivers:
        if symbol.kind == "slide":
            yield from _planar_slide(motion, symbol, layer, size)


def _plates_and_wheels(skeleton: Skeleton, layer: Mapping[str, float], colors: Mapping[str, Color]) -> Pieces:
    size = skeleton.size
    for body, link in skeleton.links.items():
        low, high = layer[body], layer[body] + 0.8 * THICKNESS * size
        if body == GROUND:
            for point, names in zip(link.points, link.names, strict=True):
                if names:
                    yield body, _pedestal(point, size, low), STAND
            for ring in (w for w in skeleton.wheels if w.body == body):
                yield from _wheel(ring, low, high, STAND)
            continue
        wheels = sorted((w for w in skeleton.wheels if w.body == body), key=lambda w: -w.radius)
        for step, its_wheel in enumerate(wheels):
            yield from _wheel(its_wheel, low, high + 0.2 * step * (high - low), colors[body])
        if len(link.points) > 1:
            yield body, plate(link.points, WIDTH * size, low, high), colors[body]
        elif not wheels:
            yield body, wheel(1.6 * WIDTH * size, low, high, link.points[0]), colors[body]


def _wheel(gear_wheel: Wheel, low: float, high: float, color: Color) -> Pieces:
    """Yield a wheel with its teeth, and a mark that shows its rotation."""
    radius, (x, y) = gear_wheel.radius, gear_wheel.center.tolist()
    module = 0.0 if gear_wheel.partner is None else min(radius, gear_wheel.partner) / 9
    if gear_wheel.internal:
        yield gear_wheel.body, wheel(radius, low, high, gear_wheel.center, module=module, outside=1.16 * radius), color
        mark, long = 1.09 * radius, 0.12 * radius
    else:
        red, green, blue = (int(c + 0.35 * (255 - c)) for c in color)
        yield gear_wheel.body, wheel(radius, low, high, gear_wheel.center, module=module), color
        yield (
            gear_wheel.body,
            wheel(0.62 * radius, low, high + 0.1 * (high - low), gear_wheel.center),
            (red, green, blue),
        )
        mark, long = 0.5 * radius, 0.9 * radius
    yield gear_wheel.body, box([long, 0.1 * radius, 0.2 * (high - low)], [x + mark, y, high]), DARK


def _pedestal(point: Point, size: float, low: float) -> Trimesh:
    """Return the support that represents the ground: a triangle on a base, with its tip at a point."""
    high, width, radius = 0.06 * size, 0.034 * size, 1.3 * PIN * size
    bottom, top = low - 0.5 * THICKNESS * size, low + 0.7 * THICKNESS * size
    angle = np.linspace(0.12 * np.pi, 0.88 * np.pi, 12)
    tip = point + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    stand = extruded(Polygon(np.concatenate([tip, point + np.array([[-width, -high], [width, -high]])])), bottom, top)
    foot = box([3.1 * width, 0.16 * high, top - bottom], [point[0], point[1] - 1.08 * high, 0.5 * (bottom + top)])
    return merged([stand, foot])


def _pins(symbol: Symbol, layer: Mapping[str, float], size: float) -> Pieces:
    """Yield the pin of a joint through the layers of its bodies, or the pins at both ends of a rod."""
    rod = symbol.kind == "rod"
    for k in (0, 1) if rod else (1,):
        levels = [layer[body] for body in ((symbol.bodies[k],) if rod else symbol.bodies)]
        low, high = min(levels) - 0.15 * THICKNESS * size, max(levels) + 1.1 * THICKNESS * size
        center = [*symbol.points[k], 0.5 * (low + high)]
        yield symbol.bodies[k], cylinder(PIN * size, high - low, center=center), DARK


def _planar_slide(motion: Motion, symbol: Symbol, layer: Mapping[str, float], size: float) -> Pieces:
    """Yield a rail on the first body, as long as the travel, and the block of a prismatic joint."""
    first, second = symbol.bodies[:2]
    middle, length = _rail(motion, symbol, 0.06 * size)
    thickness = THICKNESS * size
    depth = layer[first] - (0.6 if first == GROUND else -0.2) * thickness
    yield first, box([length, 0.022 * size, 0.3 * thickness], [*middle, depth], _turned_to(symbol.axis_on(0))), GRAY
    if symbol.kind == "prismatic":
        center = [*symbol.points[1], layer[second] + 0.2 * thickness]
        yield second, box([0.085 * size, 0.05 * size, 0.9 * thickness], center, _turned_to(symbol.axis_on(1))), DARK


def _groove(motion: Motion, symbol: Symbol, size: float, level: float = 0.0) -> Pieces:
    """Yield the curve or the lines of a surface on the first body, at the level of its layer if it is planar."""
    poses, body = frames(motion), symbol.bodies[0]
    visited = within(poses[body], points_at(poses[symbol.bodies[1]], symbol.points[1]))
    radius = (0.5 if symbol.kind == "curve" else 0.15) * BAR * size
    for line in shown(symbol.curve, visited, 0.1 * size):
        high = np.full((len(line), 1), level + 0.4 * THICKNESS * size)
        yield body, tube(np.concatenate([line, high], axis=1)[:, :3] if line.shape[1] == 2 else line, radius), GRAY


def _disc_cam(motion: Motion, symbol: Symbol, layer: Mapping[str, float], size: float, color: Color) -> Pieces:
    """Yield a roller at the point of a follower, and, for a motion of a whole turn, the plate cam."""
    (disc, follower), radius = symbol.bodies, 2.0 * PIN * size
    low, high = layer[disc], layer[disc] + 0.8 * THICKNESS * size
    center = [*symbol.points[1], 0.5 * (low + high)]
    yield follower, cylinder(radius, high - low, center=center), DARK
    poses = frames(motion)
    pitch, is_whole = pitch_curve(within(poses[disc], points_at(poses[follower], symbol.points[1])))
    if is_whole:
        profile = Polygon(pitch).buffer(-radius)
        if isinstance(profile, Polygon) and not profile.is_empty:
            yield disc, extruded(profile, low, high), color


def _turned_to(axis: Point) -> Float[np.ndarray, "3 3"]:
    """Return the rotation about z from x to an axis in the plane."""
    x, y = axis / np.linalg.norm(axis)
    return np.array([[x, -y, 0], [y, x, 0], [0, 0, 1.0]])


def _rail(motion: Motion, symbol: Symbol, margin: float) -> tuple[Point, float]:
    """Return the middle and the length of the line on the first body along which the second travels, m."""
    poses, axis = frames(motion), symbol.axis_on(0) / np.linalg.norm(symbol.axis_on(0))
    point = points_at(poses[symbol.bodies[1]], symbol.points[1])
    travel = (within(poses[symbol.bodies[0]], point) - symbol.points[0]) @ axis
    low, high = float(np.nanmin(travel)), float(np.nanmax(travel))
    return symbol.points[0] + axis * 0.5 * (low + high), high - low + 2 * margin


def spatial_meshes(motion: Motion, skeleton: Skeleton, colors: Mapping[str, Color]) -> Pieces:
    """Yield the meshes of spatial bodies, with hinges, balls, crosses, slides and screws."""
    radius = BAR * skeleton.size
    for body, link in skeleton.links.items():
        if body == GROUND:
            for point, names in zip(link.points, link.names, strict=True):
                if names:
                    yield body, sphere(1.3 * radius, point), DARK
        elif link.edges:
            bars = [capsule(link.points[i], link.points[j], radius) for i, j in link.edges]
            yield body, merged(bars), colors[body]
        else:
            yield body, sphere(1.8 * radius, link.points[0]), colors[body]
    for symbol in skeleton.symbols:
        if symbol.kind in ("prismatic", "cylindrical", "screw"):
            yield from _spatial_slide(motion, symbol, skeleton.size)
        elif symbol.kind in ("curve", "surface"):
            yield from _groove(motion, symbol, skeleton.size)
            yield symbol.bodies[1], sphere(1.3 * radius, symbol.points[1]), DARK
        elif symbol.kind == "rope":
            for body, point in zip(symbol.bodies, symbol.points, strict=True):
                yield body, sphere(1.1 * radius, point), DARK
        elif symbol.kind in ("gear", "wheel", "rolling"):
            yield from _shaft_wheels(symbol, skeleton.size, colors)
            yield from _rack(motion, symbol, skeleton.size, colors)
        else:
            yield from _spatial_joint(symbol, skeleton.size)


def _spatial_joint(symbol: Symbol, size: float) -> Pieces:
    first, second, radius = symbol.bodies[0], symbol.bodies[-1], BAR * size
    points, kind = symbol.points, symbol.kind
    if kind == "revolute":
        yield first, cylinder(1.75 * radius, 0.085 * size, symbol.axis_on(0), points[0]), DARK
        yield second, cylinder(0.9 * radius, 0.11 * size, symbol.axis_on(1), points[1]), GRAY
    elif kind in ("spherical", "rod"):
        yield second, sphere(1.9 * radius, points[1]), DARK
        if kind == "rod":
            yield first, sphere(1.9 * radius, points[0]), DARK
    elif kind == "universal":
        yield first, cylinder(0.75 * radius, 0.1 * size, symbol.axis_on(0), points[0]), DARK
        yield second, cylinder(0.75 * radius, 0.1 * size, symbol.axis_on(1), points[1]), DARK
        yield second, sphere(1.3 * radius, points[1]), GRAY
    elif kind == "plane":
        yield second, sphere(1.3 * radius, points[1]), DARK


def _shaft_wheels(symbol: Symbol, size: float, colors: Mapping[str, Color]) -> Pieces:
    """Yield the wheels of two shafts, or a rolling wheel, with marks that show their rotation."""
    for slot, (body, radius) in enumerate(zip(symbol.bodies[:2], symbol.radii, strict=False)):
        if radius is None or body == GROUND:
            continue
        axis, center, thickness = symbol.axis_on(slot), symbol.points[slot], 1.4 * BAR * size
        yield body, cylinder(radius, thickness, axis, center), colors[body]
        mark = rotation_to(axis) @ np.array([0.5 * radius, 0.0, 0.0])
        yield body, box([0.9 * radius, 0.1 * radius, 1.1 * thickness], center + mark, rotation_to(axis)), DARK


def _rack(motion: Motion, symbol: Symbol, size: float, colors: Mapping[str, Color]) -> Pieces:
    """Yield the rack on the first body along which a pinion rolls, as long as its travel; nothing for wheels."""
    if symbol.kind != "rolling":
        return
    body, thickness = symbol.bodies[0], 0.7 * BAR * size
    middle, length = _rail(motion, symbol, 0.08 * size)
    color = GRAY if body == GROUND else colors[body]
    yield body, box([1.6 * thickness, 1.6 * thickness, length], middle, rotation_to(symbol.axis_on(0))), color


def _spatial_slide(motion: Motion, symbol: Symbol, size: float) -> Pieces:
    """Yield a rail on the first body, as long as the travel of the second, and the sliding part."""
    first, second = symbol.bodies[:2]
    middle, length = _rail(motion, symbol, 0.08 * size)
    axis, other, thickness = symbol.axis_on(0), symbol.axis_on(1), 0.7 * BAR * size
    if symbol.kind == "prismatic":
        yield first, box([1.6 * thickness, 1.6 * thickness, length], middle, rotation_to(axis)), GRAY
        yield second, box([0.05 * size, 0.05 * size, 0.09 * size], symbol.points[1], rotation_to(other)), DARK
        return
    yield first, cylinder(thickness, length, axis, middle), GRAY
    if symbol.kind == "screw":
        fractions = np.linspace(0.0, 1.0, THREADS * 16)
        angle = 2 * np.pi * THREADS * fractions
        helix = np.stack([thickness * np.cos(angle), thickness * np.sin(angle), (fractions - 0.5) * length], axis=1)
        yield first, tube(helix @ rotation_to(axis).T + middle, 0.35 * thickness), GRAY
    yield second, sleeve(0.85 * BAR * size, 1.7 * BAR * size, 0.08 * size, other, symbol.points[1]), DARK
