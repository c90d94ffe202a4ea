"""The bodies, joints, closures and drives of the mechanism of a robot, in the frames of its moving links."""

from collections.abc import Container
from typing import Any

import numpy as np

from jounce.constraints import AbstractConstraint, spatial
from jounce.constraints.drivers import RotationDriver, SpatialSlideDriver
from jounce.errors import RobotError, check_name
from jounce.forces import AbstractForce
from jounce.forces.actuators import SlideForce, SpatialTorque
from jounce.forces.loads import SpatialPointForce
from jounce.forces.springs import SlideSpring, SpatialTorsionalSpring
from jounce.mechanism import AbstractOutput, Body, RelativeAngleOutput
from jounce.mechanism.mechanism import GROUND
from jounce.rigid.euler_parameters import from_rotation_matrices
from jounce.rigid.inertia import Inertia
from jounce.robot.closed_loops.ball_damper import BallDamper
from jounce.robot.closed_loops.closures import LinkClosure
from jounce.robot.closed_loops.coupling import JointPlacement, SlideOutput, coupled
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.robot.model.couplings import BallDrive, Tendon
from jounce.robot.model.links_and_joints import Closure
from jounce.robot.model.mimics import Mimic
from jounce.robot.model.tree import axes_with_z_along
from jounce.robot.recursions.kinematics import forward_kinematics

DAMPING, FRICTION, SPRING, BALL, LIFT = "_damping", "_friction", "_spring", "_ball", "_lift"
ROTOR, GEAR = "_rotor", "_gear"
DRIVES = ("armature", "damping", "friction", "stiffness")


def on_body(robot: AbstractRobot, link: str) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the body of a link, and the pose of the link in the frame of the body."""
    index, position, rotation = robot.frames[link]
    if index < 0:
        return GROUND, position, rotation
    name = robot.moving_links[index]
    if name == link:
        return name, np.zeros(3), np.eye(3)
    to_body = robot.frames[name].rotation.T
    return name, to_body @ position, to_body @ rotation


def rotor_on(base: str, rotor: str) -> JointPlacement:
    """Return the placement of a rotor on the ground, or on another rotor."""
    origin, x, _, z = np.zeros(3), *np.eye(3)
    return JointPlacement((base, rotor), True, origin, z, z, x, x)


class RobotParts:
    """The bodies, joints and drives of a robot, in the frames of its moving links.

    Parameters
    ----------
    robot : Robot
        The robot.
    needed : set of str
        Joints whose coordinates are requested, and which are therefore not merged into a free body or a ball.
    forces, outputs
        Forces and outputs, which may name links that are otherwise merged.
    drives : bool
        Whether armature, damping, friction and springs of the joints are requested.
    """

    def __init__(self, robot: AbstractRobot, needed: set[str], forces: Any, outputs: Any, drives: bool):
        self.balls = [x for x in robot.couplings.values() if isinstance(x, BallDrive)] if drives else []
        if drives:
            _check_couplings(robot)
        self.robot, self.tree = robot, robot.opened().tree
        self.moving = robot.moving_joints
        self.driven = [x for x in self.moving if any(getattr(x, field) for field in DRIVES)] if drives else []
        needed = needed.union(joint.name for joint in self.driven)
        if GROUND in robot.moving_links:
            raise RobotError("a link of this name moves; rename it, it stands for the base", name="links", value=GROUND)
        elements = [*(forces or {}).values(), *(x for x in (outputs or {}).values() if not isinstance(x, str))]
        links = {body for element in elements for body in element.bodies}
        links |= {on_body(robot, link)[0] for closure in robot.closures.values() for link in closure.links}
        self.merged: dict[int, int] = {}  # number of merged joints, by the index of the last joint of a chain
        for k in range(len(self.moving)):
            for count in (6, 3):
                first = k - count + 1
                if first >= 0 and self._is_free(first, count, needed, links) and first not in self._inner():
                    self.merged[k] = count
                    break
        self.rotors: dict[str, str] = {}  # names of the rotors, by joint
        for joint in self.driven:
            if joint.armature:
                self.rotors[joint.name] = _unused(joint.name + ROTOR, {*robot.links, *self.rotors.values()})
        self.sums: dict[
            str, dict[str, str]
        ] = {}  # rotors that add up what is followed, by joint and by what it follows
        for joint in self.moving:
            for leader in joint.mimic.weights if joint.mimic is not None and joint.mimic.several else ():
                taken_names = {
                    *robot.links,
                    *self.rotors.values(),
                    *(x for rotors in self.sums.values() for x in rotors.values()),
                }
                self.sums.setdefault(joint.name, {})[leader] = _unused(f"{joint.name}_{leader}{ROTOR}", taken_names)
        inner = self._inner()
        merged = {self.moving[k].name for k in inner.union(self.merged)}
        self.coordinates = tuple(name for name in robot.joint_names if name not in merged)
        self.links = [joint.child for k, joint in enumerate(self.moving) if k not in inner]

    def _inner(self) -> set[int]:
        """Return the indices of the massless bodies within merged chains."""
        return {k for last, count in self.merged.items() for k in range(last - count + 1, last)}

    def _is_free(self, first: int, count: int, needed: set[str], links: set[str]) -> bool:
        """Whether consecutive joints let a body move freely (6), or turn freely (3), and none of them is requested."""
        robot, tree, chain = self.robot, self.tree, self.moving[first : first + count]
        following = {name for joint in self.moving if joint.mimic is not None for name in joint.mimic.weights}
        if any(joint.mimic is not None or joint.name in needed | following for joint in chain):
            return False
        for k, joint in enumerate(chain[:-1], first):
            children = [other for other in self.moving if robot.frames[other.parent].body == k]
            if tree.mass[k] or children != [chain[k - first + 1]] or joint.child in links:
                return False
        turns = np.arange(first + count - 3, first + count)
        slides = np.arange(first, first + count - 3)
        if not all(tree.turning[turns]) or any(tree.turning[slides]) or np.abs(tree.position[turns[1:]]).max() > 1e-12:
            return False
        if any(abs(tree.rotation[k][2, 2]) > 1e-9 for k in turns[1:]):
            return False  # consecutive axes that are not perpendicular cannot reach all orientations
        if count == 3:
            return True
        axes = [np.eye(3)[2], tree.rotation[slides[1]] @ np.eye(3)[2]]
        axes.append(tree.rotation[slides[1]] @ tree.rotation[slides[2]] @ np.eye(3)[2])
        return bool(abs(np.linalg.det(np.array(axes))) > 1e-3)

    def joint_placement(self, index: int) -> JointPlacement:
        """Return a moving joint in the frames of the two bodies."""
        joint = self.moving[index]
        parent, position, rotation = on_body(self.robot, joint.parent)
        point, rotation = position + rotation @ joint.position, rotation @ joint.rotation
        side = axes_with_z_along(joint.axis)[:, 0]
        return JointPlacement(
            (parent, joint.child), joint.turning, point, rotation @ joint.axis, joint.axis, rotation @ side, side
        )

    def _named(self, name: str) -> JointPlacement:
        return self.joint_placement([joint.name for joint in self.moving].index(name))

    def joints(self) -> dict[str, AbstractConstraint]:
        """Return the joints of the tree, and what couples joints that follow others."""
        joints: dict[str, AbstractConstraint] = {}
        inner = self._inner()
        for k, joint in enumerate(self.moving):
            if k in inner or self.merged.get(k) == 6:
                continue
            if self.merged.get(k) == 3:
                first = self.joint_placement(k - 2)
                bodies = (first.bodies[0], joint.child)
                joints[self.moving[k - 2].name] = spatial.Spherical(bodies, first.point, np.zeros(3))
                continue
            placement = self.joint_placement(k)
            ends = (placement.point, np.zeros(3), placement.axis_i, placement.axis_j)
            if placement.turning:
                joints[joint.name] = spatial.Revolute(placement.bodies, *ends)
            else:
                joints[joint.name] = spatial.Prismatic(placement.bodies, *ends, placement.vector_i, placement.vector_j)
        for joint in self.moving:
            if joint.mimic is not None:
                follower, offset = joint.name, joint.mimic.offset
                base = GROUND
                for leader, rotor in self.sums.get(follower, {}).items():  # each rotor turns on the preceding one
                    bearing = self._add_rotor(rotor, base, joints)
                    pair = (self._named(leader), bearing)
                    joints[self._unique_name(f"{follower}_{leader}{GEAR}", joints)] = coupled(
                        *pair, joint.mimic.weights[leader], 0.0, in_space=base == GROUND
                    )
                    base = rotor
                if joint.mimic.several:
                    sides = (self._named(follower), rotor_on(GROUND, base))
                    coupling = coupled(*sides, 1.0, -offset, in_space=True)
                else:
                    coupling = coupled(
                        self._named(joint.mimic.joint), self._named(follower), joint.mimic.multiplier, offset
                    )
                joints[self._unique_name(f"{follower}_mimic", joints)] = coupling
        for name, rotor in self.rotors.items():
            bearing = self._add_rotor(rotor, GROUND, joints)
            joints[self._unique_name(name + GEAR, joints)] = coupled(
                self._named(name), bearing, 1.0, 0.0, in_space=True
            )
        return joints

    def _add_rotor(self, rotor: str, base: str, joints: dict[str, AbstractConstraint]) -> JointPlacement:
        """Add the bearing of a rotor, and return its placement."""
        bearing = rotor_on(base, rotor)
        joints[self._unique_name(rotor, joints)] = spatial.Revolute(
            bearing.bodies, bearing.point, bearing.point, bearing.axis_i, bearing.axis_j
        )
        return bearing

    def _unique_name(self, name: str, taken_names: Any) -> str:
        return _unused(name, {*taken_names, *self.robot.joints, *self.robot.closures})

    def closure(self, closure: Closure, wrenches: np.ndarray) -> LinkClosure:
        """Return the closure of a loop, along the directions of wrenches in the frame of the first link."""
        ends = [on_body(self.robot, link) for link in closure.links]
        points = [position + rotation @ p for (_, position, rotation), p in zip(ends, closure.points, strict=True)]
        (first, _, rotation), (second, _, rotation_j) = ends
        axes = np.kron(np.eye(2), rotation.T)
        attitude = {}
        if np.any(wrenches[:, 3:]):
            quaternion = from_rotation_matrices(rotation @ closure.rotation @ rotation_j.T)
            attitude = {"vector_part": quaternion[1:], "scalar_part": float(quaternion[0])}
        return LinkClosure((first, second), points[0], points[1], wrenches @ axes, **attitude)

    def driver(self, name: str, law: Any) -> AbstractConstraint:
        """Return the driver of a coordinate."""
        placement = self._named(name)
        if placement.turning:
            return RotationDriver(placement.bodies, placement.axis_i, law, placement.vector_i, placement.vector_j)
        return SpatialSlideDriver(placement.bodies, placement.point, np.zeros(3), placement.axis_i, law)

    def output(self, name: str, joint: str) -> AbstractOutput:
        """Return the coordinate of a joint as an output."""
        check_name("moving joint", joint, [j.name for j in self.moving], RobotError, name=f"outputs.{name}")
        placement = self._named(joint)
        if placement.turning:
            return RelativeAngleOutput(placement.bodies, placement.axis_i, placement.vector_i, placement.vector_j)
        return SlideOutput(placement.bodies, placement.point, np.zeros(3), placement.axis_i)

    def losses(self) -> dict[str, AbstractForce]:
        """Return the dampers and springs of the joints, their dry friction, and the forces that carry links."""
        forces: dict[str, AbstractForce] = self._lifts()
        for ball in self.balls:
            if ball.damping or ball.friction:
                parent = on_body(self.robot, self.robot.joints[ball.joints[0]].parent)[0]
                bodies = (parent, self.robot.joints[ball.joints[-1]].child)
                forces[ball.name + BALL] = BallDamper(bodies, damping=ball.damping, friction=ball.friction)
        for joint in self.driven:
            placement, law = self._named(joint.name), friction_law(joint.friction)
            turn = {"axis_i": placement.axis_i, "vector_i": placement.vector_i, "vector_j": placement.vector_j}
            ends = {"point_i": placement.point, "point_j": np.zeros(3), "vector_i": placement.axis_i}
            if joint.damping:
                kind, fields = (SpatialTorsionalSpring, turn) if placement.turning else (SlideSpring, ends)
                forces[joint.name + DAMPING] = kind(placement.bodies, **fields, stiffness=0.0, damping=joint.damping)
            if joint.stiffness:
                kind, fields = (SpatialTorsionalSpring, turn) if placement.turning else (SlideSpring, ends)
                reference = {"angle" if placement.turning else "length": joint.spring_reference}
                forces[joint.name + SPRING] = kind(placement.bodies, **fields, stiffness=joint.stiffness, **reference)
            if joint.friction:
                kind, fields = (SpatialTorque, turn) if placement.turning else (SlideForce, ends)
                forces[joint.name + FRICTION] = kind(placement.bodies, **fields, law=law)
        return forces

    def _lifts(self) -> dict[str, AbstractForce]:
        """Return the forces that carry links with a share of gravity below one."""
        lifts: dict[str, AbstractForce] = {}
        for name, link in self.robot.links.items():
            body, position, rotation = on_body(self.robot, name)
            if link.inertia is None or link.gravity == 1 or body == GROUND:
                continue
            weight = link.inertia.mass * (1.0 - link.gravity) * np.asarray(self.robot.gravity)
            center = position + rotation @ np.asarray(link.inertia.center_of_mass)
            law = [repr(float(-x)) for x in weight]
            lifts[name + LIFT] = SpatialPointForce((body,), center, law)
        return lifts

    def bodies(self, q: np.ndarray) -> dict[str, Body]:
        """Return the moving bodies with their masses, at the pose that the coordinates give.

        Armature is inertia against the rate of a coordinate alone, of which the links know nothing: it is that of a
        rotor on the ground, without mass, that turns by as many radians as the coordinate has radians or meters. What
        turns it acts on the joint alone: the ground does not feel it.
        """
        robot, tree = self.robot, self.robot.opened()
        masses: dict[str, list[Inertia]] = {name: [] for name in self.links}
        for name, link in robot.links.items():
            body, position, rotation = on_body(robot, name)
            if link.inertia is not None and body != GROUND:
                masses[body].append(link.inertia.moved(position, rotation))
        for ball in self.balls:  # its parent does not turn, so that its armature acts as inertia of the link
            if ball.armature:
                armature = Inertia(0.0, tensor=ball.armature * np.eye(3), strict=False)
                masses[robot.joints[ball.joints[-1]].child].append(armature)
        bodies = {}
        for name, parts in masses.items():
            pose = forward_kinematics(tree, q[None], name)
            combined = Inertia.total(parts) if parts else None
            bodies[name] = Body(
                pose.position[0].tolist(),
                orientation=from_rotation_matrices(np.asarray(pose.rotation[0])).tolist(),
                mass=None if combined is None else combined.mass,
                inertia=None if combined is None else combined.tensor,
                center_of_mass=None if combined is None else combined.center_of_mass,
            )
        values = dict(zip(robot.joint_names, q.tolist(), strict=True))
        for name, rotor in self.rotors.items():
            angle = values[name] if name in values else (robot.joints[name].mimic or Mimic(name)).held(values)
            inertia = [robot.joints[name].armature] * 3
            bodies[rotor] = Body([0.0] * 3, orientation=_turned(angle), mass=0.0, inertia=inertia)
        for name, rotors in self.sums.items():
            mimic, angle = robot.joints[name].mimic or Mimic(name), 0.0
            for leader, rotor in rotors.items():
                angle += mimic.weights[leader] * values[leader]
                bodies[rotor] = Body([0.0] * 3, orientation=_turned(angle))
        return bodies


def _turned(angle: Any) -> dict[str, Any]:
    return {"axis": [0.0, 0.0, 1.0], "angle": float(angle)}


def friction_law(friction: Any) -> str:
    """Return the law of Coulomb friction, which may depend on the direction."""
    forward, backward = np.broadcast_to(friction, 2).tolist()
    if forward == backward:
        return f"-{forward!r}*sign(v)"
    return f"-{(forward + backward) / 2!r}*sign(v) - {(forward - backward) / 2!r}*abs(sign(v))"


def _check_couplings(robot: AbstractRobot) -> None:
    """Check that a mechanism has forces and inertias for the couplings of several joints.

    Raises
    ------
    RobotError
        If a tendon has a spring, damping, friction or armature, or a link that turns carries a ball with armature.
    """
    advice = "leave it out with drives=False, or take all that it has from the robot"
    for coupling in robot.couplings.values():
        location = f"couplings.{coupling.name}"
        if isinstance(coupling, Tendon):
            if any((coupling.stiffness, coupling.damping, coupling.friction, coupling.armature)):
                raise RobotError(f"a tendon along joints has no counterpart in a mechanism; {advice}", name=location)
            continue
        body = robot.frames[robot.joints[coupling.joints[0]].parent].body
        turns = robot.opened().tree.ancestors[body] * robot.opened().tree.turning if body >= 0 else np.zeros(1)
        if coupling.armature and np.any(turns):
            message = "the armature of a ball whose parent turns has no counterpart in a mechanism"
            raise RobotError(f"{message}; {advice}", name=f"{location}.armature", value=coupling.armature)


def _unused(name: str, taken_names: Container[str]) -> str:
    while name in taken_names:
        name += "_"
    return name
