"""Joints of SDF files: their axes, limits and drives, in the frame of the model."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from jaxtyping import Float

from jounce.errors import RobotError, no_such
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.poses import (
    MODEL,
    FramePose,
    Frames,
    check_known,
    flag_of,
    needed,
    number_of,
    text_of,
    vector_of,
)
from jounce.robot.model.links_and_joints import Limits

AXIS_TAGS = ("axis", "axis2")
AXES = {"revolute": 1, "continuous": 1, "prismatic": 1, "fixed": 0, "universal": 2, "revolute2": 2, "ball": 0}
AXES |= {"screw": 1}
UNBOUNDED = 1e16  # written in SDF for no bound
JOINT = ("parent", "child", "pose", "axis", "axis2", "physics", "sensor", "plugin", "frame", "thread_pitch")
JOINT += ("screw_thread_pitch", "gearbox_ratio", "gearbox_reference_body")
AXIS = ("xyz", "limit", "dynamics", "use_parent_model_frame", "mimic", "initial_position")
LIMIT = ("lower", "upper", "effort", "velocity", "stiffness", "dissipation")
ROTOR, RATIO = "drake:rotor_inertia", "drake:gear_ratio"
DYNAMICS = ("damping", "friction", "spring_reference", "spring_stiffness")


@dataclasses.dataclass(frozen=True)
class SdfAxis:
    """An axis of a joint: its tag in the file, its direction in the model, its limits and its drive."""

    tag: str
    direction: Float[np.ndarray, "3"]
    limits: Limits
    damping: float
    friction: float
    armature: float
    stiffness: float
    spring_reference: float


@dataclasses.dataclass(frozen=True)
class SdfJoint:
    """A joint of the file, in the frame of the model."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Float[np.ndarray, "3"]
    axes: tuple[SdfAxis, ...]
    element: Element

    def reversed(self) -> SdfJoint:
        """Return the joint seen from its child: the same coordinates, about the opposite axes."""
        axes = tuple(dataclasses.replace(axis, direction=-axis.direction) for axis in self.axes[::-1])
        return dataclasses.replace(self, parent=self.child, child=self.parent, axes=axes)


def read_joint(name: str, element: Element, frames: Frames, version: tuple[int, ...]) -> SdfJoint:
    """Return a joint in the frame of the model."""
    location = ("joints", name)
    check_known(element, JOINT, *location)
    kind = element.text("type", *location, "type")
    valid = (*AXES, "gearbox")
    if kind not in valid:
        raise element.error(no_such("joint", kind, valid, "type"), *location, "type", value=kind)
    ends = []
    for role in ("parent", "child"):
        part = needed(element, role, *location)
        ends.append(frames.link(text_of(element, role, *location), part, *location, role))
    if ends[0] == ends[1]:
        raise element.error("must join two different links", *location, value=ends[0])
    origin = frames.pose(name)
    tags = AXIS_TAGS[: 2 if kind == "gearbox" else AXES[kind]]
    armature = rotor_of(element, *location) if len(tags) == 1 else 0.0
    axes = tuple(
        _axis(needed(element, tag, *location), origin, frames, version, armature, *location, tag) for tag in tags
    )
    return SdfJoint(name, kind, ends[0], ends[1], origin.position, axes, element)


def pitch_of(element: Element, *location: str) -> float:
    """Return the travel of a screw joint along its axis per radian, m/rad.

    ``screw_thread_pitch`` is the travel per turn, right-handed; the older ``thread_pitch`` is in radians per meter,
    left-handed. Without both, the travel per turn is 1 m.

    Raises
    ------
    RobotFileError
        If a value is no number, or the older one is zero.
    """
    if (old := element.only("thread_pitch", *location)) and not element.only("screw_thread_pitch", *location):
        radians = number_of(element, "thread_pitch", *location, default=1.0)
        if radians == 0:
            raise old.error("must not be zero: it is in radians per meter", *location, "thread_pitch", value=radians)
        return -1.0 / radians
    return number_of(element, "screw_thread_pitch", *location, default=1.0) / (2 * math.pi)


def rotor_of(element: Element, *location: str) -> float:
    """Return the inertia of the rotor of a joint, as seen at the joint and read by Drake.

    Raises
    ------
    RobotFileError
        If a value is no number, or the inertia is negative.
    """
    inertia, ratio = (
        number_of(element, key, *location, default=default) for key, default in ((ROTOR, 0.0), (RATIO, 1.0))
    )
    if inertia < 0:
        raise needed(element, ROTOR, *location).error("must be zero or greater", *location, ROTOR, value=inertia)
    return inertia * ratio**2


def _axis(
    axis: Element, pose: FramePose, frames: Frames, version: tuple[int, ...], armature: float, *location: str
) -> SdfAxis:
    check_known(axis, AXIS, *location)
    xyz = axis.only("xyz", *location)
    direction = np.array([0.0, 0.0, 1.0]) if xyz is None else vector_of(xyz, *location, "xyz")
    frame = "" if xyz is None else xyz.attributes.get("expressed_in", "")
    old = version < (1, 7)
    if old and flag_of(axis, "use_parent_model_frame", *location, default=version < (1, 5)):
        frame = MODEL
    rotation = frames.of(frame, xyz or axis, *location, "xyz").rotation if frame else pose.rotation
    limit, dynamics = axis.only("limit", *location), axis.only("dynamics", *location)
    for part, valid in ((limit, LIMIT), (dynamics, DYNAMICS)):
        if part is not None:
            check_known(part, valid, *location, part.tag)
    values = {key: number_of(dynamics, key, *location, "dynamics", default=0.0) for key in DYNAMICS}
    for key, value in values.items():
        if value < 0 and key != "spring_reference":
            raise (dynamics or axis).error("must be zero or greater", *location, "dynamics", key, value=value)
    drives = (values["damping"], values["friction"], armature, values["spring_stiffness"], values["spring_reference"])
    return SdfAxis(axis.tag, rotation @ direction, _limits(limit, *location), *drives)


def _limits(limit: Element | None, *location: str) -> Limits:
    if limit is None:
        return Limits()
    keys = ("lower", "upper", "velocity", "effort")
    given = {key: number_of(limit, key, *location, "limit", default=math.nan, infinite=True) for key in keys}
    bounds = {key: x for key, x in given.items() if abs(x) < UNBOUNDED and (key in keys[:2] or x > 0)}
    try:
        return Limits(**bounds)
    except RobotError as error:
        raise limit.error(error.message, *location, "limit", value=error.value) from None


def with_named_axes(joint: Element, version: tuple[int, ...]) -> Element:
    """Return a joint whose axes name their frames, whatever the version of the file."""
    children = []
    for axis in joint.children:
        if axis.tag in ("axis", "axis2") and version < (1, 7):
            location = ("joints", joint.attributes.get("name", ""), axis.tag)
            in_model = flag_of(axis, "use_parent_model_frame", *location, default=version < (1, 5))
            parts = [x for x in axis.children if x.tag != "use_parent_model_frame"]
            if in_model:
                directions = [x for x in parts if x.tag == "xyz"] or [
                    Element("xyz", {}, axis.path, axis.line, pieces=["0 0 1"], faults=axis.faults)
                ]
                other_parts = [x for x in parts if x.tag != "xyz"]
                turned = [
                    dataclasses.replace(x, attributes={**x.attributes, "expressed_in": MODEL}) for x in directions
                ]
                parts = [*turned, *other_parts]
            axis = dataclasses.replace(axis, children=parts)
        children.append(axis)
    return dataclasses.replace(joint, children=children)
