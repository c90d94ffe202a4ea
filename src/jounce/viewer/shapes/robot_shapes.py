"""Shapes of robots from URDF and MJCF files; SDF has its own module."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Iterable
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from trimesh import Trimesh

from jounce.errors import RobotFileError
from jounce.io.robots.elements.xml_elements import Element, read_markup
from jounce.io.robots.mjcf.files import check_assets, included, quiet_mujoco
from jounce.io.robots.mjcf.reader import names_of_bodies
from jounce.viewer.shapes.appearance import ColoredMesh
from jounce.viewer.shapes.mesh_files import MeshFiles, Rgba
from jounce.viewer.shapes.meshes import box, cylinder, sphere, transformed
from jounce.viewer.shapes.sdf_shapes import sdf_shapes
from jounce.viewer.shapes.shapes import Shapes, colored, upright_capsule, words_as_numbers

Rotation = Float[np.ndarray, "3 3"]


def file_shapes(path: Path, allow: Iterable[str | PathLike[str]] = ()) -> Shapes:
    """Return the shapes of a robot file by link, in its frame; none if they cannot be read.

    Parameters
    ----------
    path : Path
        URDF, MJCF or SDF file.
    allow
        Further folders allowed for meshes; a warning reports meshes in other folders.
    """
    root = read_markup(str(path))
    if root.tag == "sdf":
        return sdf_shapes(root, MeshFiles(path, allow))
    return _of_urdf(root, MeshFiles(path, allow)) if root.tag == "robot" else _of_mjcf(root, path, allow)


def _of_urdf(root: Element, files: MeshFiles) -> Shapes:
    """Return the shapes of the elements ``<visual>``."""
    materials = {}
    for material in root.every("material"):
        with suppress(ValueError):
            materials[material.attributes.get("name", "")] = _rgba(material)
    shapes_of_links: Shapes = {}
    for link in root.every("link"):
        meshes = shapes_of_links.setdefault(link.attributes["name"], [])
        for visual in link.every("visual"):
            with suppress(KeyError, ValueError):  # a bar replaces a shape with invalid numbers
                meshes += _visual(visual, materials, files)
    return shapes_of_links


def _visual(visual: Element, materials: dict[str, Rgba | None], files: MeshFiles) -> list[ColoredMesh]:
    geometry = visual.first("geometry")
    shape = geometry.children[0] if geometry is not None and geometry.children else None
    if shape is None:
        return []
    material = visual.first("material")
    rgba = None if material is None else _rgba(material) or materials.get(material.attributes.get("name", ""))
    position, rotation = _origin(visual.first("origin"))
    return [colored(transformed(mesh, position, rotation), rgba or color) for mesh, color in _urdf_shape(shape, files)]


def _rgba(material: Element) -> Rgba | None:
    color = material.first("color")
    return None if color is None else tuple(words_as_numbers(color.attributes.get("rgba", ""))) or None


def _origin(element: Element | None) -> tuple[list[float], Rotation]:
    from scipy.spatial.transform import Rotation as Attitude

    given = {} if element is None else element.attributes
    angles = words_as_numbers(given.get("rpy", "0 0 0"))
    return words_as_numbers(given.get("xyz", "0 0 0")), Attitude.from_euler("xyz", angles).as_matrix()


def _urdf_shape(shape: Element, files: MeshFiles) -> list[tuple[Trimesh, Rgba | None]]:
    """Return the meshes of a shape of a URDF, with the colors of mesh files."""
    given, kind = shape.attributes, shape.tag
    if kind == "mesh":
        scale = words_as_numbers(given.get("scale", "1 1 1"))
        return [(mesh.apply_scale(scale), color) for mesh, color in files.read(given.get("filename", ""))]
    if kind == "box":
        return [(box(words_as_numbers(given["size"])), None)]
    if kind == "sphere":
        return [(sphere(float(given["radius"])), None)]
    if kind not in ("cylinder", "capsule"):
        return []
    radius, length = float(given["radius"]), float(given["length"])
    return [(cylinder(radius, length) if kind == "cylinder" else upright_capsule(radius, length), None)]


def _of_mjcf(root: Element, path: Path, allow: Iterable[str | PathLike[str]]) -> Shapes:
    """Return the geoms that MuJoCo shows, those of groups 0 to 2."""
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
    except (ValueError, RuntimeError, OSError):  # a mesh is missing, which the robot itself does not need
        return {}
    names, shapes_of_links = names_of_bodies(model), {}
    for k in range(model.ngeom):
        mesh = _geom(model, k, mujoco) if model.geom_group[k] <= 2 else None
        if mesh is not None:
            rotation = np.zeros(9)
            mujoco.mju_quat2Mat(rotation, model.geom_quat[k])
            material = model.geom_matid[k]
            rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[k]
            shape = colored(transformed(mesh, model.geom_pos[k], rotation.reshape(3, 3)), tuple(rgba.tolist()))
            shapes_of_links.setdefault(names[model.geom_bodyid[k]], []).append(shape)
    return shapes_of_links


def _geom(model: Any, k: int, mujoco: Any) -> Trimesh | None:
    """Return the mesh of a geom; None for planes and height fields."""
    kinds, kind, size = mujoco.mjtGeom, int(model.geom_type[k]), model.geom_size[k]
    if kind == int(kinds.mjGEOM_SPHERE):
        return sphere(float(size[0]))
    if kind == int(kinds.mjGEOM_CAPSULE):
        return upright_capsule(float(size[0]), 2 * float(size[1]))
    if kind == int(kinds.mjGEOM_CYLINDER):
        return cylinder(float(size[0]), 2 * float(size[1]))
    if kind == int(kinds.mjGEOM_BOX):
        return box(2 * size)
    if kind == int(kinds.mjGEOM_ELLIPSOID):
        return sphere(1.0).apply_scale(size)
    if kind == int(kinds.mjGEOM_MESH):
        mesh_index = int(model.geom_dataid[k])
        first, count = int(model.mesh_vertadr[mesh_index]), int(model.mesh_vertnum[mesh_index])
        first_face, number = int(model.mesh_faceadr[mesh_index]), int(model.mesh_facenum[mesh_index])
        vertices, faces = model.mesh_vert[first : first + count], model.mesh_face[first_face : first_face + number]
        return Trimesh(np.array(vertices), np.array(faces), process=False)
    return None
