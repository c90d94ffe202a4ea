"""The arrays of a robot for its algorithms: moving bodies in depth-first order, to be scanned."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.errors import RobotError, check_name
from jounce.rigid.inertia import Inertia
from jounce.robot.model.couplings import OF_BALL, OF_TENDON, BallDrive, Coupling, Tendon
from jounce.robot.model.links_and_joints import Joint, Link
from jounce.robot.model.mimics import Mimic

MASSLESS = Inertia(0.0, strict=False)
FORWARD_BACKWARD = np.array([[0.5, 0.5], [0.5, -0.5]])  # mean and half of the difference of two numbers


@dataclasses.dataclass(frozen=True)
class Shape:
    """The numbers and kinds of bodies and joints, known when the algorithms are compiled.

    Parameters
    ----------
    bodies, coordinates, slots : int
        Numbers of moving bodies, of coordinates in q, and of places for states of parents until their last child is
        done.
    turning, sliding : bool
        Whether any joint turns, or slides.
    direct : bool
        Whether body k has coordinate k for its own, as in a robot without followers.
    tendons, balls : int
        Numbers of springs and tendons, and of balls with drives.
    armed, lifted : bool
        Whether drives of balls, or tendons, have armature; whether a body has a share of gravity below one.
    rubbing : bool
        Whether a joint, a tendon or the drive of a ball has Coulomb friction.
    """

    bodies: int
    coordinates: int
    slots: int
    turning: bool
    sliding: bool
    direct: bool
    tendons: int = 0
    balls: int = 0
    armed: bool = False
    lifted: bool = False
    rubbing: bool = False


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Tendons:
    """Springs of joints, and tendons along joints, whose lengths are weighted sums of coordinates.

    Parameters
    ----------
    weights : array of shape (tendons, coordinates)
    stiffness, rest, damping, friction, armature : array of shape (tendons,)
    """

    weights: Any
    stiffness: Any
    rest: Any
    damping: Any
    friction: Any
    armature: Any


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Balls:
    """Drives of balls.

    Parameters
    ----------
    select : array of shape (3, balls, coordinates)
        1 if a coordinate is the first, second or third rotation of a ball.
    armature, damping, friction : array of shape (balls,)
    """

    select: Any
    armature: Any
    damping: Any
    friction: Any


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Tree:
    """Arrays of a robot, one entry for each moving body, in whose frame z is the axis of the joint.

    Links fixed to a moving link are part of its body. Bodies are in depth-first order.

    Parameters
    ----------
    rotation, position : array of shape (bodies, 3, 3) and (bodies, 3)
        Pose of the body at coordinate zero in the frame of its parent body.
    mass, center, inertia : array of shape (bodies,), (bodies, 3), (bodies, 3, 3)
        Mass, center of mass and inertia about the center of mass, in the frame of the body.
    turning : array of shape (bodies,)
        1 for a joint that turns, 0 for a joint that slides.
    coordinate, multiplier : array of shape (leaders, bodies)
        The coordinate of a joint is ``offset`` plus the sum of ``multiplier * q[coordinate]`` over its leaders, padded
        with zeros to the largest number of leaders.
    offset : array of shape (bodies,)
    slot, parent_slot : array of int, shape (bodies,)
        Places of the state of the body and of its parent.
    ancestors : array of shape (bodies + 1, bodies)
        1 if joint j moves body i; the last row is the base.
    armature, damping, friction : array of shape (coordinates,)
        Values of the drives, including those of followers.
    friction_skew : array of shape (coordinates,)
        Friction against positive rates minus the mean of both directions.
    tendons : Tendons
    balls : Balls
    lift, lift_moment : array of shape (bodies + 1,) and (bodies + 1, 3)
        Mass without gravity, and its first moment about the origin, in the frame of the body; the last entry is the
        base.
    gravity : array of shape (3,)
        Gravitational acceleration, m/s^2.
    """

    rotation: Any
    position: Any
    mass: Any
    center: Any
    inertia: Any
    turning: Any
    coordinate: Any
    multiplier: Any
    offset: Any
    slot: Any
    parent_slot: Any
    ancestors: Any
    armature: Any
    damping: Any
    friction: Any
    friction_skew: Any
    tendons: Any
    balls: Any
    lift: Any
    lift_moment: Any
    gravity: Any
    shape: Shape = dataclasses.field(metadata={"static": True})


class Frame(NamedTuple):
    """The frame of a link: the body of the link (-1 is the base), and the pose in the frame of the body."""

    body: int
    position: Float[np.ndarray, " 3"]
    rotation: Float[np.ndarray, "3 3"]


def ordered(links: Mapping[str, Link], joints: Mapping[str, Joint]) -> list[Joint]:
    """Return the joints in depth-first order from the base, and check that they form one tree."""
    parents: dict[str, Joint] = {}
    children: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in joints.values():
        for role in ("parent", "child"):
            link = getattr(joint, role)
            check_name("link", link, links, RobotError, name=f"joints.{joint.name}.{role}")
        if joint.child in parents:
            first = parents[joint.child].name
            message = (
                f"link {joint.child} is the child of two joints, {first} and {joint.name}: a loop, which a tree cannot "
                "have; leave one of them out"
            )
            raise RobotError(message, name=f"joints.{joint.name}.child", value=joint.child)
        parents[joint.child] = joint
        children[joint.parent].append(joint)
    roots = [name for name in links if name not in parents]
    if not roots:
        raise RobotError(
            "the joints form a loop: every link is the child of a joint, and none can be the base", name="joints"
        )
    if len(roots) > 1:
        message = "exactly one link must be no joint's child, the base; join the others to it"
        raise RobotError(message, name="links", value=roots)
    sorted_joints: list[Joint] = []
    waiting = list(reversed(children[roots[0]]))
    while waiting:
        joint = waiting.pop()
        sorted_joints.append(joint)
        waiting += reversed(children[joint.child])
    if len(sorted_joints) < len(joints):
        reached = {joint.name for joint in sorted_joints}
        unreached = [name for name in joints if name not in reached]
        raise RobotError("these joints form a loop that the base does not reach", name="joints", value=unreached)
    return sorted_joints


def arrange(
    base: str,
    links: Mapping[str, Link],
    joints: Sequence[Joint],
    gravity: np.ndarray,
    couplings: Sequence[Coupling] = (),
) -> tuple[Tree, dict[str, Frame]]:
    """Merge fixed links, turn the axes of all joints to z, and arrange the bodies for scans.

    The joints are in order, parents first.
    """
    identity, zero = np.eye(3), np.zeros(3)
    frames = {base: Frame(-1, zero, identity)}
    parents, placements, masses, moving_joints = [], [], [], []
    lifted: dict[int, list[tuple[Any, Any]]] = {}
    _lift(lifted, frames[base], links[base])
    for joint in joints:
        body, position, rotation = frames[joint.parent]
        position, rotation = position + rotation @ joint.position, rotation @ joint.rotation
        if joint.moving:
            aligned = axes_with_z_along(joint.axis)
            placements.append((position, rotation @ aligned))
            parents.append(body)
            moving_joints.append(joint)
            masses.append([])
            body, position, rotation = len(moving_joints) - 1, zero, aligned.T
        frames[joint.child] = Frame(body, position, rotation)
        _lift(lifted, frames[joint.child], links[joint.child])
        inertia = links[joint.child].inertia
        if inertia is not None and body >= 0:
            masses[body].append(inertia.moved(position, rotation))
    combined = [Inertia.total(terms) if terms else MASSLESS for terms in masses]
    slots, parent_slots, count = _slots(parents)
    bodies, order = len(moving_joints), [joint.name for joint in moving_joints if joint.mimic is None]
    mimics = [joint.mimic or Mimic(joint.name) for joint in moving_joints]  # of others, or of the joint itself
    coordinate, multiplier = _leaders(mimics, order)
    friction = (
        np.array([np.broadcast_to(joint.friction, 2) for joint in moving_joints]).reshape(-1, 2) @ FORWARD_BACKWARD
    )
    has_one_leader = np.array([not mimic.several for mimic in mimics], float)  # drives of the others couple coordinates
    factor = multiplier[0] * has_one_leader
    terms = {  # by virtual work, from the values of each joint
        "armature": factor**2 * [joint.armature for joint in moving_joints],
        "damping": factor**2 * [joint.damping for joint in moving_joints],
        "friction": np.abs(factor) * friction[:, 0],
        "friction_skew": factor * friction[:, 1],
    }
    drives = {field: np.bincount(coordinate[0], term, len(order)).astype(float) for field, term in terms.items()}
    tendons, balls = _tendons(moving_joints, order, couplings), _balls(order, couplings)
    turning = np.array([joint.turning for joint in moving_joints], float)
    tree = Tree(
        rotation=np.array([rotation for _, rotation in placements]).reshape(bodies, 3, 3),
        position=np.array([position for position, _ in placements]).reshape(bodies, 3),
        mass=_array([entry.mass for entry in combined]),
        center=_array([entry.center_of_mass for entry in combined]).reshape(bodies, 3),
        inertia=_array([entry.tensor for entry in combined]).reshape(bodies, 3, 3),
        turning=turning,
        coordinate=coordinate,
        multiplier=multiplier,
        offset=np.array([mimic.offset for mimic in mimics], float),
        slot=np.array(slots, int),
        parent_slot=np.array(parent_slots, int),
        ancestors=_ancestors(parents),
        **drives,
        tendons=tendons,
        balls=balls,
        lift=_array([sum((mass for mass, _ in lifted.get(k, ())), 0.0) for k in (*range(bodies), -1)]),
        lift_moment=_array([sum((at for _, at in lifted.get(k, ())), zero) for k in (*range(bodies), -1)]),
        gravity=gravity,
        shape=Shape(
            bodies=bodies,
            coordinates=len(order),
            slots=count,
            turning=bool(turning.any()),
            sliding=bool((turning == 0).any()),
            direct=len(order) == bodies,
            tendons=len(tendons.weights),
            balls=balls.select.shape[1],
            armed=bool(balls.armature.any() or tendons.armature.any()),
            lifted=bool(lifted),
            rubbing=bool(friction.any() or tendons.friction.any() or balls.friction.any()),
        ),
    )
    return tree, frames


def _leaders(mimics: Sequence[Mimic], order: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates that joints follow, and their multipliers, padded with the first one and zeros."""
    count = max((len(mimic.weights) for mimic in mimics), default=1)
    coordinate, multiplier = np.zeros((count, len(mimics)), int), np.zeros((count, len(mimics)))
    for body, mimic in enumerate(mimics):
        leaders = [order.index(name) for name in mimic.weights]
        coordinate[:, body] = leaders[0]
        coordinate[: len(leaders), body] = leaders
        multiplier[: len(leaders), body] = list(mimic.weights.values())
    return coordinate, multiplier


def _lift(lifted: dict[int, list[tuple[Any, Any]]], frame: Frame, link: Link) -> None:
    """Record the mass of a link without gravity, and its first moment, for its body."""
    if link.inertia is None or link.gravity == 1:
        return
    inertia = link.inertia.moved(frame.position, frame.rotation)
    mass = inertia.mass * (1.0 - link.gravity)
    lifted.setdefault(frame.body, []).append((mass, mass * inertia.center_of_mass))


def _tendons(moving_joints: Sequence[Joint], order: Sequence[str], couplings: Sequence[Coupling]) -> Tendons:
    """Return springs of joints, drives of followers of several joints, and tendons, at the followed joints."""
    rows = []
    for joint in moving_joints:
        losses = (0.0, 0.0, 0.0)
        if joint.mimic is not None and joint.mimic.several:
            if isinstance(joint.friction, tuple):
                message = "of a joint that follows several others, friction must be alike both ways; give one number"
                raise RobotError(message, name=f"joints.{joint.name}.friction", value=joint.friction)
            losses = (joint.damping, joint.friction, joint.armature)
        if joint.stiffness or any(losses):
            rows.append(({joint.name: 1.0}, joint.stiffness, joint.spring_reference, *losses))
    lines = [line for line in couplings if isinstance(line, Tendon)]
    rows += [(line.weights, *(getattr(line, field) for field in OF_TENDON)) for line in lines]
    by_name = {joint.name: joint for joint in moving_joints}
    weights, numbers = np.zeros((len(rows), len(order))), []
    for k, (named_weights, stiffness, rest, *coefficients) in enumerate(rows):
        for name, weight in named_weights.items():
            mimic = by_name[name].mimic or Mimic(name)
            for leader, factor in mimic.weights.items():
                weights[k, order.index(leader)] += weight * factor
            rest -= weight * mimic.offset
        numbers.append((stiffness, rest, *coefficients))
    return Tendons(weights, *np.array(numbers, float).reshape(-1, len(OF_TENDON)).T)


def _balls(order: Sequence[str], couplings: Sequence[Coupling]) -> Balls:
    drives = [drive for drive in couplings if isinstance(drive, BallDrive)]
    select = np.zeros((3, len(drives), len(order)))
    for b, drive in enumerate(drives):
        for k, name in enumerate(drive.joints):
            select[k, b, order.index(name)] = 1.0
    return Balls(select, *(np.array([getattr(x, key) for x in drives], float) for key in OF_BALL))


def _array(values: list[Any]) -> Any:
    """Return values as one array, a JAX array if JAX traces one of them."""
    return jnp.stack(values) if any(isinstance(value, Tracer) for value in values) else np.array(values)


def axes_with_z_along(axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return a rotation matrix with a unit vector as third column, exact for the axes of a frame."""
    third = int(np.argmax(np.abs(axis)))
    first = np.eye(3)[(third + 1) % 3]
    first = first - (first @ axis) * axis
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])


def turn_about(axis: Float[np.ndarray, " 3"], angle: float) -> Float[np.ndarray, "3 3"]:
    """Return the matrix of a rotation about a unit vector: Negrean 2025, equation 20."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angle * np.asarray(axis)).as_matrix()


def quaternion_matrix(quaternion: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "3 3"]:
    """Return the rotation matrix of a unit quaternion, scalar first."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(quaternion, -1)).as_matrix()


def _slots(parents: list[int]) -> tuple[list[int], list[int], int]:
    """Return the slots of bodies and of their parents, and their number; a last child reuses the slot of its parent."""
    last_child = {parent: k for k, parent in enumerate(parents)}
    slots, free, count = {-1: 0}, [], 1
    for k, parent in enumerate(parents):
        if last_child[parent] == k:
            slots[k] = slots[parent]
        elif free:
            slots[k] = free.pop()
        else:
            slots[k], count = count, count + 1
        if k not in last_child:
            free.append(slots[k])
    return [slots[k] for k in range(len(parents))], [slots[parent] for parent in parents], count


def _ancestors(parents: list[int]) -> np.ndarray:
    moves = np.zeros((len(parents) + 1, len(parents)))
    for k, parent in enumerate(parents):
        moves[k] = moves[parent]
        moves[k, k] = 1.0
    return moves
