"""Robots from URDF files, read and checked entry by entry, with the line of each."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import RobotError, RobotFileError, did_you_mean, no_such
from jounce.io.robots.elements.faults import (
    BELOW_ZERO,
    FOLLOWS_NONE,
    IDLE,
    MASSLESS,
    NO_MOMENTS,
    ONE_END,
    REVERSED,
    SAME_NAME,
    Faults,
    left_out,
)
from jounce.io.robots.elements.followers import with_room
from jounce.io.robots.elements.named_elements import NamedElements
from jounce.io.robots.elements.quaternions import rotation_of
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.urdf.extensions import Loop, joint_springs, shares_of_gravity, urdf_closures
from jounce.io.robots.urdf.left_out import check_version, note_left_out, rotors
from jounce.rigid.inertia import Inertia
from jounce.robot.model.floating_base import floating_joints
from jounce.robot.model.links_and_joints import Closure, Joint, Limits, Link
from jounce.robot.model.mimics import Mimic, leaders
from jounce.robot.model.tree import axes_with_z_along, ordered
from jounce.robot.robot import Robot

WORLD = "world"  # it need not be a link of the file
EXPANDED = ("floating", "planar", "spherical")
TYPES = ("continuous", "fixed", "prismatic", "revolute", *EXPANDED)
LINK_PARTS = ("inertial", "visual", "collision", "contact", "material", "sensor")
INERTIAL_PARTS = ("origin", "mass", "inertia")
JOINT_PARTS = ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration", "safety_controller")
OF_SEVERAL = {key: f"{key} of planar, floating and spherical joints" for key in ("damping", "friction", "armature")}
SIZES = ("velocity", "acceleration", "deceleration", "jerk", "effort")
_Pose = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(root: Element, faults: Faults, massless: bool = False) -> Robot:
    """Return the robot of a URDF file.

    Revolute, continuous, prismatic and fixed joints are taken unchanged. A floating joint becomes three slides and
    three turns, a planar one two slides and a turn, a spherical one (of MuJoCo and Bullet) three turns, with massless
    links between them. The limits, damping and friction of such joints are left out, because the file does not state
    for which coordinates they hold; there is a warning of damping and friction.

    An ``<inertial>`` with zero mass and zero inertia is a frame; one with only a mass is a point mass, with a warning.
    Limits of zero count as not given, as does a range from zero to zero. A joint whose leader follows another joint
    follows the latter. Rotors that Drake reads from transmissions become armature: ``drake:rotor_inertia`` times the
    square of ``drake:gear_ratio``. Loops (``loop_joint``, ``drake:ball_constraint``) become closures;
    ``springStiffness`` and ``springReference`` of Gazebo are springs, and links may be free of gravity. There is a
    warning of other elements by which simulators change motions or forces.

    Parameters
    ----------
    root : Element
        Element ``<robot>``.
    faults : Faults
        Records values that no real robot has, and parts that are left out.
    massless : bool, default False
        Whether moving links without mass that carry others are no fault.

    Returns
    -------
    Robot
        Robot with the names of the file.

    Raises
    ------
    RobotFileError
        If something is missing or impossible; the message has the line.
    """
    check_version(root, faults)
    links, joints = _named(root, "link"), _named(root, "joint")
    if not links:
        raise root.error("a robot needs at least one <link>")
    lines = NamedElements(root)
    robot_links, pulled, springs = [], shares_of_gravity(root), joint_springs(root)
    if WORLD not in links and any(_parent(element) == WORLD for element in joints.values()):
        robot_links.append(Link(WORLD))
    for name, element in links.items():
        lines.add(element, "links", name)
        robot_links.append(_link(name, element, faults, pulled.get(name, 1.0)))
    for name, element in joints.items():
        _check_joint(element, name, dict.fromkeys([link.name for link in robot_links]))
        _add_joint(lines, element, name)
    parts: list[Joint] = []
    mimics, armatures = _mimics(joints, faults), rotors(root, faults)
    named: dict[str, list[Joint]] = {}
    try:
        for name, element in joints.items():
            more, expanded = _joints(name, element, mimics, armatures.get(name, 0.0), faults)
            if len(expanded) == 1 and expanded[0].moving and name in springs:
                expanded = [dataclasses.replace(expanded[0], **springs[name])]
            named[name] = expanded
            robot_links += more
            parts += expanded
            for part in expanded:
                lines.add(element, "joints", part.name)
        ordered(_distinct("links", robot_links, root), _distinct("joints", parts, root))
        parts = with_room(parts, faults, lines.located)
        closures = []
        for loop in urdf_closures(root, [link.name for link in robot_links]):
            closures.append(_closure(loop, {part.name for part in parts}, faults))
            lines.add(loop.element, "closures", closures[-1].name)
        robot = Robot(root.attributes.get("name", "robot"), robot_links, parts, closures=closures, strict=False)
        _check_masses(robot, joints, links, faults, massless)
        note_left_out(root, robot, named, faults)
        return robot
    except RobotFileError:
        raise
    except RobotError as error:
        raise lines.located(error) from None


def _closure(loop: Loop, joints: Collection[str], faults: Faults) -> Closure:
    """Return the closure of a loop, with a name that no joint has."""
    name = loop.closure.name
    if name not in joints:
        return loop.closure
    new = f"{name}_closure"
    while new in joints:
        new += "_"
    message = f"a joint has the name of this closure, which is called {new}; give it another"
    faults.add(SAME_NAME, name, loop.element.error(message, "closures", name))
    return dataclasses.replace(loop.closure, name=new)


def _add_joint(lines: NamedElements, element: Element, name: str) -> None:
    lines.add(element, "joints", name)
    for tag in ("parent", "child", "axis", "mimic", "limit"):
        lines.add(element.first(tag), "joints", name, tag)
    for key in ("damping", "friction"):
        lines.add(element.first("dynamics"), "joints", name, key)


def _named(root: Element, tag: str) -> dict[str, Element]:
    """Return the links or joints by name."""
    elements: dict[str, Element] = {}
    for element in root.every(tag):
        name = element.text("name", f"{tag}s")
        if name in elements:
            raise element.error(f"this name is given twice, first in line {elements[name].line}", f"{tag}s", value=name)
        elements[name] = element
    return elements


def _distinct(kind: str, parts: list[Any], root: Element) -> dict[str, Any]:
    """Return links or joints by name; equal names come from an expanded joint."""
    values: dict[str, Any] = {}
    for part in parts:
        if part.name in values:
            raise root.error("a joint that is expanded needs this name; rename the other", kind, value=part.name)
        values[part.name] = part
    return values


def _link(name: str, element: Element, faults: Faults, gravity: float) -> Link:
    """Return a link; its inertia is transformed from the axes of ``<inertial>`` to those of the link."""
    location = ("links", name)
    element.check_children(LINK_PARTS, *location)
    inertial = element.only("inertial", *location)
    if inertial is None:
        return Link(name)
    inertial.check_children(INERTIAL_PARTS, *location, "inertial")
    for tag in INERTIAL_PARTS:
        inertial.only(tag, *location, "inertial")
    pose = _pose(inertial, *location, "inertial")
    weight = _part(inertial, "mass", "; give it, or leave out <inertial>", *location, "inertial")
    mass = weight.number("value", *location, "mass")
    moments = inertial.first("inertia")
    if moments is None:
        message = "has no <inertia>; six zeros are a point mass"
        faults.add(NO_MOMENTS, name, inertial.error(message, *location, "inertial"))
    xx, xy, xz, yy, yz, zz = (
        0.0 if moments is None else moments.number(key, *location, "inertia", key) for key in TENSOR
    )
    if mass < 0:
        raise weight.error("must be greater than zero", *location, "mass", value=mass)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if mass == 0 and not tensor.any():
        return Link(name)
    inertia = Inertia(mass, tensor=tensor, strict=False)
    faults.check(inertia, name, (weight if mass == 0 or moments is None else moments).line)
    return Link(name, inertia.moved(*pose), gravity)


def _part(element: Element, tag: str, advice: str, *name: str) -> Element:
    """Return a required child."""
    part = element.first(tag)
    if part is None:
        raise element.error(f"has no <{tag}>{advice}", *name)
    return part


def _pose(element: Element, *name: str) -> _Pose:
    """Return the pose of an ``<origin>``: turns about fixed axes, or a quaternion of URDF 1.1."""
    from scipy.spatial.transform import Rotation

    origin = element.first("origin")
    if origin is None:
        return np.zeros(3), np.eye(3)
    position, turns = (origin.numbers(key, 3, *name, "origin") or [0.0] * 3 for key in ("xyz", "rpy"))
    quaternion = origin.numbers("quat_xyzw", 4, *name, "origin")
    if quaternion is None:
        return np.array(position), Rotation.from_euler("xyz", turns).as_matrix()
    if "rpy" in origin.attributes:
        raise origin.error("has both rpy and quat_xyzw; leave one of them out", *name, "origin")
    return np.array(position), rotation_of(quaternion, origin, *name, "origin")


def _parent(joint: Element) -> str:
    """Return the parent link of a joint; empty if it is not given."""
    parent = joint.first("parent")
    return "" if parent is None else parent.attributes.get("link", "")


def _check_joint(element: Element, name: str, links: Collection[str]) -> None:
    location = ("joints", name)
    element.check_children(JOINT_PARTS, *location)
    for tag in JOINT_PARTS:
        element.only(tag, *location)
    kind = element.text("type", *location, "type")
    if kind not in TYPES:
        raise element.error(no_such("joint", kind, TYPES, "type"), *location, "type", value=kind)
    for role in ("parent", "child"):
        part = _part(element, role, "", *location)
        link = part.text("link", *location, role)
        if link not in links:
            raise part.error(no_such("link", link, links), *location, role, value=link)
    mimic = element.first("mimic")
    if mimic is not None:
        mimic.text("joint", *location, "mimic")
        for key in ("multiplier", "offset"):
            mimic.numbers(key, 1, *location, "mimic", key)
        if kind in EXPANDED:
            raise mimic.error(f"a {kind} joint has several coordinates, it cannot follow another", *location, "mimic")


def _ends(element: Element) -> tuple[str, str]:
    """Return parent and child of a joint."""
    parent, child = (_part(element, role, "").attributes["link"] for role in ("parent", "child"))
    return parent, child


def _joints(
    name: str, element: Element, mimics: dict[str, Mimic], armature: float, faults: Faults
) -> tuple[list[Link], list[Joint]]:
    """Return the joints that represent a joint of the file, with the massless links between them."""
    location = ("joints", name)
    kind, (parent, child), (position, rotation) = element.attributes["type"], _ends(element), _pose(element, *location)
    axis, limit, dynamics = (element.first(tag) for tag in ("axis", "limit", "dynamics"))
    direction = [1.0, 0.0, 0.0] if axis is None else axis.numbers("xyz", 3, *location, "axis") or [1.0, 0.0, 0.0]
    bounds = {key: 0.0 if limit is None else _bound(limit, key, name) for key in (*SIZES, "lower", "upper")}
    damping, friction = (
        0.0 if dynamics is None else dynamics.number(key, *location, "dynamics", key, default=0.0)
        for key in ("damping", "friction")
    )
    if kind == "fixed":
        return [], [Joint(name, parent, child, kind, position, rotation)]
    for key, value in (("damping", damping), ("friction", friction), ("armature", armature)):
        if kind in EXPANDED and value:
            heading, dynamics_element = OF_SEVERAL[key], element if dynamics is None or key == "armature" else dynamics
            faults.leave_out(
                heading, name, dynamics_element.error(left_out(heading), *location, "dynamics", key, value=value)
            )
    if kind in ("floating", "spherical"):
        links, parts = floating_joints(child, prefix=name)
        links, parts = (links[1:], parts) if kind == "floating" else (links[4:], parts[3:])
        first = dataclasses.replace(parts[0], parent=parent, position=position, rotation=rotation)
        return links, [first, *parts[1:]]
    if math.hypot(*direction) < 1e-9:
        raise (axis or element).error("must have a direction", *location, "axis", value=direction)
    if kind == "planar":
        return _planar(name, (parent, child), (position, rotation), np.array(direction))
    arguments: dict[str, Any] = {"limits": _limits(name, limit, kind, bounds, faults), "mimic": mimics.get(name)}
    arguments |= {"axis": np.array(direction), "armature": armature, "damping": damping, "friction": friction}
    return [], [Joint(name, parent, child, kind, position, rotation, **arguments)]


def _mimics(joints: dict[str, Element], faults: Faults) -> dict[str, Mimic]:
    """Return the leaders of joints; a joint whose leader does not exist is free, as in Pinocchio."""
    moving = {name: x for name, x in joints.items() if x.attributes["type"] not in ("fixed", *EXPANDED)}
    leading = [name for name, element in moving.items() if element.first("mimic") is None]
    mimics = {}
    for name, joint in moving.items():
        mimic = joint.first("mimic")
        if mimic is None:
            continue
        leader = mimic.attributes["joint"]
        if leader in joints:
            multiplier, offset = mimic.number("multiplier", default=1.0), mimic.number("offset", default=0.0)
            mimics[name] = Mimic(leader, multiplier, offset)
            continue
        message = f"must follow a moving joint that follows no other; {did_you_mean(leader, leading)}"
        faults.add(FOLLOWS_NONE, name, mimic.error(message, "joints", name, "mimic", value=leader))
    return leaders(mimics)


def _planar(
    name: str, ends: tuple[str, str], pose: _Pose, axis: Float[np.ndarray, "3"]
) -> tuple[list[Link], list[Joint]]:
    """Return two slides across the axis and a turn about it."""
    axes = axes_with_z_along(axis / np.linalg.norm(axis)).T
    names = [ends[0], f"{name}_frame_1", f"{name}_frame_2", ends[1]]
    kinds = (("x", "prismatic"), ("y", "prismatic"), ("angle", "continuous"))
    parts = [
        Joint(f"{name}_{suffix}", names[k], names[k + 1], kind, axis=axes[k]) for k, (suffix, kind) in enumerate(kinds)
    ]
    parts[0] = dataclasses.replace(parts[0], position=pose[0], rotation=pose[1])
    return [Link(frame) for frame in names[1:3]], parts


def _bound(limit: Element, key: str, name: str) -> float:
    """Return a bound of a joint; zero if it is not given; an infinite value is no bound."""
    location = ("joints", name, "limit", key)
    key = key if key in limit.attributes else f"drake:{key}"
    given = limit.numbers(key, 1, *location, infinite=True)
    if given not in (None, [-math.inf if key == "lower" else math.inf]):
        limit.numbers(key, 1, *location)
    return given[0] if given else 0.0


def _limits(name: str, limit: Element | None, kind: str, bounds: dict[str, float], faults: Faults) -> Limits:
    if limit is None:
        return Limits()
    given = {key: bounds[key] for key in SIZES if bounds[key] != 0}
    for key in [key for key in ("velocity", "effort") if given.get(key, 0) < 0]:
        message = "must be greater than zero; leave it out where there is no limit"
        faults.add(BELOW_ZERO, name, limit.error(message, "joints", name, "limit", key, value=given.pop(key)))
    if kind != "continuous" and (bounds["lower"], bounds["upper"]) != (0, 0):
        ends = {key: bounds[key] for key in ("lower", "upper")}
        if bounds["lower"] > bounds["upper"] and (absent := ends.keys() - limit.attributes.keys()):
            for key in absent:  # a missing end would be zero
                message = f"is missing and so is zero, beyond the other end of the range; give {key}"
                faults.add(ONE_END, name, limit.error(message, "joints", name, "limit", key))
                del ends[key]
        elif bounds["lower"] > bounds["upper"]:
            message = "the lower limit must not exceed the upper one; leave both out where there is no range"
            error = limit.error(message, "joints", name, "limit", value=list(ends.values()))
            faults.add(REVERSED, name, error)
            ends = {}
        given |= ends
    try:
        return Limits(**{key: value for key, value in given.items() if math.isfinite(value)})
    except RobotError as error:
        steps = ("joints", name, "limit", *([error.name] if error.name else []))
        raise limit.error(error.message, *steps, value=error.value) from None


def _check_masses(
    robot: Robot, joints: dict[str, Element], elements: dict[str, Element], faults: Faults, meant: bool
) -> None:
    """Record every link that a joint of the file moves and that, with all links fixed to it, has no mass."""
    heavy = {robot.frames[name].body for name, link in robot.links.items() if link.inertia is not None}
    idle = {robot.joints[name].child for name in robot.massless_joints}
    for joint in joints.values():
        _, link = _ends(joint)
        if joint.attributes["type"] == "fixed" or robot.frames[link].body in heavy or (meant and link not in idle):
            continue
        element = elements[link]
        inertial = element.first("inertial")
        mass = None if inertial is None else inertial.first("mass")
        advice = "give it its mass, or load with massless=True to keep it as a massless piece between joints"
        if link in idle:
            advice = "give it, or a link that it carries, a mass"
        if mass is None:
            error = element.error(f"<inertial> is missing on a link that moves; {advice}", "links", link)
        else:
            message = f"must be greater than zero on a link that moves; {advice}"
            error = mass.error(message, "links", link, "mass", value=0.0)
        faults.add(IDLE if link in idle else MASSLESS, link, error)
