"""Shapes of robots: those of the file (URDF, MJCF), or bars from joint to joint where it has none."""

from __future__ import annotations

import dataclasses
import importlib
import warnings
from collections.abc import Iterable, Iterator
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from trimesh import Trimesh

from jounce.errors import RobotFileError
from jounce.io.robots.mjcf import names_of_bodies
from jounce.io.robots.mjcf_files import check_assets, included, quiet_mujoco
from jounce.io.robots.xml_elements import Element, read_markup
from jounce.robot.mechanism_parts import on_body
from jounce.robot.robot import Robot
from jounce.viewer.appearance import BODY_COLOURS, DARK, GREY, Appearance, BodyPoint, ColouredMesh, upward
from jounce.viewer.mesh_files import MeshFiles, Rgba
from jounce.viewer.meshes import box, capsule, cylinder, merged, placed, rotation_to, sphere

__all__ = ["file_shapes", "robot_appearance"]

PLAIN = (190, 195, 202)
Vector = Float[np.ndarray, "3"]
Rotation = Float[np.ndarray, "3 3"]
Shapes = dict[str, list[ColouredMesh]]  # by link, in its frame


def robot_appearance(robot: Robot, path: Path | None = None, allow: Iterable[str | PathLike[str]] = ()) -> Appearance:
    """Return what a robot looks like.

    Parameters
    ----------
    robot : Robot
    path : Path, optional
        Its file; shapes in it are shown, and bars in the place of those that cannot be read.
    allow
        Folders besides that of the file that meshes may be below.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.viewer.robot_appearance import robot_appearance
    >>> robot = jn.load_robot("examples/robots/scara.urdf")
    >>> found = robot_appearance(robot)
    >>> all(found.meshes[link] for link in robot.moving_links)
    True
    """
    links = (robot.base, *robot.moving_links)
    size = _size(robot)
    found: Shapes = {link: [] for link in links}
    for link, shapes in (file_shapes(path, allow) if path is not None else {}).items():
        if link in robot.frames:
            body, position, rotation = _body_of(robot, link)
            found[body] += [dataclasses.replace(each, mesh=placed(each.mesh, position, rotation)) for each in shapes]
    bars = _bars(robot, size)
    bare = not any(found.values())
    for link in links:  # a base without shapes stands on nothing, as in its file, unless all is bars
        if not found[link] and (bare or link != robot.base):
            found[link] = bars[link]
    return Appearance(found, (), list(_points(robot)), size, upward(robot.gravity))


def _body_of(robot: Robot, link: str) -> tuple[str, Vector, Rotation]:
    """Return the moving link that a link is part of, or the base, and its pose there."""
    if robot.frames[link].body < 0:
        base, frame = robot.frames[robot.base], robot.frames[link]
        return robot.base, base.rotation.T @ (frame.position - base.position), base.rotation.T @ frame.rotation
    return on_body(robot, link)


def _size(robot: Robot) -> float:
    """Return the reach of the longest branch, m."""
    reach = {robot.base: 0.0}
    for joint in robot.joints.values():
        reach[joint.child] = reach[joint.parent] + float(np.linalg.norm(joint.position))
    return max(reach.values()) or 1.0


def _ends(robot: Robot) -> dict[str, list[Vector]]:
    """Return for each body the points where other things are: the next joints, closures, frames fixed to it."""
    ends: dict[str, list[Vector]] = {link: [] for link in (robot.base, *robot.moving_links)}
    touched = [(joint.parent, joint.position) for joint in robot.joints.values()]
    for closure in robot.closures.values():
        touched += zip(closure.links, closure.points, strict=True)
    for link, point in touched:
        body, position, rotation = _body_of(robot, link)
        ends[body].append(position + rotation @ point)
    for link in robot.moving_links:  # the last of a branch ends in its centre of mass
        inertia = robot.links[link].inertia
        if not any(np.linalg.norm(end) > 1e-6 for end in ends[link]) and inertia is not None:
            ends[link].append(2.0 * np.asarray(inertia.center_of_mass))
    return ends


def _bars(robot: Robot, size: float) -> Shapes:
    """Return bars from each joint to the next, and the joints as cylinders and boxes."""
    thin = 0.016 * size
    colours = {link: BODY_COLOURS[k % len(BODY_COLOURS)] for k, link in enumerate(robot.moving_links)}
    colours[robot.base] = DARK
    found: Shapes = {}
    for body, ends in _ends(robot).items():
        bars = [capsule(np.zeros(3), end, thin) for end in ends if np.linalg.norm(end) > 1e-3 * size]
        found[body] = [ColouredMesh(merged(bars), colours[body])] if bars else []
        if body == robot.base:
            found[body].append(ColouredMesh(cylinder(0.06 * size, 0.02 * size, upward(robot.gravity)), DARK))
        elif not bars:
            found[body].append(ColouredMesh(sphere(1.4 * thin), colours[body]))
    for joint in robot.joints.values():
        if joint.moving and joint.turning:
            found[joint.child].append(ColouredMesh(cylinder(1.35 * thin, 4.2 * thin, joint.axis), DARK))
        elif joint.moving:
            block = box([3 * thin, 3 * thin, 5 * thin], rotation=rotation_to(joint.axis))
            found[joint.child].append(ColouredMesh(block, DARK))
            found[joint.child].append(ColouredMesh(cylinder(0.6 * thin, 10 * thin, joint.axis), GREY))
    return found


def _points(robot: Robot) -> Iterator[BodyPoint]:
    """Give the tips of the branches, then all other links, as points."""
    parents = {joint.parent for joint in robot.joints.values()}
    moving = [link for link in robot.links if robot.frames[link].body >= 0]
    tips = [link for link in moving if link not in parents]
    for link in [*reversed(tips), *(link for link in moving if link in parents)]:
        body, position, _ = _body_of(robot, link)
        yield BodyPoint(body, tuple(position.tolist()), link)


def file_shapes(path: Path, allow: Iterable[str | PathLike[str]] = ()) -> Shapes:
    """Return the shapes of a robot file by link, in its frame; none where they cannot be read.

    Parameters
    ----------
    path : Path
        URDF or MJCF.
    allow
        Folders besides that of the file that meshes may be below; a warning tells of those that lie elsewhere.
    """
    root = read_markup(str(path))
    return _of_urdf(root, MeshFiles(path, allow)) if root.tag == "robot" else _of_mjcf(root, path, allow)


def _of_urdf(root: Element, files: MeshFiles) -> Shapes:
    """Return what the elements ``<visual>`` show."""
    materials = {}
    for material in root.every("material"):
        with suppress(ValueError):
            materials[material.attributes.get("name", "")] = _rgba(material)
    found: Shapes = {}
    for link in root.every("link"):
        meshes = found.setdefault(link.attributes["name"], [])
        for visual in link.every("visual"):
            with suppress(KeyError, ValueError):  # words where numbers should be: a bar is shown instead
                meshes += _visual(visual, materials, files)
    return found


def _visual(visual: Element, materials: dict[str, Rgba | None], files: MeshFiles) -> list[ColouredMesh]:
    geometry = visual.first("geometry")
    shape = geometry.children[0] if geometry is not None and geometry.children else None
    if shape is None:
        return []
    own = visual.first("material")
    rgba = None if own is None else _rgba(own) or materials.get(own.attributes.get("name", ""))
    position, rotation = _origin(visual.first("origin"))
    return [_coloured(placed(mesh, position, rotation), rgba or colour) for mesh, colour in _urdf_shape(shape, files)]


def _rgba(material: Element) -> Rgba | None:
    colour = material.first("color")
    return None if colour is None else tuple(_numbers(colour.attributes.get("rgba", ""))) or None


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def _coloured(mesh: Trimesh, rgba: Rgba | None) -> ColouredMesh:
    if rgba is None or len(rgba) < 3:
        return ColouredMesh(mesh, PLAIN)
    red, green, blue = (round(255 * float(np.clip(c, 0, 1))) for c in rgba[:3])
    return ColouredMesh(mesh, (red, green, blue), float(rgba[3]) if len(rgba) > 3 else 1.0)


def _origin(element: Element | None) -> tuple[list[float], Rotation]:
    from scipy.spatial.transform import Rotation as Attitude

    given = {} if element is None else element.attributes
    angles = _numbers(given.get("rpy", "0 0 0"))
    return _numbers(given.get("xyz", "0 0 0")), Attitude.from_euler("xyz", angles).as_matrix()


def _urdf_shape(shape: Element, files: MeshFiles) -> list[tuple[Trimesh, Rgba | None]]:
    """Return the meshes of a shape of a URDF, with a colour where a mesh brings its own."""
    given, kind = shape.attributes, shape.tag
    if kind == "mesh":
        scale = _numbers(given.get("scale", "1 1 1"))
        return [(mesh.apply_scale(scale), colour) for mesh, colour in files.read(given.get("filename", ""))]
    if kind == "box":
        return [(box(_numbers(given["size"])), None)]
    if kind == "sphere":
        return [(sphere(float(given["radius"])), None)]
    if kind not in ("cylinder", "capsule"):
        return []
    radius, length = float(given["radius"]), float(given["length"])
    return [(cylinder(radius, length) if kind == "cylinder" else _upright(radius, length), None)]


def _upright(radius: float, length: float) -> Trimesh:
    return capsule([0, 0, -0.5 * length], [0, 0, 0.5 * length], radius)


def _of_mjcf(root: Element, path: Path, allow: Iterable[str | PathLike[str]]) -> Shapes:
    """Return the geoms that MuJoCo shows: groups 0 to 2."""
    mujoco: Any = importlib.import_module("mujoco")
    if not any(element.tag == "geom" for element in root.walk()):
        return {}
    try:
        parts = [root, *included(root, allow)]
        with quiet_mujoco(mujoco):
            spec = mujoco.MjSpec.from_file(str(path))
            check_assets(spec, parts, allow)
            spec.compiler.fusestatic = False
            model = spec.compile()
    except RobotFileError as error:
        warnings.warn(f"the shapes are not shown: {error}", stacklevel=2)
        return {}
    except (ValueError, RuntimeError, OSError):  # a mesh is missing: the robot itself could be read without
        return {}
    names, found = names_of_bodies(model), {}
    for k in range(model.ngeom):
        mesh = _geom(model, k, mujoco) if model.geom_group[k] <= 2 else None
        if mesh is not None:
            rotation = np.zeros(9)
            mujoco.mju_quat2Mat(rotation, model.geom_quat[k])
            material = model.geom_matid[k]
            rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[k]
            coloured = _coloured(placed(mesh, model.geom_pos[k], rotation.reshape(3, 3)), tuple(rgba.tolist()))
            found.setdefault(names[model.geom_bodyid[k]], []).append(coloured)
    return found


def _geom(model: Any, k: int, mujoco: Any) -> Trimesh | None:
    """Return the mesh of a geom; none for planes and height fields."""
    kinds, kind, size = mujoco.mjtGeom, int(model.geom_type[k]), model.geom_size[k]
    if kind == int(kinds.mjGEOM_SPHERE):
        return sphere(float(size[0]))
    if kind == int(kinds.mjGEOM_CAPSULE):
        return _upright(float(size[0]), 2 * float(size[1]))
    if kind == int(kinds.mjGEOM_CYLINDER):
        return cylinder(float(size[0]), 2 * float(size[1]))
    if kind == int(kinds.mjGEOM_BOX):
        return box(2 * size)
    if kind == int(kinds.mjGEOM_ELLIPSOID):
        return sphere(1.0).apply_scale(size)
    if kind == int(kinds.mjGEOM_MESH):
        which = int(model.geom_dataid[k])
        first, count = int(model.mesh_vertadr[which]), int(model.mesh_vertnum[which])
        begin, number = int(model.mesh_faceadr[which]), int(model.mesh_facenum[which])
        vertices, faces = model.mesh_vert[first : first + count], model.mesh_face[begin : begin + number]
        return Trimesh(np.array(vertices), np.array(faces), process=False)
    return None
