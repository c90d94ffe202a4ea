"""Meshes of simple solids: primitives of trimesh in given poses, with sharp edges.

Faces that share a vertex look smooth, so that faces at a sharp edge have separate vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import shapely
import trimesh
from jaxtyping import Float
from shapely.geometry import MultiPoint, Polygon
from trimesh import Trimesh, creation

from jounce.plot.drawings.frames import frame_along
from jounce.viewer.shapes.appearance import Position

AROUND = 24  # corners of a circle
Z, ORIGIN = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
Vector = Float[np.ndarray, "3"]
Rotation = Float[np.ndarray, "3 3"]
FlatPoints = Float[np.ndarray, "points 2"]


def rotation_to(axis: Position) -> Rotation:
    """Return a rotation matrix whose third column is along an axis of any length.

    Examples
    --------
    >>> rotation_to([2.0, 0.0, 0.0])[:, 2].tolist()
    [1.0, 0.0, 0.0]
    """
    return frame_along(np.asarray(axis, float))[[1, 2, 0]].T


def transformed(mesh: Trimesh, center: Position = ORIGIN, rotation: Rotation | None = None) -> Trimesh:
    """Return a mesh after a rotation and a translation."""
    rotated = mesh.vertices if rotation is None else mesh.vertices @ rotation.T
    return Trimesh(rotated + np.asarray(center), mesh.faces, process=False)


def merged(meshes: Sequence[Trimesh]) -> Trimesh:
    """Return the union of several meshes as one."""
    vertices, faces = trimesh.util.append_faces([mesh.vertices for mesh in meshes], [mesh.faces for mesh in meshes])
    return Trimesh(vertices, faces, process=False)


def cylinder(radius: float, length: float, axis: Position = Z, center: Position = ORIGIN) -> Trimesh:
    """Return a cylinder with an axis and a center."""
    return transformed(_unit_cylinder(), center, rotation_to(axis) * (radius, radius, length))


@cache
def _unit_cylinder() -> Trimesh:
    return _round_walls(creation.cylinder(1.0, 1.0, sections=AROUND))


def sleeve(inside: float, outside: float, length: float, axis: Position = Z, center: Position = ORIGIN) -> Trimesh:
    """Return a hollow cylinder with an axis and a center."""
    ring = creation.annulus(inside, outside, length, sections=AROUND)
    return transformed(_round_walls(ring), center, rotation_to(axis))


def _round_walls(mesh: Trimesh) -> Trimesh:
    """Return a mesh whose caps, perpendicular to z, share no vertices with its walls."""
    caps, count = np.abs(mesh.face_normals[:, 2]) > 0.5, len(mesh.vertices)
    faces = np.concatenate([mesh.faces[caps], mesh.faces[~caps] + count])
    return Trimesh(np.tile(mesh.vertices, (2, 1)), faces, process=False)


def _flat_walls(mesh: Trimesh) -> Trimesh:
    """Return a mesh whose faces share no vertices."""
    mesh.unmerge_vertices()
    return mesh


def sphere(radius: float, center: Position = ORIGIN) -> Trimesh:
    """Return a sphere."""
    return transformed(_unit_sphere(), center, radius * np.eye(3))


@cache
def _unit_sphere() -> Trimesh:
    return creation.uv_sphere(1.0, count=(AROUND // 2, AROUND))


def capsule(start: Position, end: Position, radius: float) -> Trimesh:
    """Return a round bar with round ends between two points."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(end - start))
    if length == 0:
        return sphere(radius, start)
    bar = creation.capsule(length, radius, count=(AROUND // 2, AROUND))
    return transformed(bar, 0.5 * (start + end), rotation_to(end - start))


def box(size: Position, center: Position = ORIGIN, rotation: Rotation | None = None) -> Trimesh:
    """Return a box with three edge lengths about a center."""
    return _flat_walls(transformed(creation.box(np.asarray(size, float)), center, rotation))


def extruded(outline: Polygon, low: float, high: float, *, sharp: bool = True) -> Trimesh:
    """Return a plane shape extruded along z, with walls that meet in sharp edges or look smooth."""
    mesh = transformed(creation.extrude_polygon(outline, high - low), (0.0, 0.0, low))
    return _flat_walls(mesh) if sharp else _round_walls(mesh)


def plate(points: FlatPoints, radius: float, low: float, high: float) -> Trimesh:
    """Return a plate with the convex hull of points in the plane as outline, rounded with a radius."""
    outline = MultiPoint(points).convex_hull.buffer(radius, quad_segs=AROUND // 4)
    return extruded(outline, low, high, sharp=False)


def wheel(
    radius: float, low: float, high: float, center: Position, *, module: float = 0.0, outside: float = 0.0
) -> Trimesh:
    """Return a wheel with a pitch radius and teeth of a module (zero: smooth), a ring if `outside` is given."""
    middle = np.asarray(center, float)
    outline = _toothed(radius, -module if outside else module) + middle
    polygon = Polygon(_toothed(outside, 0.0) + middle, [outline]) if outside else Polygon(outline)
    return extruded(polygon, low, high)


def _toothed(radius: float, module: float) -> FlatPoints:
    """Return the outline of a wheel with external teeth, or internal teeth for a negative module."""
    if module == 0:
        teeth, corners = 4 * AROUND, np.zeros(1)
    else:
        teeth, corners = max(8, round(2 * radius / abs(module))), module * np.array([-0.55, -0.55, 0.45, 0.45])
    steps = np.arange(teeth * len(corners)) / len(corners)
    angle = 2 * np.pi / teeth * (steps + 0.1 * np.tile((np.arange(len(corners)) % 2) * 2.0 - 1.0, teeth))
    radii = radius + np.tile(corners, teeth)
    return np.stack([radii * np.cos(angle), radii * np.sin(angle)], axis=1)


def tube(line: Float[np.ndarray, "points 3"], radius: float) -> Trimesh:
    """Return a tube along a line."""
    return creation.sweep_polygon(shapely.Point(0, 0).buffer(radius, quad_segs=2), line)


def coil(turns: int, radius: float, wire: float) -> Trimesh:
    """Return a coil spring of length one along z, to be stretched, with a thickness of its wire."""
    height = np.linspace(0.0, 1.0, 16 * turns + 1)
    angles = np.clip((height - 0.1) / 0.8, 0, 1) * 2 * np.pi * turns
    radii = radius * np.clip(np.minimum(height, 1 - height) / 0.1, 0, 1)
    return tube(np.stack([radii * np.cos(angles), radii * np.sin(angles), height], axis=1), wire)


def arc_arrow() -> Trimesh:
    """Return a counterclockwise arrow around z on a circle of radius one: the symbol of a torque."""
    angle = np.linspace(0.0, 1.45 * np.pi, 40)
    line = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    normal = np.array([-line[-1, 1], line[-1, 0], 0.0])
    head = creation.cone(0.22, 0.55, sections=AROUND)
    return merged([tube(line, 0.08), transformed(_flat_walls(head), line[-1] - 0.05 * normal, rotation_to(normal))])
