"""Shapes of robots: those of the file (URDF, MJCF), or bars from joint to joint where it has none."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from jounce.errors import RobotFileError
from jounce.robot.mechanism_parts import on_body
from jounce.robot.robot import Robot
from jounce.viewer.looks import BODIES, Looks, up_of
from jounce.viewer.meshes import Meshes
from jounce.viewer.solids import DARK, GREY, Solid, bar, box, cylinder, merged, sphere, turned_to
from jounce.viewer.take import Spot

__all__ = ["file_shapes", "robot_looks"]

PLAIN = (190, 195, 202)


def robot_looks(robot: Robot, path: Path | None = None, allow: Iterable[str | PathLike[str]] = ()) -> Looks:
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
    >>> from jounce.viewer.visuals import robot_looks
    >>> looks = robot_looks(jn.load_robot("examples/robots/scara.urdf"))
    >>> all(looks.solids[link] for link in jn.load_robot("examples/robots/scara.urdf").moving_links)
    True
    """
    links = (robot.base, *robot.moving_links)
    size = _size(robot)
    colours = {link: BODIES[k % len(BODIES)] for k, link in enumerate(robot.moving_links)} | {robot.base: DARK}
    shapes = file_shapes(path, allow) if path is not None else {}
    found: dict[str, list[Solid]] = {link: [] for link in links}
    for link, solids in shapes.items():
        if link in robot.frames:
            body, position, rotation = _body_of(robot, link)
            found[body] += [Solid(s.vertices @ rotation.T + position, s.faces, s.colour, s.opacity) for s in solids]
    bars = _bars(robot, size, colours)
    bare = not any(found.values())
    for link in links:  # a base without shapes stands on nothing, as in its file, unless all is bars
        if not found[link] and (bare or link != robot.base):
            found[link] = bars[link]
    return Looks(
        solids={link: tuple(solids) for link, solids in found.items()},
        stretches=(),
        spots=_spots(robot),
        size=size,
        up=up_of(robot.gravity),
        colours=colours,
    )


def _body_of(robot: Robot, link: str) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the moving link that a link is part of, or the base, and its pose there."""
    if robot.frames[link].body < 0:
        base = robot.frames[robot.base]
        turned = base.rotation.T
        frame = robot.frames[link]
        return robot.base, turned @ (frame.position - base.position), turned @ frame.rotation
    return on_body(robot, link)


def _size(robot: Robot) -> float:
    """Return the reach of the longest branch, m."""
    reach = {robot.base: 0.0}
    for joint in robot.joints.values():
        reach[joint.child] = reach[joint.parent] + float(np.linalg.norm(joint.position))
    return max(reach.values()) or 1.0


def _ends(robot: Robot) -> dict[str, list[np.ndarray]]:
    """Return for each body the points where other things are: the next joints, closures, frames fixed to it."""
    ends: dict[str, list[np.ndarray]] = {link: [] for link in (robot.base, *robot.moving_links)}
    for joint in robot.joints.values():
        body, position, rotation = _body_of(robot, joint.parent)
        ends[body].append(position + rotation @ joint.position)
    for closure in robot.closures.values():
        for link, point in zip(closure.links, closure.points, strict=True):
            body, position, rotation = _body_of(robot, link)
            ends[body].append(position + rotation @ point)
    for link in robot.moving_links:  # the last of a branch ends in its centre of mass
        inertia = robot.links[link].inertia
        if not any(np.linalg.norm(end) > 1e-6 for end in ends[link]) and inertia is not None:
            ends[link].append(2.0 * np.asarray(inertia.center_of_mass))
    return ends


def _bars(robot: Robot, size: float, colours: Any) -> dict[str, list[Solid]]:
    """Return bars from each joint to the next, and the joints as cylinders and boxes."""
    thin = 0.016 * size
    found: dict[str, list[Solid]] = {}
    for body, ends in _ends(robot).items():
        bars = [bar(np.zeros(3), end, thin) for end in ends if np.linalg.norm(end) > 1e-3 * size]
        solids = [Solid(*merged(bars), colours[body])] if bars else []
        if body == robot.base:
            solids.append(Solid(*cylinder(0.06 * size, 0.02 * size, up_of(robot.gravity)), DARK))
        found[body] = solids or [Solid(*sphere(1.4 * thin), colours[body])]
    for joint in robot.joints.values():
        if joint.moving:
            axis = np.asarray(joint.axis, float)
            if joint.turning:
                mesh = cylinder(1.35 * thin, 4.2 * thin, axis)
            else:
                mesh = box([3 * thin, 3 * thin, 5 * thin], rotation=turned_to(axis))
            found[joint.child].append(Solid(*mesh, DARK))
            if not joint.turning:
                found[joint.child].append(Solid(*cylinder(0.6 * thin, 10 * thin, axis), GREY))
    return found


def _spots(robot: Robot) -> tuple[Spot, ...]:
    """Return the tips of the branches, then all other links, as points."""
    parents = {joint.parent for joint in robot.joints.values()}
    tips = [link for link in robot.links if link not in parents and robot.frames[link].body >= 0]
    found = []
    for link in [*reversed(tips), *(x for x in robot.links if x not in tips and robot.frames[x].body >= 0)]:
        body, position, _ = _body_of(robot, link)
        found.append(Spot(body, tuple(float(x) for x in position), link))
    return tuple(found)


def file_shapes(path: Path, allow: Iterable[str | PathLike[str]] = ()) -> dict[str, list[Solid]]:
    """Return the shapes of a robot file by link, in its frame; none where they cannot be read.

    Parameters
    ----------
    path : Path
        URDF or MJCF.
    allow
        Folders besides that of the file that meshes may be below; a warning tells of those that lie elsewhere.
    """
    from jounce.io.robots.xml_elements import read_markup

    root = read_markup(str(path))
    return _of_urdf(root, Meshes(path, allow)) if root.tag == "robot" else _of_mjcf(root, path, allow)


def _of_urdf(root: Any, meshes: Meshes) -> dict[str, list[Solid]]:
    """Return what the elements ``<visual>`` show."""
    materials = {}
    for material in root.every("material"):
        with suppress(ValueError):
            materials[material.attributes.get("name")] = _rgba(material)
    found: dict[str, list[Solid]] = {}
    for link in root.every("link"):
        solids = []
        for visual in link.every("visual"):
            with suppress(KeyError, ValueError):  # words where numbers should be: a bar is shown instead
                solids += _visual(visual, materials, meshes)
        found[link.attributes["name"]] = solids
    return found


def _visual(visual: Any, materials: Any, meshes: Meshes) -> list[Solid]:
    geometry = visual.first("geometry")
    shape = geometry.children[0] if geometry is not None and geometry.children else None
    if shape is None:
        return []
    own = visual.first("material")
    rgba = None if own is None else _rgba(own) or materials.get(own.attributes.get("name"))
    position, rotation = _origin(visual.first("origin"))
    return [
        _coloured(vertices @ rotation.T + position, faces, rgba if rgba is not None else colour)
        for vertices, faces, colour in _shape(shape, meshes)
    ]


def _rgba(material: Any) -> tuple[float, ...] | None:
    colour = material.first("color")
    return None if colour is None else tuple(float(x) for x in colour.attributes.get("rgba", "").split()) or None


def _coloured(vertices: np.ndarray, faces: np.ndarray, rgba: Any) -> Solid:
    if rgba is None or len(rgba) < 3:
        return Solid(vertices, faces, PLAIN)
    red, green, blue = (round(255 * float(np.clip(c, 0, 1))) for c in rgba[:3])
    return Solid(vertices, faces, (red, green, blue), float(rgba[3]) if len(rgba) > 3 else 1.0)


def _origin(element: Any) -> tuple[np.ndarray, np.ndarray]:
    from scipy.spatial.transform import Rotation

    given = {} if element is None else element.attributes
    position = np.array([float(x) for x in given.get("xyz", "0 0 0").split()])
    angles = [float(x) for x in given.get("rpy", "0 0 0").split()]
    return position, Rotation.from_euler("xyz", angles).as_matrix()


def _shape(shape: Any, meshes: Meshes) -> list[tuple[np.ndarray, np.ndarray, Any]]:
    """Return the triangles of a shape of a URDF, with a colour where a mesh brings its own."""
    given = shape.attributes
    if shape.tag == "box":
        return [(*box([float(x) for x in given["size"].split()]), None)]
    if shape.tag == "cylinder":
        return [(*cylinder(float(given["radius"]), float(given["length"])), None)]
    if shape.tag == "sphere":
        return [(*sphere(float(given["radius"])), None)]
    if shape.tag == "capsule":
        half = 0.5 * float(given["length"])
        return [(*bar([0, 0, -half], [0, 0, half], float(given["radius"])), None)]
    if shape.tag == "mesh":
        scale = np.array([float(x) for x in given.get("scale", "1 1 1").split()])
        return [(v * scale, f, c) for v, f, c in meshes.triangles(given.get("filename", ""))]
    return []


def _of_mjcf(root: Any, path: Path, allow: Iterable[str | PathLike[str]]) -> dict[str, list[Solid]]:
    """Return the geoms that MuJoCo shows: groups 0 to 2."""
    import importlib

    from jounce.io.robots.mjcf import names_of_bodies
    from jounce.io.robots.mjcf_files import check_assets, included, quiet_mujoco

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
            vertices = mesh[0] @ rotation.reshape(3, 3).T + model.geom_pos[k]
            material = model.geom_matid[k]
            rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[k]
            found.setdefault(names[model.geom_bodyid[k]], []).append(_coloured(vertices, mesh[1], tuple(rgba)))
    return found


def _geom(model: Any, k: int, mujoco: Any) -> Any:
    """Return the triangles of a geom; none for planes and height fields."""
    kinds, kind, size = mujoco.mjtGeom, int(model.geom_type[k]), model.geom_size[k]
    if kind == int(kinds.mjGEOM_SPHERE):
        return sphere(float(size[0]))
    if kind == int(kinds.mjGEOM_CAPSULE):
        return bar([0, 0, -size[1]], [0, 0, size[1]], float(size[0]))
    if kind == int(kinds.mjGEOM_CYLINDER):
        return cylinder(float(size[0]), 2 * float(size[1]))
    if kind == int(kinds.mjGEOM_BOX):
        return box(2 * size)
    if kind == int(kinds.mjGEOM_ELLIPSOID):
        vertices, faces = sphere(1.0)
        return vertices * size, faces
    if kind == int(kinds.mjGEOM_MESH):
        which = int(model.geom_dataid[k])
        first, count = int(model.mesh_vertadr[which]), int(model.mesh_vertnum[which])
        begin, number = int(model.mesh_faceadr[which]), int(model.mesh_facenum[which])
        return np.array(model.mesh_vert[first : first + count]), np.array(model.mesh_face[begin : begin + number])
    return None
