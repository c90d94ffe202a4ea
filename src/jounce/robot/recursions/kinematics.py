"""Forward kinematics of any order: frames, points, center of mass. Negrean 2025, equations 39, 44-48 and 55-58."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.base.shapes import Array, ArrayLike, Numbers
from jounce.errors import RobotError, check_name
from jounce.jet import Jet, sine_cosine
from jounce.jet.algebra import stacked, total
from jounce.rigid.frames import Frames
from jounce.rigid.inertia import Inertia, TracedInertia, vector_numbers
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.robot.model.arguments import checked_coordinates
from jounce.robot.model.tree import Frame, Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.tree_scan import (
    Series,
    entries,
    fill_slots,
    joint_coordinates,
    materialised,
    read_slot,
    write_slot,
)


def body_frames(tree: Tree, q: Series) -> Frames:
    """Return the frames of all bodies, of shape (3, bodies + 1, batch); the last one is the base."""
    levels, _, samples = q.shape
    zero = jnp.zeros((levels, 3, samples))
    units = tuple(zero.at[0, i].set(1.0) for i in range(3))
    base = (zero, *units, zero[1:])

    def outward(state: Any, entry: Any) -> tuple[Any, Any]:
        body, coordinate, turn = entry
        *frame, spin = read_slot(tree, state, body.parent_slot)
        position, *axes = (Jet(tuple(c)) for c in frame)
        position = position + _combined(axes, body.position)
        x, y, z = (_combined(axes, body.rotation[:, i]) for i in range(3))
        if tree.shape.turning:
            angle, sine, cosine = turn
            x, y, z = materialised((x, y, z))
            x, y = x * cosine + y * sine, y * cosine - x * sine
            if levels > 1:
                spin = spin + stacked(z * angle.differentiate())
        if tree.shape.sliding:
            position = position + z * (coordinate * (1 - body.turning))
        frames = (*(stacked(jet) for jet in (position, x, y, z)), spin)
        return write_slot(tree, state, body.slot, frames), frames

    coordinates = Jet(tuple(joint_coordinates(tree, q)[:, :, None]))
    angles = coordinates * jnp.asarray(tree.turning)[:, None, None] if tree.shape.sliding else coordinates
    # computed before the scan, where XLA would evaluate sine and cosine again for each use
    turns = (angles, *sine_cosine(angles)) if tree.shape.turning else None
    _, frames = jax.lax.scan(outward, fill_slots(tree, base), (entries(tree), coordinates, turns))
    arrays = [jnp.moveaxis(jnp.concatenate([x, root[None]]), 0, 2) for x, root in zip(frames, base, strict=True)]
    position, *axes = (Jet(tuple(x)) for x in arrays[:4])
    return Frames(position, tuple(axes), Jet(tuple(arrays[4])) if levels > 1 else None)


def _combined(axes: Any, local: Any) -> Jet:
    return total(axis * component for axis, component in zip(axes, local, strict=True))


def link_frame(tree: Tree, q: Series, frame_in_body: Frame) -> Frames:
    """Return the motion of a frame fixed to a body; the last body is the base."""
    frame = body_frames(tree, q).take(frame_in_body.body)
    axes = tuple(frame.direction(frame_in_body.rotation[:, i]) for i in range(3))
    return Frames(frame.point(frame_in_body.position), axes, frame.angular_velocity)


def frame_at(robot: AbstractRobot, link: str, point: ArrayLike) -> Frame:
    """Return the frame of a link, moved to a point, as a frame in its body; the base is numbered after the bodies.

    Raises
    ------
    RobotError
        If the link does not exist, or the point is not three finite numbers.
    """
    check_name("link", link, robot.frames, RobotError, name="link")
    point = vector_numbers("point", point, (3,))
    frame = robot.frames[link]
    body = frame.body if frame.body >= 0 else len(robot.moving_links)
    return Frame(body, frame.position + frame.rotation @ point, frame.rotation)


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True, eq=False)
class FrameMotion:
    """Pose and motion of a frame, in components along the axes of the base, with derivatives of any order.

    Parameters
    ----------
    position : array of shape (..., order + 1, 3)
        Position of the origin and its derivatives: velocity, acceleration, jerk, ...; m by s.
    rotation : array of shape (..., order + 1, 3, 3)
        Rotation matrix from the frame to the base, and its derivatives.
    angular_velocity : array of shape (..., order, 3)
        Angular velocity, acceleration, jerk, ...; rad/s by s.
    """

    position: Array[Numbers, "*batch derivative 3"]
    rotation: Array[Numbers, "*batch derivative 3 3"]
    angular_velocity: Array[Numbers, "*batch derivative-1 3"]


@Batched
def _frame_motion(tree: Tree, arrays: tuple[Series], frame_in_body: Frame) -> Any:
    frame = link_frame(tree, arrays[0], frame_in_body)
    spin = frame.angular_velocity
    rates = jnp.zeros((0, *frame.position.shape)) if spin is None else stacked(spin)
    return stacked(frame.position), stacked(frame.attitude), rates


def forward_kinematics(
    robot: AbstractRobot, q: ArrayLike, link: str, point: ArrayLike = (0.0, 0.0, 0.0)
) -> FrameMotion:
    """Return the motion of the frame of a link, or of the same frame moved to a point, to any order.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : array_like of shape (..., order + 1, n)
        Coordinates and their derivatives, rad or m; the order may be 0.
    link : str
        Name of the link.
    point : array_like of shape (3,), default the origin
        Origin of the requested frame, in the frame of the link, m.

    Returns
    -------
    FrameMotion
        Position (..., order + 1, 3), rotation (..., order + 1, 3, 3), angular velocity (..., order, 3), in the frame of
        the base.

    Raises
    ------
    RobotError
        If the link does not exist, or q does not fit the robot.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod")
    >>> motion = jn.forward_kinematics(jn.Robot("one", links, [pin]), [[0.0], [2.0], [0.0]], "rod", [1, 0, 0])
    >>> motion.position.tolist()
    [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [-4.0, 0.0, 0.0]]
    """
    return FrameMotion(*_frame_motion(robot, (checked_coordinates(robot, q),), frame_at(robot, link, point)))


@Batched
def _center_of_mass(tree: Tree, arrays: tuple[Series], constants: Any) -> Any:
    frames = body_frames(tree, arrays[0])
    mass, center = constants
    centers = frames.point(jnp.swapaxes(center, 0, 1)[:, :, None])
    mass_fraction = mass / mass.sum()
    return stacked(centers.map(lambda c: jnp.einsum("cbs,b->cs", c, mass_fraction)))


def center_of_mass(robot: AbstractRobot, q: ArrayLike) -> Array[Numbers, "*batch derivative 3"]:
    """Return the center of mass of the whole robot and its derivatives: Negrean 2025, equations 44-48 and 55.

    Parameters
    ----------
    robot : Robot
        The robot; the mass of its base counts.
    q : array_like of shape (..., order + 1, n)
        Coordinates and their derivatives, rad or m.

    Returns
    -------
    array of shape (..., order + 1, 3)
        Position of the center of mass and its derivatives, in the frame of the base, m by s.

    Raises
    ------
    RobotError
        If q does not fit the robot, or no link has a mass.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod")
    >>> jn.robot.center_of_mass(jn.Robot("one", links, [pin]), [[0.0], [2.0]]).tolist()
    [[0.5, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    q = checked_coordinates(robot, q)
    base = robot.base_inertia
    if base is None and not robot.moving_links:
        raise RobotError("no link has a mass", name="robot", value=robot.name)
    base_inertia = Inertia(0.0, strict=False) if base is None else base
    library = jnp if isinstance(base_inertia, TracedInertia) or isinstance(robot.tree.mass, Tracer) else np
    mass = library.append(robot.tree.mass, base_inertia.mass)
    center = library.concatenate([robot.tree.center, base_inertia.center_of_mass[None]])
    return _center_of_mass(robot, (q,), (mass, center))
