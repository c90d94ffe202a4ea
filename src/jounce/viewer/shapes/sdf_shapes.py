"""Shapes of robots from the elements ``<visual>`` of SDF files."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from shapely.geometry import Polygon
from trimesh import Trimesh

from jounce.errors import RobotFileError
from jounce.io.robots.elements.faults import Faults
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.models import chosen_model, named
from jounce.io.robots.sdf.poses import FramePose, Frames, number_of, pose_of, text_of
from jounce.viewer.shapes.appearance import ColoredMesh
from jounce.viewer.shapes.mesh_files import MeshFiles, Rgba
from jounce.viewer.shapes.meshes import box, cylinder, extruded, sphere, transformed
from jounce.viewer.shapes.shapes import Shapes, colored, upright_capsule, words_as_numbers


def sdf_shapes(root: Element, files: MeshFiles) -> Shapes:
    """Return the shapes of an SDF file by link, in its frame, without planes, height maps and unreadable shapes.

    Parameters
    ----------
    root : Element
        The element ``<sdf>`` of a file that describes a robot.
    files : MeshFiles
        Mesh files of the SDF file.
    """
    try:
        chosen = chosen_model(root, Faults(root.path), None, files.allow).model
    except RobotFileError:  # several models move, and none is selected
        return {}
    frames = Frames(chosen, named(chosen))
    shapes_of_links: Shapes = {}
    for name, link in frames.elements.items():
        shapes = shapes_of_links.setdefault(name, []) if link.tag == "link" else []
        for visual in link.every("visual") if link.tag == "link" else ():
            with suppress(RobotFileError, ValueError):  # a bar replaces a shape with invalid numbers
                shapes += _visual(visual, name, frames, files)
    return shapes_of_links


def _visual(visual: Element, link: str, frames: Frames, files: MeshFiles) -> list[ColoredMesh]:
    geometry = visual.first("geometry")
    if geometry is None or len(geometry.children) != 1:
        return []
    pose, rgba = _pose(visual, link, frames), _rgba(visual)
    return [colored(transformed(mesh, *pose), rgba or color) for mesh, color in _meshes(geometry.children[0], files)]


def _pose(visual: Element, link: str, frames: Frames) -> FramePose:
    """Return the pose of a visual in the frame of its link; the file may give it in another frame."""
    pose = visual.first("pose")
    reference = "" if pose is None else pose.attributes.get("relative_to", "")
    if reference and reference not in frames.elements:
        raise visual.error("is placed relative to a frame that there is not", "visual", value=reference)
    return frames.pose(reference or link).then(pose_of(visual)).seen_from(frames.pose(link))


def _rgba(visual: Element) -> Rgba | None:
    """Return the diffuse color, or the ambient one, with the transparency."""
    material = visual.first("material")
    given = None if material is None else material.first("diffuse") or material.first("ambient")
    if given is None:
        return None
    red, green, blue, *opacity = words_as_numbers(given.content)
    clear = number_of(visual, "transparency", "visual", default=0.0)
    return red, green, blue, (opacity[0] if opacity else 1.0) * (1.0 - clear)


def _meshes(shape: Element, files: MeshFiles) -> list[tuple[Trimesh, Rgba | None]]:
    """Return the meshes of a shape, with the colors of mesh files."""
    if shape.tag == "mesh":
        scale = _vector(shape, "scale")
        return [(mesh.apply_scale(scale), color) for mesh, color in files.read(text_of(shape, "uri", "mesh"))]
    solid = _SOLIDS.get(shape.tag)
    return [] if solid is None else [(solid(shape), None)]


def _length(shape: Element, tag: str) -> float:
    return number_of(shape, tag, shape.tag, default=1.0)


def _vector(shape: Element, tag: str) -> list[float]:
    given = shape.first(tag)
    return [1.0, 1.0, 1.0] if given is None else given.content_numbers(3, shape.tag, tag)


def _polyline(shape: Element) -> Trimesh:
    """Return a plane shape extruded along z."""
    corners = [point.content_numbers(2, shape.tag, "point") for point in shape.every("point")]
    return extruded(Polygon(corners), 0.0, _length(shape, "height"))


_SOLIDS: dict[str, Callable[[Element], Trimesh]] = {
    "box": lambda shape: box(_vector(shape, "size")),
    "sphere": lambda shape: sphere(_length(shape, "radius")),
    "cylinder": lambda shape: cylinder(_length(shape, "radius"), _length(shape, "length")),
    "capsule": lambda shape: upright_capsule(_length(shape, "radius"), _length(shape, "length")),
    "ellipsoid": lambda shape: sphere(1.0).apply_scale(_vector(shape, "radii")),
    "polyline": _polyline,
}
