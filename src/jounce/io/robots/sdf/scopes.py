"""Parts of nested SDF models, under their names in the containing model or world."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.poses import MODEL, WORLD, FramePose, Frames, flag_of, pose_of

NAMED = ("link", "joint", "frame")
REFERENCES = ("relative_to", "expressed_in", "attached_to")  # attributes that name a frame
TEXTS = ("parent", "child", "gearbox_reference_body", "mimicJoint", "joint")
TEXTS += ("drake:ball_constraint_body_A", "drake:ball_constraint_body_B")


def named(model: Element) -> dict[str, Element]:
    """Return links, joints and frames of a model by name."""
    elements: dict[str, Element] = {}
    for tag in NAMED:
        for element in model.every(tag):
            name = element.text("name", f"{tag}s")
            if name in elements:
                message = f"this name is given twice, first in line {elements[name].line}"
                raise element.error(message, f"{tag}s", value=name)
            if name == WORLD or (name.startswith("__") and name.endswith("__")):
                if name == WORLD and tag == "link" and element.first("inertial") is None:
                    element.leave_out_unknown("SDF reserves this name: leave the link out", "links", name)
                    continue
                raise element.error("SDF reserves this name", f"{tag}s", value=name)
            elements[name] = element
    return elements


def scope(name: str, model: Element) -> list[Element]:
    """Return the parts of a model with their names in the world."""
    return scoped(model, name, reference_pose(model), model.only("pose") or model)


def placed(model: Element) -> FramePose:
    """Return the pose of a model, given that of its placement frame."""
    frame, pose = model.attributes.get("placement_frame", "").strip(), pose_of(model)
    if not frame:
        return pose
    frame_pose = Frames(model, named(model)).of(frame, model, "placement_frame")
    return pose.then(FramePose(np.zeros(3), np.eye(3)).seen_from(frame_pose))


def reference_pose(model: Element) -> tuple[FramePose, str]:
    """Return the pose of a model and its reference frame, which is empty for the containing model."""
    pose = model.only("pose")
    given = "" if pose is None else pose.attributes.get("relative_to") or pose.attributes.get("frame") or ""
    return placed(model), "" if given == WORLD else given


def made(like: Element, tag: str, text: str = "", **attributes: str) -> Element:
    """Return a new element with the file and the line of another one."""
    return Element(tag, attributes, like.path, like.line, pieces=[text], faults=like.faults)


def with_pose(element: Element, pose: FramePose, relative: str = MODEL) -> Element:
    """Return a new element after it was given its pose relative to a frame."""
    from scipy.spatial.transform import Rotation

    numbers = [*pose.position, *Rotation.from_matrix(pose.rotation).as_quat()]
    child = made(element, "pose", " ".join(map(repr, map(float, numbers))), relative_to=relative)
    child.attributes["rotation_format"] = "quat_xyzw"
    element.children.append(child)
    return element


def scoped(
    model: Element, scope: str, placed: tuple[FramePose, str], location: Element, *, merged: bool = False
) -> list[Element]:
    """Return the parts of a model with their names in the containing model, and the frame of the model."""
    frame = f"_merged__{scope}__model__" if merged else f"{scope}::{MODEL}"

    def rename(name: str) -> str:
        if name in ("", WORLD):
            return name
        return frame if name == MODEL else name if merged else f"{scope}::{name}"

    pose, relative = placed
    frames = Frames(model, named(model))
    frames_alone = not frames.links and flag_of(model, "static", "static")
    canonical = "" if frames_alone else frames.canonical_link()
    attached = made(location, "frame", name=frame, attached_to=rename(canonical))
    parts = [with_pose(attached, pose, relative or MODEL)]
    for child in model.children:
        if child.tag in ("pose", "static", "self_collide", "allow_auto_disable", "enable_wind"):
            continue
        part = _renamed(child, rename)
        if child.tag in NAMED:
            part.attributes["name"] = rename(child.attributes.get("name", ""))
        if child.tag == "link":
            _relative(part, frame)
        elif child.tag == "frame":
            part.attributes["attached_to"] = part.attributes.get("attached_to") or frame
        parts.append(part)
    return parts


def _renamed(element: Element, rename: Any) -> Element:
    """Return an element in which all references to links, joints and frames are renamed."""
    attributes = {key: rename(x) if key in REFERENCES else x for key, x in element.attributes.items()}
    if element.tag == "pose" and "frame" in attributes:
        attributes["frame"] = rename(attributes["frame"])
    if element.tag in ("mimic", "drake:mimic") and "joint" in attributes:
        attributes["joint"] = rename(attributes["joint"])
    pieces = [rename(element.content.strip())] if element.tag in TEXTS and not element.children else element.pieces
    children = [_renamed(child, rename) for child in element.children]
    return dataclasses.replace(element, attributes=attributes, pieces=pieces, children=children)


def _relative(link: Element, frame: str) -> None:
    """Place a link relative to a frame, unless it names a frame."""
    pose = link.first("pose")
    if pose is None:
        link.children.append(made(link, "pose", relative_to=frame))
    elif not (pose.attributes.get("relative_to") or pose.attributes.get("frame")):
        pose.attributes["relative_to"] = frame
