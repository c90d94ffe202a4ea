"""Simple solids as triangles: bars, plates, cylinders, spheres, boxes, gears, springs and arrows."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

__all__ = [
    "DARK",
    "GREY",
    "Solid",
    "annulus",
    "arc_arrow",
    "bar",
    "box",
    "coil",
    "cylinder",
    "gear",
    "merged",
    "plate",
    "prism",
    "revolved",
    "sphere",
    "turned_to",
]

DARK, GREY = (70, 74, 82), (150, 155, 163)  # colours of what belongs to no body
AROUND = 24  # corners of a circle

Mesh = tuple[np.ndarray, np.ndarray]


@dataclasses.dataclass(frozen=True, eq=False)
class Solid:
    """A coloured surface of triangles, in the frame of a body.

    Parameters
    ----------
    vertices : array of shape (vertices, 3)
        m.
    faces : array of int, shape (faces, 3)
    colour : tuple of int
        Red, green and blue, from 0 to 255.
    opacity : float, default 1
    """

    vertices: np.ndarray
    faces: np.ndarray
    colour: tuple[int, int, int]
    opacity: float = 1.0


def merged(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + first for (_, faces), first in zip(meshes, counts[:-1], strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def turned_to(axis: Any) -> np.ndarray:
    """Return a rotation matrix whose third column is an axis of any length.

    Examples
    --------
    >>> turned_to([2.0, 0.0, 0.0])[:, 2].tolist()
    [1.0, 0.0, 0.0]
    """
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    side = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis], axis=1)


def _placed(vertices: np.ndarray, axis: Any, center: Any) -> np.ndarray:
    return vertices @ turned_to(axis).T + np.asarray(center, float)


def revolved(
    profile: Sequence[tuple[float, float]], axis: Any = (0, 0, 1), center: Any = (0, 0, 0), smooth: bool = False
) -> Mesh:
    """Return the solid that a profile of radii and heights sweeps around an axis, with sharp edges or none.

    The profile starts and ends on the axis, or closes in itself.
    """
    angle = np.arange(AROUND) * (2 * np.pi / AROUND)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    pairs = list(pairwise(profile))
    levels = list(profile) if smooth else [end for pair in pairs for end in pair]
    vertices = np.concatenate([np.column_stack([ring * r, np.full(AROUND, z)]) for r, z in levels])
    start = np.arange(AROUND)
    after = (start + 1) % AROUND
    faces = []
    for k, ((r, _), (s, _)) in enumerate(pairs):
        first = AROUND * (k if smooth else 2 * k)
        a, b, c, d = first + start, first + after, first + AROUND + after, first + AROUND + start
        if s > 0:
            faces.append(np.stack([a, c, d], axis=1))
        if r > 0:
            faces.append(np.stack([a, b, c if s > 0 else d], axis=1))
    return _placed(vertices, axis, center), np.concatenate(faces)


def cylinder(radius: float, length: float, axis: Any = (0, 0, 1), center: Any = (0, 0, 0)) -> Mesh:
    """Return a cylinder about an axis, its middle in a centre."""
    half = 0.5 * length
    return revolved([(0.0, -half), (radius, -half), (radius, half), (0.0, half)], axis, center)


def sphere(radius: float, center: Any = (0, 0, 0)) -> Mesh:
    """Return a sphere."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
    profile = [(radius * float(np.cos(a)), radius * float(np.sin(a))) for a in angle]
    profile[0], profile[-1] = (0.0, -radius), (0.0, radius)
    return revolved(profile, center=center, smooth=True)


def bar(start: Any, end: Any, radius: float) -> Mesh:
    """Return a round bar between two points, with round ends."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(end - start))
    if length == 0:
        return sphere(radius, start)
    round_ = [(radius * float(np.cos(a)), radius * float(np.sin(a))) for a in np.linspace(-0.5 * np.pi, 0, 5)]
    round_[0] = (0.0, -radius)
    profile = [*round_, *((r, length - z) for r, z in reversed(round_))]
    return revolved(profile, end - start, start, smooth=True)


def prism(outline: np.ndarray, low: float, high: float, sharp: bool = True) -> Mesh:
    """Return a star-shaped polygon, corners in counterclockwise order, (n, 2), drawn out along z.

    Its walls meet in sharp edges, or seem to be round.
    """
    count = len(outline)
    around = np.arange(count)
    after = (around + 1) % count
    middle = np.vstack([outline, outline.mean(axis=0)])
    vertices = [np.column_stack([middle, np.full(count + 1, z)]) for z in (low, high)]
    top, wall = count + 1, 2 * (count + 1)
    faces = [
        np.stack([after, around, np.full(count, count)], axis=1),
        np.stack([top + around, top + after, np.full(count, top + count)], axis=1),
    ]
    first, second = outline, outline[after]
    corners = (first, second, second, first) if sharp else (first, first)
    heights = (low, low, high, high) if sharp else (low, high)
    vertices += [np.column_stack([c, np.full(count, z)]) for c, z in zip(corners, heights, strict=True)]
    if sharp:
        a, b, c, d = (wall + count * k + around for k in range(4))
    else:
        a, b, c, d = wall + around, wall + after, wall + count + after, wall + count + around
    faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    return np.concatenate(vertices), np.concatenate(faces)


def plate(points: np.ndarray, radius: float, low: float, high: float) -> Mesh:
    """Return the flat plate of the convex outline of some points in the plane, (n, 2), rounded with a radius."""
    from scipy.spatial import ConvexHull

    angle = np.arange(AROUND) * (2 * np.pi / AROUND)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    every = (np.asarray(points, float)[:, None] + circle).reshape(-1, 2)
    return prism(every[ConvexHull(every).vertices], low, high, sharp=False)


def box(size: Any, center: Any = (0, 0, 0), rotation: Any = None) -> Mesh:
    """Return a box of three edges about a centre."""
    x, y, z = 0.5 * np.asarray(size, float)
    vertices, faces = prism(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), -z, z)
    rotation = np.eye(3) if rotation is None else np.asarray(rotation, float)
    return vertices @ rotation.T + np.asarray(center, float), faces


def gear(radius: float, low: float, high: float, center: Any = (0, 0), module: float = 0.0) -> Mesh:
    """Return a wheel of a pitch radius with teeth of a module; smooth where that is zero."""
    vertices, faces = prism(_toothed(radius, module), low, high)
    return vertices + np.append(np.asarray(center, float)[:2], 0.0), faces


def annulus(radius: float, outside: float, low: float, high: float, center: Any = (0, 0), module: float = 0.0) -> Mesh:
    """Return a ring between two radii with teeth of a module inside; smooth where that is zero."""
    inner = _toothed(radius, -module)
    outer = outside * inner / np.linalg.norm(inner, axis=1, keepdims=True)
    count, around = len(inner), np.arange(len(inner))
    after = (around + 1) % count
    faces = []
    walls = ((outer, low, outer, high), (inner, high, inner, low), (outer, high, inner, high), (inner, low, outer, low))
    vertices = [np.column_stack([line, np.full(count, z)]) for a, y, b, z in walls for line, z in ((a, y), (b, z))]
    for k in range(len(walls)):
        a, b = 2 * count * k + around, 2 * count * k + after
        faces += [np.stack([a, b, b + count], axis=1), np.stack([a, b + count, a + count], axis=1)]
    shift = np.append(np.asarray(center, float)[:2], 0.0)
    return np.concatenate(vertices) + shift, np.concatenate(faces)


def _toothed(radius: float, module: float) -> np.ndarray:
    """Return the outline of a wheel, (n, 2), with teeth outward, inward where the module is negative."""
    if module == 0:
        teeth, corners = 2 * AROUND, np.zeros(1)
    else:
        teeth, corners = max(8, round(2 * radius / abs(module))), module * np.array([-0.55, -0.55, 0.45, 0.45])
    steps = np.arange(teeth * len(corners)) / len(corners)
    angle = 2 * np.pi / teeth * (steps + 0.1 * np.tile((np.arange(len(corners)) % 2) * 2.0 - 1.0, teeth))
    reach = radius + np.tile(corners, teeth)
    return np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=1)


def coil(turns: int, radius: float, wire: float) -> Mesh:
    """Return a spring of length one along z, to be stretched; its wire is drawn as thick as it can be afterwards."""
    height = np.linspace(0.0, 1.0, 16 * turns + 1)
    around = np.clip((height - 0.1) / 0.8, 0, 1) * 2 * np.pi * turns
    reach = radius * np.clip(np.minimum(height, 1 - height) / 0.1, 0, 1)
    line = np.stack([reach * np.cos(around), reach * np.sin(around), height], axis=1)
    return tube(line, wire)


def tube(line: np.ndarray, radius: float) -> Mesh:
    """Return a tube of six sides along a line, (n, 3)."""
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [0.3, 0.2, 0.9])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(along, side)
    angle = np.arange(6) * (np.pi / 3)
    ring = np.cos(angle)[None, :, None] * side[:, None] + np.sin(angle)[None, :, None] * other[:, None]
    vertices = (line[:, None] + radius * ring).reshape(-1, 3)
    first = 6 * np.arange(len(line) - 1)[:, None]
    a, b = first + np.arange(6), first + (np.arange(6) + 1) % 6
    faces = np.concatenate([np.stack([a, b, b + 6], axis=-1), np.stack([a, b + 6, a + 6], axis=-1)])
    return vertices, faces.reshape(-1, 3)


def arc_arrow() -> Mesh:
    """Return an arrow around z, counterclockwise, on a circle of radius one: the sign of a torque."""
    angle = np.linspace(0.0, 1.45 * np.pi, 40)
    line = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    end = np.array([np.cos(angle[-1]), np.sin(angle[-1]), 0.0])
    ahead = np.array([-end[1], end[0], 0.0])
    head = revolved([(0.0, 0.0), (0.22, 0.0), (0.0, 0.55)], ahead, end - 0.05 * ahead)
    return merged([tube(line, 0.08), head])
