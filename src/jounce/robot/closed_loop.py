"""A robot as a mechanism: bodies with masses, joints, loops closed, drives that prescribe coordinates."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jounce.constraints import AbstractConstraint, spatial
from jounce.constraints.drivers import RotationDriver, SpatialSlideDriver
from jounce.errors import JounceError, RobotError, did_you_mean
from jounce.forces import AbstractForce
from jounce.forces.springs import SlideSpring, SpatialTorsionalSpring
from jounce.jet import Jet
from jounce.mechanism import Body, Mechanism, RelativeAngleOutput, time_grid
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.resolve import resolve_motion
from jounce.rigid.inertia import Inertia, finite_numbers
from jounce.robot.closures import LinkClosure, Loops
from jounce.robot.coupling import Placed, SlideOutput, coupled
from jounce.robot.kinematics import forward_kinematics
from jounce.robot.model import Closure
from jounce.robot.robot import Robot
from jounce.robot.tree import axes_with_z_along

DRIVE, START, DAMPING = "_drive", "_start", "_damping"


def mechanism(
    robot: Robot,
    q: Any = None,
    *,
    drivers: Any = None,
    initial: Mapping[str, Any] | None = None,
    forces: Mapping[str, AbstractForce] | None = None,
    outputs: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Any] | None = None,
    time: Any = None,
    drives: bool = False,
) -> Mechanism:
    """Return a robot as a spatial mechanism, with masses and gravity, its loops closed.

    Each moving link is a body of that name, whose frame is that of the link; links fixed to it are part of it, the base
    is the ground. Joints and closures keep their names. The six joints of a base that floats, and the three turns of a
    ball, are one free body, and one spherical joint, unless a coordinate of theirs is driven. A closure holds in those
    directions only in which the joints do not hold already (`closure_wrenches`).

    Parameters
    ----------
    robot : Robot
        With closures or without.
    q : array_like of shape (n,) or dict of str to float, optional
        Coordinates near which the mechanism is put together, zero unless given. Driven joints start where their laws
        do, the others are moved until the loops are closed.
    drivers : dict of str to law, or JointTrajectory, optional
        Laws of coordinates, by name of the joint: expressions of t, functions of time, motions or numbers; rad or m.
        The driver of joint A is named ``A_drive``, and its force is the torque or force of the joint.
    initial : dict of str to law, optional
        Coordinates that hold at the start of a simulation only, named ``A_start``.
    forces : dict of str to AbstractForce, optional
        Applied forces; their bodies are moving links, or ``"ground"``.
    outputs : dict of str to AbstractOutput or str, optional
        Quantities wanted; a word is the name of a joint whose coordinate is wanted. Unless given, the coordinates of
        all joints in `joint_names` under their names. An angle starts between half a turn either side of zero.
    parameters : dict of str to number or expression, optional
        Named values for laws and forces.
    time : array_like or TimeGrid, optional
        Instants to solve for, s; of a trajectory, its own unless given.
    drives : bool, default False
        Add the viscous damping of the joints, as forces named ``A_damping``. Armature inertia and Coulomb friction
        cannot be had in a mechanism, and are then refused; without, all three are left out.

    Returns
    -------
    Mechanism
        Square where as many joints are driven as the robot has degrees of freedom.

    Raises
    ------
    RobotError
        If a name or a value does not fit the robot, the loops cannot be closed near q, or `drives` finds armature or
        friction.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    >>> pendulum = jn.Robot("pendulum", links, [pin]).mechanism(drivers={"pin": "0.5*t**2"})
    >>> motion = jn.solve(pendulum, [0.0, 1.0], order=2)
    >>> motion.outputs["pin"].round(12).tolist()
    [[0.0, 0.0, 1.0], [0.5, 1.0, 1.0]]
    """
    if time is None:
        time = getattr(drivers, "times", None)
    laws = {"drivers": getattr(drivers, "laws", drivers) or {}, "initial": initial or {}}
    driven = {name: law for kind in laws.values() for name, law in kind.items()}
    for kind, given in laws.items():
        for name in given:
            if name not in robot.joint_names:
                message = f"no moving joint that follows no other has this name; {_known(robot, name)}"
                raise RobotError(message, name=kind, value=name)
    parts = _Parts(robot, {*driven, *(x for x in (outputs or {}).values() if isinstance(x, str))}, forces, outputs)
    wanted = {name: name for name in parts.coordinates} if outputs is None else outputs
    start = _start(robot, q, driven, parameters or {}, time)
    joints = parts.joints()
    if robot.closures:
        loops = Loops(robot, size_of(robot))
        free = np.array([name not in driven for name in robot.joint_names], bool)
        start = loops.closed(start, free)
        found = zip(robot.closures.values(), loops.independent(start), strict=True)
        joints |= {closure.name: parts.closure(closure, kept) for closure, (kept, _) in found if len(kept)}
    applied = dict(forces or {})
    if drives:
        applied |= parts.damping()
    return Mechanism(
        space="spatial",
        bodies=parts.bodies(start),
        joints=joints,
        drivers={name + DRIVE: parts.driver(name, law) for name, law in laws["drivers"].items()},
        initial={name + START: parts.driver(name, law) for name, law in laws["initial"].items()},
        forces=applied,
        outputs={name: parts.output(name, x) if isinstance(x, str) else x for name, x in wanted.items()},
        parameters=parameters or {},
        gravity=robot.gravity.tolist(),
        time=time,
        title=robot.name,
    )


def _known(robot: Robot, name: Any) -> str:
    return did_you_mean(name, robot.joint_names)


def given_coordinates(robot: Robot, q: Any) -> np.ndarray:
    """Return coordinates from an array, or from values by name of the joint; zero where none are given."""
    if q is None or isinstance(q, Mapping):
        return robot.coordinates(**(q or {}))
    return np.array(finite_numbers("q", q, (len(robot.joint_names),)))


def _start(robot: Robot, q: Any, laws: Mapping[str, Any], parameters: Mapping[str, Any], time: Any) -> np.ndarray:
    """Return the coordinates to start from: those given, and what the laws say of the driven joints."""
    start = given_coordinates(robot, q)
    if laws:
        values = Mechanism(
            space="spatial", bodies={"any": Body([0.0] * 3)}, joints={}, parameters=parameters
        ).parameter_values
        instant = Jet([np.full((1, 1), 0.0 if time is None else time_grid(time, values)[0])])
        for name, law in laws.items():
            try:
                value = float(np.squeeze(resolve_motion(law, values)(instant).coefficients[0]))
            except JounceError as error:
                raise error.located(name=f"drivers.{name}") from None
            if not np.isfinite(value):
                message = f"the law has no finite value at t = {float(instant.coefficients[0][0, 0]):g} s"
                raise RobotError(message, name=f"drivers.{name}", value=value)
            start[robot.joint_names.index(name)] = value
    return start


def size_of(robot: Robot) -> float:
    """Return a length of the robot, m: the largest distance from a joint to the next, or from a joint to a closure."""
    lengths = [float(np.linalg.norm(joint.position)) for joint in robot.joints.values()]
    lengths += [float(np.linalg.norm(p)) for closure in robot.closures.values() for p in closure.points]
    return max(lengths, default=0.0) or 1.0


def body_point(robot: Robot, link: str, point: Any = (0.0, 0.0, 0.0)) -> tuple[str, np.ndarray]:
    """Return the body of a mechanism that a link is part of, and where a point of the link is in the frame of the body.

    Parameters
    ----------
    robot : Robot
        The robot.
    link : str
        Name of the link; the base and what is fixed to it are the ground.
    point : array_like of shape (3,), default the origin
        In the frame of the link, m.

    Returns
    -------
    tuple of str and array of shape (3,)
        Name of the body, and the point in its frame, m.

    Raises
    ------
    RobotError
        If there is no such link.

    Examples
    --------
    >>> import jounce as jn
    >>> arm = jn.load_robot("examples/robots/planar_arm.xml")
    >>> body, point = jn.robot.body_point(arm, "ram", [0.1, 0, 0])
    >>> body, point.tolist()
    ('ram', [0.1, 0.0, 0.0])
    """
    if link not in robot.links:
        raise RobotError(f"no link has this name; {did_you_mean(link, robot.links)}", name="link", value=link)
    body, position, rotation = _on_body(robot, link)
    return body, position + rotation @ finite_numbers("point", point, (3,))


def _on_body(robot: Robot, link: str) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the body that a link is part of, and the pose of the link in its frame."""
    index, position, rotation = robot.frames[link]
    if index < 0:
        return GROUND, position, rotation
    name = robot.moving_links[index]
    if name == link:
        return name, np.zeros(3), np.eye(3)
    turned = robot.frames[name].rotation.T
    return name, turned @ position, turned @ rotation


class _Parts:
    """The bodies, joints and drives of a robot, in the frames of its moving links.

    Parameters
    ----------
    robot : Robot
        The robot.
    kept : set of str
        Joints whose coordinates are wanted, so that they are not merged into a free body or a ball.
    forces, outputs
        What may name links that are otherwise merged.
    """

    def __init__(self, robot: Robot, kept: set[str], forces: Any, outputs: Any):
        self.robot, self.tree = robot, robot.opened().tree
        self.moving = [joint for joint in robot.joints.values() if joint.moving]
        if GROUND in robot.moving_links:
            raise RobotError("a link of this name moves; rename it, it stands for the base", name="links", value=GROUND)
        elements = [*(forces or {}).values(), *(x for x in (outputs or {}).values() if not isinstance(x, str))]
        links = {body for element in elements for body in element.bodies}
        links |= {_on_body(robot, link)[0] for closure in robot.closures.values() for link in closure.links}
        self.merged: dict[int, int] = {}  # by index of the last joint of a chain, how many joints are one
        for k in range(len(self.moving)):
            for count in (6, 3):
                first = k - count + 1
                if first >= 0 and self._is_free(first, count, kept, links) and first not in self._inner():
                    self.merged[k] = count
                    break
        inner = self._inner()
        self.coordinates = tuple(
            name for name in robot.joint_names if name not in inner_names(self.moving, self.merged)
        )
        self.links = [joint.child for k, joint in enumerate(self.moving) if k not in inner]

    def _inner(self) -> set[int]:
        """Return the indices of the massless bodies within merged chains."""
        return {k for last, count in self.merged.items() for k in range(last - count + 1, last)}

    def _is_free(self, first: int, count: int, kept: set[str], links: set[str]) -> bool:
        """Whether joints in a row let a body move freely (6), or turn freely (3), and nobody asks for one of them."""
        robot, tree, chain = self.robot, self.tree, self.moving[first : first + count]
        following = {joint.mimic.joint for joint in self.moving if joint.mimic is not None}
        if any(joint.mimic is not None or joint.name in kept | following for joint in chain):
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
            return False  # neighbours not at right angles cannot turn a body every way
        if count == 3:
            return True
        axes = [np.eye(3)[2], tree.rotation[slides[1]] @ np.eye(3)[2]]
        axes.append(tree.rotation[slides[1]] @ tree.rotation[slides[2]] @ np.eye(3)[2])
        return bool(abs(np.linalg.det(np.array(axes))) > 1e-3)

    def placed(self, index: int) -> Placed:
        """Return a moving joint in the frames of the two bodies."""
        joint = self.moving[index]
        parent, position, rotation = _on_body(self.robot, joint.parent)
        point, rotation = position + rotation @ joint.position, rotation @ joint.rotation
        side = axes_with_z_along(joint.axis)[:, 0]
        return Placed(
            (parent, joint.child), joint.turning, point, rotation @ joint.axis, joint.axis, rotation @ side, side
        )

    def _named(self, name: str) -> Placed:
        return self.placed([joint.name for joint in self.moving].index(name))

    def joints(self) -> dict[str, AbstractConstraint]:
        """Return the joints of the tree, and what couples joints that follow others."""
        found: dict[str, AbstractConstraint] = {}
        inner = self._inner()
        for k, joint in enumerate(self.moving):
            if k in inner or self.merged.get(k) == 6:
                continue
            if self.merged.get(k) == 3:
                first = self.placed(k - 2)
                bodies = (first.bodies[0], joint.child)
                found[self.moving[k - 2].name] = spatial.Spherical(bodies, first.point, np.zeros(3))
                continue
            at = self.placed(k)
            ends = (at.point, np.zeros(3), at.axis_i, at.axis_j)
            if at.turning:
                found[joint.name] = spatial.Revolute(at.bodies, *ends)
            else:
                found[joint.name] = spatial.Prismatic(at.bodies, *ends, at.vector_i, at.vector_j)
        for joint in self.moving:
            if joint.mimic is not None:
                pair = (self._named(joint.mimic.joint), self._named(joint.name))
                found[self._unused(f"{joint.name}_mimic", found)] = coupled(
                    *pair, joint.mimic.multiplier, joint.mimic.offset
                )
        return found

    def _unused(self, name: str, taken: Any) -> str:
        while name in taken or name in self.robot.joints or name in self.robot.closures:
            name += "_"
        return name

    def closure(self, closure: Closure, wrenches: np.ndarray) -> LinkClosure:
        """Return what closes a loop, in the directions of the wrenches given in the frame of the first link."""
        ends = [_on_body(self.robot, link) for link in closure.links]
        points = [at + turned @ p for (_, at, turned), p in zip(ends, closure.points, strict=True)]
        (first, _, turned), (second, _, other) = ends
        axes = np.kron(np.eye(2), turned.T)
        attitude = {}
        if np.any(wrenches[:, 3:]):
            quaternion = _quaternion(turned @ closure.rotation @ other.T)
            attitude = {"vector_part": quaternion[1:], "scalar_part": float(quaternion[0])}
        return LinkClosure((first, second), points[0], points[1], wrenches @ axes, **attitude)

    def driver(self, name: str, law: Any) -> AbstractConstraint:
        """Return the driver of a coordinate."""
        at = self._named(name)
        if at.turning:
            return RotationDriver(at.bodies, at.axis_i, law, at.vector_i, at.vector_j)
        return SpatialSlideDriver(at.bodies, at.point, np.zeros(3), at.axis_i, law)

    def output(self, name: str, joint: str) -> Any:
        """Return the coordinate of a joint as an output."""
        if joint not in [other.name for other in self.moving]:
            message = f"no moving joint has this name; {did_you_mean(joint, [j.name for j in self.moving])}"
            raise RobotError(message, name=f"outputs.{name}", value=joint)
        at = self._named(joint)
        if at.turning:
            return RelativeAngleOutput(at.bodies, at.axis_i, at.vector_i, at.vector_j)
        return SlideOutput(at.bodies, at.point, np.zeros(3), at.axis_i)

    def damping(self) -> dict[str, AbstractForce]:
        """Return the dampers of the joints; refuse what a mechanism cannot have."""
        found: dict[str, AbstractForce] = {}
        for k, joint in enumerate(self.moving):
            for field in ("armature", "friction"):
                if getattr(joint, field):
                    message = (
                        f"{field} of a drive has no counterpart in a mechanism; leave drives=False and add its part to "
                        "the force of the driver, or set it to zero"
                    )
                    raise RobotError(message, name=f"joints.{joint.name}.{field}", value=getattr(joint, field))
            if not joint.damping:
                continue
            at, damper = self.placed(k), {"stiffness": 0.0, "damping": joint.damping}
            if at.turning:
                turn = {"axis_i": at.axis_i, "vector_i": at.vector_i, "vector_j": at.vector_j}
                found[joint.name + DAMPING] = SpatialTorsionalSpring(at.bodies, **turn, **damper)
            else:
                ends = {"point_i": at.point, "point_j": np.zeros(3), "vector_i": at.axis_i}
                found[joint.name + DAMPING] = SlideSpring(at.bodies, **ends, **damper)
        return found

    def bodies(self, q: np.ndarray) -> dict[str, Body]:
        """Return the moving bodies with their masses, at the pose that the coordinates give."""
        robot, tree = self.robot, self.robot.opened()
        masses: dict[str, list[Inertia]] = {name: [] for name in self.links}
        for name, link in robot.links.items():
            body, position, rotation = _on_body(robot, name)
            if link.inertia is not None and body != GROUND:
                masses[body].append(link.inertia.moved(position, rotation))
        found = {}
        for name, parts in masses.items():
            at = forward_kinematics(tree, q[None], name)
            whole = Inertia.total(parts) if parts else None
            found[name] = Body(
                at.position[0].tolist(),
                orientation=_quaternion(at.rotation[0]).tolist(),
                mass=None if whole is None else whole.mass,
                inertia=None if whole is None else whole.tensor,
                center_of_mass=None if whole is None else whole.center_of_mass,
            )
        return found


def inner_names(moving: Sequence[Any], merged: Mapping[int, int]) -> set[str]:
    """Return the names of joints that are merged with their neighbours."""
    return {moving[k].name for last, count in merged.items() for k in range(last - count + 1, last + 1)}


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return the Euler parameters of a rotation matrix, from the largest of their squares, which never vanishes."""
    r = np.asarray(rotation, float)
    cross = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    products = np.empty((4, 4))  # 4 p p^T
    products[0, 0], products[0, 1:], products[1:, 0] = 1 + np.trace(r), cross, cross
    products[1:, 1:] = r + r.T + (1 - np.trace(r)) * np.eye(3)
    row = products[int(np.argmax(np.diag(products)))]
    return row / np.linalg.norm(row)
