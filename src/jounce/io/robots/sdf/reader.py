"""Robots from SDF files, which may contain loops: a spanning tree is chosen, and the other joints close loops."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import RobotError
from jounce.io.robots.closure_files import CLOSED_BY
from jounce.io.robots.elements.faults import LOOSE, Faults
from jounce.io.robots.elements.followers import with_room
from jounce.io.robots.elements.named_elements import NamedElements
from jounce.io.robots.elements.xml_elements import Element
from jounce.io.robots.sdf.joints import AXIS_TAGS, SdfJoint, pitch_of, read_joint
from jounce.io.robots.sdf.left_out import note_fluids, note_left_out
from jounce.io.robots.sdf.links import gravity_of, read_inertia
from jounce.io.robots.sdf.models import chosen_model
from jounce.io.robots.sdf.poses import (
    IDENTITY,
    WORLD,
    FramePose,
    Frames,
    flag_of,
    needed,
    number_of,
    text_of,
)
from jounce.io.robots.sdf.scopes import named
from jounce.robot.model.floating_base import floating_joints
from jounce.robot.model.links_and_joints import Closure, Joint, Link
from jounce.robot.model.mimics import Mimic, leaders
from jounce.robot.robot import Robot

TREE_FIRST = ("fixed", "screw", "revolute", "continuous", "prismatic", "universal", "revolute2", "ball")
OF_AXIS = ("armature", "damping", "friction", "stiffness", "spring_reference")
AXIS_TOLERANCE = 1e-5  # files give directions with six digits
DRAKE_MIMIC = "drake:mimic"
BALL = "drake:ball_constraint"


def read_sdf(
    root: Element, faults: Faults, model: str | None = None, allow: Iterable[str | PathLike[str]] = ()
) -> Robot:
    """Return the robot of an SDF file; its loops become closures.

    Of several models, the one with the given name is read, or the only one that moves. Models that it nests or includes
    are part of it, their links and joints under names such as ``arm::elbow``. The base is the link ``world`` if a joint
    connects the model to it or the model is static, else the canonical link of the model. Gravity is that of the world
    in the file, or 9.81 m/s^2 along its -z; links may be free of it.

    The tree takes screws first, then joints of one axis, of two axes, and balls, each in the order of the file. Every
    other joint becomes a closure: a revolute joint a pin, a prismatic one a slider, a ball a point, a fixed one a weld.
    A joint of the tree whose child is nearer to the base is reversed, about the opposite axis, so that its coordinate
    stays that of the file. A universal joint becomes two turns, a ball three turns about moving axes z, y, x, with
    massless links between them. A joint whose axis does not pass through the origin of its child has a massless link. A
    screw is a turn and a travel that follows it. A gearbox makes the second of its two joints follow the first, as
    ``drake:mimic`` does for one joint; rotors that Drake reads become armature.

    A link without ``<inertial>`` has a mass of 1 kg, as SDF states, with a warning. Sensors, plugins, and limits of
    joints that close a loop are left out. Springs, damping and friction of such joints, and decaying velocities, are
    left out with a warning. There is also a warning of a static model with movable joints: a simulator holds it still,
    and here its joints have coordinates. Links without a connection to the base have six coordinates, which are zero in
    the pose of the file, with a warning.

    Parameters
    ----------
    root : Element
        Element ``<sdf>``.
    faults : Faults
        Records values that no real robot has, and parts that are left out.
    model : str, optional
        Name of the model.
    allow
        Folders besides that of the file below which included models may lie.

    Raises
    ------
    RobotFileError
        If something is missing, unknown or impossible; the message has the line.
    """
    chosen = chosen_model(root, faults, model, allow)
    frames = Frames(chosen.model, named(chosen.model))
    return _Reader(frames, chosen.pose, chosen.world, chosen.version, faults).robot()


class _Reader:
    """Converts the links and joints of a model to a tree with closures."""

    def __init__(
        self, frames: Frames, pose: FramePose, world: Element | None, version: tuple[int, ...], faults: Faults
    ):
        self.frames, self.pose, self.world, self.version, self.faults = frames, pose, world, version, faults
        self.model, self.elements, self.lines = frames.model, frames.elements, NamedElements(frames.model)
        self.links: list[Link] = []
        self.joints: list[Joint] = []
        self.taken = {WORLD, *self.elements}
        self.coordinates: dict[tuple[str, str], str] = {}  # of joints with two axes, by joint and axis
        for name, element in self.elements.items():
            self.lines.add(element, f"{element.tag}s", name)
            self.lines.add(element, "closures", name)

    def robot(self) -> Robot:
        """Return the robot."""
        elements = {name: element for name, element in self.elements.items() if element.tag == "link"}
        inertias = {name: read_inertia(name, element, self.frames, self.faults) for name, element in elements.items()}
        every = [
            read_joint(name, x, self.frames, self.version) for name, x in self.elements.items() if x.tag == "joint"
        ]
        gears = [joint for joint in every if joint.kind == "gearbox"]
        joints = [joint for joint in every if joint.kind != "gearbox"]
        to_world = any(WORLD in (joint.parent, joint.child) for joint in joints)
        fixed = flag_of(self.model, "static", "static")
        canonical = self.frames.canonical_link()
        base = WORLD if to_world or fixed else canonical
        tree, closing = self._divided(joints, base, [*inertias, *([WORLD] if base == WORLD else [])], fixed)
        self.links += [Link(WORLD)] if base == WORLD else []
        pulled = {name: flag_of(element, "gravity", "links", name, default=True) for name, element in elements.items()}
        self.links += [Link(name, inertia, float(pulled[name])) for name, inertia in inertias.items()]
        for joint in tree:
            if len(joint.axes) == 2:
                numbered = ((joint.name, tag, self._unused(f"{joint.name}_{k}")) for k, tag in enumerate(AXIS_TAGS, 1))
                self.coordinates |= {(name, tag): coordinate for name, tag, coordinate in numbered}
        mimics = self._mimics(tree, gears)
        for joint in tree:
            self._add(joint, mimics)
        closures = [self._closure(joint) for joint in closing] + self._ball_constraints()
        note_left_out(self.model, elements, tree, closing, self.faults)
        for holder in (self.model,) if self.world is None else (self.world, self.model):
            note_fluids(holder, self.faults)
        name = self.model.attributes.get("name", "robot")
        upright = self.pose.then(self._link_pose(base)).rotation if base != WORLD else np.eye(3)
        gravity = upright.T @ gravity_of(self.world)
        try:
            joints = with_room(self.joints, self.faults, self.lines.located)
            return Robot(name, self.links, joints, gravity, closures, strict=False)
        except RobotError as error:
            raise self.lines.located(error) from None

    def _link_pose(self, link: str) -> FramePose:
        """Return the pose of a link in the model."""
        return IDENTITY.seen_from(self.pose) if link == WORLD else self.frames.pose(link)

    def _divided(
        self, joints: Sequence[SdfJoint], base: str, links: Sequence[str], fixed: bool
    ) -> tuple[list[SdfJoint], list[SdfJoint]]:
        """Return the joints of a spanning tree, each directed away from the base, and the joints that close loops."""
        group = {link: link for link in links}

        def head(link: str) -> str:
            while group[link] != link:
                group[link] = link = group[group[link]]
            return link

        joints, chosen = list(joints), set()
        for joint in sorted(joints, key=lambda joint: TREE_FIRST.index(joint.kind)):
            first, second = head(joint.parent), head(joint.child)
            if first != second:
                group[second] = first
                chosen.add(joint.name)
        for link in links:
            if head(link) != head(base):
                loose = self._loose(link, base, fixed)
                joints.append(loose)
                group[head(link)] = head(base)
                chosen.add(loose.name)
        tree, reached = [], {base}
        pending = [joint for joint in joints if joint.name in chosen]
        while pending:
            deferred = []
            for joint in pending:
                if joint.parent in reached or joint.child in reached:
                    outward = joint if joint.parent in reached else joint.reversed()
                    tree.append(outward)
                    reached.add(outward.child)
                else:
                    deferred.append(joint)
            pending = deferred
        return tree, [joint for joint in joints if joint.name not in chosen]

    def _loose(self, link: str, base: str, fixed: bool) -> SdfJoint:
        """Return a joint between the base and a link without a connection: free, or fixed in a static model."""
        element, origin = self.elements[link], self.frames.pose(link).position
        if fixed:
            return SdfJoint(self._unused(f"{link}_{WORLD}"), "fixed", WORLD, link, origin, (), self.model)
        message = f"is joined to {base} by nothing; give it a joint, or take it for free without strict"
        self.faults.add(LOOSE, link, element.error(message, "links", link))
        return SdfJoint(link, "free", base, link, origin, (), element)

    def _unused(self, name: str) -> str:
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        return name

    def _add(self, joint: SdfJoint, mimics: dict[str, Mimic]) -> None:
        """Add a joint of the tree, with the massless links that it needs."""
        parent, child = self._link_pose(joint.parent), self._link_pose(joint.child)
        joint_frame = FramePose(joint.origin, child.rotation)  # frame of the joint, with the axes of the child
        offset_origin = joint.kind != "fixed" and bool(np.any(np.abs(joint.origin - child.position) > 1e-12))
        intermediate = self._unused(f"{joint.child}_{joint.name}") if offset_origin else joint.child
        if offset_origin:
            self.links.append(Link(intermediate))
        first = (child if joint.kind == "fixed" else joint_frame).seen_from(parent)
        for part in self._parts(joint, intermediate, child.rotation, mimics):
            self.joints.append(dataclasses.replace(part, position=first.position, rotation=first.rotation))
            self.lines.add(joint.element, "joints", part.name)
            first = IDENTITY
        if offset_origin:
            offset = child.seen_from(joint_frame).position
            self.joints.append(Joint(self._unused(f"{joint.child}_fixed"), intermediate, joint.child, "fixed", offset))

    def _parts(
        self, joint: SdfJoint, child: str, rotation: Float[np.ndarray, "3 3"], mimics: dict[str, Mimic]
    ) -> list[Joint]:
        """Return the joints that represent a joint, from its parent to a given link, all at one point."""
        if joint.kind in ("ball", "free"):
            return self._turns(joint, child)
        if joint.kind == "fixed":
            return [Joint(joint.name, joint.parent, child, "fixed")]
        joints = []
        for axis in joint.axes:
            is_last = axis is joint.axes[-1]
            name = self.coordinates.get((joint.name, axis.tag), joint.name)
            end = child if is_last else self._unused(f"{joint.name}_frame")
            if not is_last:
                self.links.append(Link(end))
            bounded = axis.limits.lower is not None or axis.limits.upper is not None
            kind = "prismatic" if joint.kind == "prismatic" else "revolute" if bounded else "continuous"
            start = joints[-1].child if joints else joint.parent
            direction = rotation.T @ axis.direction
            arguments: dict[str, Any] = {"axis": direction, "limits": axis.limits, "mimic": mimics.get(name)}
            arguments |= {field: getattr(axis, field) for field in OF_AXIS}
            joints.append(Joint(name, start, end, kind, **arguments))
        if joint.kind == "screw":
            joints = self._screw(joint, joints[0], child)
        return joints

    def _screw(self, joint: SdfJoint, turn: Joint, child: str) -> list[Joint]:
        """Return the turn of a screw, and the travel along its axis that follows the turn."""
        middle = self._unused(f"{joint.name}_frame")
        self.links.append(Link(middle))
        pitch = pitch_of(joint.element, "joints", joint.name)
        leader = turn.mimic or Mimic(joint.name)
        travel = Mimic(leader.joint, pitch * leader.multiplier, pitch * leader.offset)
        slide = Joint(self._unused(f"{joint.name}_travel"), middle, child, "prismatic", axis=turn.axis, mimic=travel)
        return [dataclasses.replace(turn, child=middle), slide]

    def _turns(self, joint: SdfJoint, child: str) -> list[Joint]:
        """Return the three turns of a ball, or the six joints of a free link, with unused names."""
        turns, parent = floating_joints(child, prefix=joint.name)[1], joint.parent
        turns = turns[3:] if joint.kind == "ball" else turns
        for k, turn in enumerate(turns):
            end = child if turn is turns[-1] else self._unused(turn.child)
            if end != child:
                self.links.append(Link(end))
            turns[k] = dataclasses.replace(turn, name=self._unused(turn.name), parent=parent, child=end)
            parent = end
        return turns

    def _closure(self, joint: SdfJoint) -> Closure:
        """Return the closure of a joint that closes a loop."""
        if joint.kind not in CLOSED_BY:
            message = f"a {joint.kind} joint closes a loop here; make it two revolute joints with a link between"
            raise joint.element.error(message, "joints", joint.name, value=joint.kind)
        mimics = [x for axis in joint.element.every("axis") for x in axis.every("mimic")]
        mimics += joint.element.every(DRAKE_MIMIC)
        if mimics:
            message = "closes a loop, and so has no coordinate that could follow another"
            raise mimics[0].error(message, "joints", joint.name, "mimic")
        ends = self._link_pose(joint.parent), self._link_pose(joint.child)
        points = [FramePose(joint.origin, np.eye(3)).seen_from(pose).position for pose in ends]
        axis = ends[0].rotation.T @ joint.axes[0].direction if joint.axes else None
        turn = None if joint.kind == "ball" else ends[1].seen_from(ends[0]).rotation
        links = (joint.parent, joint.child)
        try:
            return Closure(
                joint.name, links, CLOSED_BY[joint.kind], points, axis, None if joint.kind == "ball" else turn
            )
        except RobotError as error:
            raise self.lines.located(error) from None

    def _ball_constraints(self) -> list[Closure]:
        """Return the ball constraints of Drake, each of which holds a point of one link at a point of another."""
        closures = []
        for k, element in enumerate(self.model.every(BALL)):
            name = self._unused(f"ball_constraint_{k}")
            links, points = [], []
            for body, point in (("A", "AP"), ("B", "BQ")):
                part = needed(element, f"{BALL}_body_{body}", "closures", name)
                place = needed(element, f"{BALL}_p_{point}", "closures", name)
                links.append(self.frames.link(text_of(element, part.tag, "closures", name), part, "closures", name))
                points.append(place.content_numbers(3, "closures", name, place.tag))
            self.lines.add(element, "closures", name)
            try:
                closures.append(Closure(name, links, "connect", points))
            except RobotError as error:
                raise self.lines.located(error) from None
        return closures

    def _mimics(self, tree: Sequence[SdfJoint], gears: Sequence[SdfJoint]) -> dict[str, Mimic]:
        """Return the leaders of joints, by ``<mimic>`` and by gearboxes."""
        mimics: dict[str, Mimic] = {}
        for joint, tag in ((follower, axis.tag) for follower in tree for axis in follower.axes):
            name = self.coordinates.get((joint.name, tag), joint.name)
            mimic = needed(joint.element, tag).only("mimic", "joints", joint.name)
            if mimic is not None:
                location = ("joints", name, "mimic")
                leader = self._leader(mimic, *location)
                factor, offset, reference = (
                    number_of(mimic, key, *location, default=float(key == "multiplier"))
                    for key in ("multiplier", "offset", "reference")
                )
                mimics[name] = Mimic(leader, factor, offset - factor * reference)
                self.lines.add(mimic, *location)
        for joint in tree:
            if (given := joint.element.only(DRAKE_MIMIC, "joints", joint.name)) is not None:
                self._drake_mimic(joint, given, mimics)
        for gear in gears:
            name, mimic = self._gearing(gear, tree)
            if name in mimics:
                message = f"{name} follows {mimics[name].joint} already"
                raise gear.element.error(message, "joints", gear.name)
            mimics[name] = mimic
        return leaders(mimics)

    def _drake_mimic(self, joint: SdfJoint, mimic: Element, mimics: dict[str, Mimic]) -> None:
        """Add the leader of a joint that Drake states as attributes of an element."""
        location = ("joints", joint.name, DRAKE_MIMIC)
        if len(joint.axes) != 1 or joint.name in mimics:
            message = "is for a joint of one axis, and one that follows no other already"
            raise mimic.error(message, *location, value=joint.kind)
        factor, offset = (
            mimic.number(key, *location, default=float(key == "multiplier")) for key in ("multiplier", "offset")
        )
        mimics[joint.name] = Mimic(mimic.text("joint", *location), factor, offset)
        self.lines.add(mimic, "joints", joint.name, "mimic")

    def _leader(self, mimic: Element, *location: str) -> str:
        """Return the leading coordinate of a mimic, about the first or the second axis of a joint."""
        joint, tag = mimic.text("joint", *location), mimic.attributes.get("axis", AXIS_TAGS[0])
        if tag != AXIS_TAGS[0] and (joint, tag) not in self.coordinates:
            raise mimic.error(f"{joint} has no axis of this name", *location, "axis", value=tag)
        return self.coordinates.get((joint, tag), joint)

    def _gearing(self, gear: SdfJoint, tree: Sequence[SdfJoint]) -> tuple[str, Mimic]:
        """Return the follower of a gearbox and its relation: theta_2 = -ratio theta_1 about the axes of the gearbox."""
        location = ("joints", gear.name)
        body = needed(gear.element, "gearbox_reference_body", *location)
        reference = self.frames.link(text_of(gear.element, "gearbox_reference_body", *location), body, *location)
        needed(gear.element, "gearbox_ratio", *location)
        ratio = number_of(gear.element, "gearbox_ratio", *location, default=1.0)
        hinge_signs = []
        for link, axis in zip((gear.parent, gear.child), gear.axes, strict=True):
            joint = next((j for j in tree if {j.parent, j.child} == {reference, link}), None)
            if joint is None or joint.kind not in ("revolute", "continuous"):
                message = f"a gearbox needs a revolute joint between {reference} and {link}, which there is not"
                raise gear.element.error(message, *location, value=[reference, link])
            sign = float(joint.axes[0].direction @ axis.direction) * (1.0 if joint.parent == reference else -1.0)
            if abs(abs(sign) - 1) > AXIS_TOLERANCE:
                message = f"the axis of a gearbox must be that of {joint.name}"
                raise gear.element.error(message, *location, value=axis.direction.tolist())
            hinge_signs.append((joint.name, math.copysign(1.0, sign)))
        (first, sign_1), (second, sign_2) = hinge_signs
        return second, Mimic(first, -ratio * sign_1 * sign_2)
