"""Extensions of simulators in URDF files that are read: loops, springs of joints, and links without gravity."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from jounce.errors import RobotError, no_such
from jounce.io.robots.closure_files import CLOSED_BY, loop_closure
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.poses import pose_of
from jounce.robot.model.links_and_joints import Closure

SPRINGS = {
    "stiffness": ("springStiffness", "spring_stiffness"),
    "spring_reference": ("springReference", "spring_reference"),
}
YES, NO = ("true", "1"), ("false", "0")
BALL = "drake:ball_constraint"


class Loop(NamedTuple):
    """A closure, and its element."""

    closure: Closure
    element: Element


def shares_of_gravity(root: Element) -> dict[str, float]:
    """Return 0 for each link that Gazebo exempts from gravity, by name."""
    off = {}
    for gazebo in root.every("gazebo"):
        link = gazebo.attributes.get("reference", "").strip()
        for part in gazebo.children:
            word = part.content.strip()
            if (part.tag == "gravity" and word in NO) or (part.tag == "turnGravityOff" and word in YES):
                off[link] = 0.0
    return off


def joint_springs(root: Element) -> dict[str, dict[str, float]]:
    """Return stiffness and reference of the springs of joints, as given for Gazebo or within ``<dynamics>``.

    Raises
    ------
    RobotFileError
        If a value is no number, or the stiffness is negative.
    """
    springs: dict[str, dict[str, float]] = {}
    for gazebo in root.every("gazebo"):
        joint = gazebo.attributes.get("reference", "").strip()
        for part in gazebo.children:
            for field, tags in SPRINGS.items():
                if part.tag in tags:
                    value = part.content_numbers(1, "joints", joint, part.tag)[0]
                    springs.setdefault(joint, {})[field] = _not_negative(part, value, field, joint, part.tag)
    for element in root.every("joint"):
        dynamics, name = element.first("dynamics"), element.attributes.get("name", "")
        for field, tags in SPRINGS.items() if dynamics is not None else ():
            if dynamics is not None and tags[1] in dynamics.attributes:
                value = dynamics.number(tags[1], "joints", name, "dynamics", tags[1])
                springs.setdefault(name, {})[field] = _not_negative(dynamics, value, field, name, tags[1])
    return springs


def _not_negative(element: Element, value: float, field: str, joint: str, tag: str) -> float:
    if field == "stiffness" and value < 0:
        raise element.error("must be zero or greater", "joints", joint, tag, value=value)
    return value


def urdf_closures(root: Element, links: Collection[str]) -> list[Loop]:
    """Return the loops of a file: ``<loop_joint>``, and the ball constraints of Drake.

    A ``<loop_joint>`` holds two frames together, each placed in its link by ``xyz`` and ``rpy``; its axis is in the
    first frame. An SDF joint within ``<gazebo>`` joins two links of the file in the pose at coordinates zero.

    Raises
    ------
    RobotFileError
        If something is missing or wrong.
    """
    loops = []
    for element in root.every("loop_joint"):
        name = element.text("name", "closures")
        where = ("closures", name)
        kind = element.text("type", *where, "type")
        if kind not in CLOSED_BY:
            raise element.error(no_such("loop joint", kind, CLOSED_BY, "type"), *where, "type", value=kind)
        frames = []
        for tag in ("link1", "link2"):
            part = _needed(element, tag, *where)
            position, turn = (part.numbers(key, 3, *where, tag) or [0.0] * 3 for key in ("xyz", "rpy"))
            frames.append((_known(part, "link", links, *where, tag), position, turn))
        axis = element.first("axis")
        along = [1.0, 0.0, 0.0] if axis is None else axis.numbers("xyz", 3, *where, "axis") or [1.0, 0.0, 0.0]
        loops.append(_made(element, name, kind, frames, along))
    for k, element in enumerate(root.every(BALL)):
        name = element.attributes.get("name") or f"ball_constraint_{k}"
        where = ("closures", name)
        frames = []
        for body, point in (("A", "AP"), ("B", "BQ")):
            location = _needed(element, f"{BALL}_p_{point}", *where)
            body_name = _needed(element, f"{BALL}_body_{body}", *where)
            position = location.numbers("value", 3, *where, location.tag)
            if position is None:
                raise location.error(f"<{location.tag}> has no attribute value", *where)
            frames.append((_known(body_name, "name", links, *where, body_name.tag), position, [0.0] * 3))
        loops.append(_made(element, name, "ball", frames, None))
    return loops + [loop for element in gazebo_joints(root) if (loop := gazebo_loop(element, links)) is not None]


def gazebo_joints(root: Element) -> list[Element]:
    """Return the joints that ``<gazebo>`` adds to a file."""
    holders = [gazebo for gazebo in root.every("gazebo") if not gazebo.attributes.get("reference", "").strip()]
    return [joint for gazebo in holders for joint in gazebo.every("joint")]


def gazebo_loop(element: Element, links: Collection[str]) -> Loop | None:
    """Return the loop that an SDF joint closes between two links of a file; None if it is of another kind.

    The frame of the joint is that of its child, moved by its ``<pose>``; the axis is in that frame.

    Raises
    ------
    RobotFileError
        If a number is missing or not valid.
    """
    name, kind = element.attributes.get("name", ""), element.attributes.get("type", "")
    ends = [part.content.strip() for role in ("child", "parent") for part in element.every(role)]
    axis = element.first("axis")
    xyz = None if axis is None else axis.first("xyz")
    is_displaced = (xyz is not None and bool(xyz.attributes)) or (
        axis is not None and axis.first("use_parent_model_frame")
    )
    relative = any(pose.attributes for pose in element.every("pose"))
    if not name or kind not in CLOSED_BY or len(ends) != 2 or not set(ends) <= set(links) or is_displaced or relative:
        return None
    pose, direction = pose_of(element, "closures", name), [0.0, 0.0, 1.0]
    if xyz is not None:
        direction = xyz.content_numbers(3, "closures", name, "axis")
    along = None if CLOSED_BY[kind] in ("connect", "weld") else pose.rotation @ direction
    try:
        return Loop(Closure(name, ends, CLOSED_BY[kind], pose.position, along), element)
    except RobotError as error:
        raise element.error(error.message, "closures", name, value=error.value) from None


def _made(
    element: Element, name: str, kind: str, frames: list[tuple[str, list[float], list[float]]], axis: list[float] | None
) -> Loop:
    try:
        return Loop(loop_closure(name, kind, frames, axis), element)
    except RobotError as error:
        raise element.error(error.message, "closures", name, value=error.value) from None


def _needed(element: Element, tag: str, *name: str) -> Element:
    part = element.first(tag)
    if part is None:
        raise element.error(f"<{element.tag}> has no <{tag}>", *name)
    return part


def _known(element: Element, key: str, links: Collection[str], *name: str) -> str:
    link = element.text(key, *name)
    if link not in links:
        raise element.error(no_such("link", link, links), *name, value=link)
    return link
