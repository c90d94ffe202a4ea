"""Jacobians with their rates, slopes of points, and operational accelerations of any order: Negrean 2025, 50-59."""

import math
from typing import Any

import jax.numpy as jnp

from jounce.base.shapes import Array, ArrayLike, Numbers
from jounce.errors import RobotError, whole_number
from jounce.jet import Jet, concatenate, cross
from jounce.jet.algebra import stacked
from jounce.robot.model.arguments import checked_coordinates, stacked_arguments
from jounce.robot.model.tree import Frame, Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.kinematics import body_frames, frame_at, link_frame
from jounce.robot.recursions.tree_scan import Series, to_coordinates
from jounce.robot.robot import Robot


def jacobian_jet(tree: Tree, q: Series, frame: Frame) -> Jet:
    """Return the Jacobian of a frame as a jet of shape (6, coordinates, batch), linear rows first."""
    frames = body_frames(tree, q)
    target = frames.take(frame.body).point(frame.position)[:, None]
    bodies = frames.without_base()
    axis = bodies.axes[2]
    turning = jnp.asarray(tree.turning)[:, None]
    is_moved = jnp.asarray(tree.ancestors)[frame.body][:, None]
    linear = cross(axis, target - bodies.position) * turning + axis * (1 - turning)
    columns = concatenate([linear, axis * turning]) * is_moved
    return columns.map(lambda c: to_coordinates(tree, c))


@Batched
def _jacobian(tree: Tree, arrays: tuple[Series], frame: Frame) -> Any:
    return stacked(jacobian_jet(tree, arrays[0], frame))


@stacked_arguments(
    4,
    "jn.jacobian(robot, q[None], link)[0] for pin.computeFrameJacobian(model, data, q, frame, LOCAL_WORLD_ALIGNED)",
)
def jacobian(
    robot: Robot, q: ArrayLike, link: str, point: ArrayLike = (0.0, 0.0, 0.0)
) -> Array[Numbers, "*batch derivative 6 joint"]:
    """Return the Jacobian of a point of a link and its time derivatives to any order.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : array_like of shape (..., order + 1, n)
        Coordinates and their derivatives, rad or m; the order may be 0.
    link : str
        Name of the link.
    point : array_like of shape (3,), default the origin
        Point in the frame of the link, m.

    Returns
    -------
    array of shape (..., order + 1, 6, n)
        Jacobians ``J, J', J'', ...``: three rows for the velocity of the point, three for the angular velocity, in the
        frame of the base.

    Raises
    ------
    RobotError
        If the link does not exist, or q does not fit the robot.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod")
    >>> jn.jacobian(jn.Robot("one", links, [pin]), [[0.0]], "rod", [2, 0, 0])[0, :, 0].tolist()
    [0.0, 2.0, 0.0, 0.0, 0.0, 1.0]
    """
    return _jacobian(robot, (checked_coordinates(robot, q),), frame_at(robot, link, point))


def point_slope(
    robot: Robot, q: ArrayLike, link: str, point: ArrayLike = (0.0, 0.0, 0.0), *, n: int = 1, m: int = 1
) -> Array[Numbers, "*batch 3 joint"]:
    """Return ``dr^(n) / dq^(m)``, the slope of the n-th derivative of a point by the m-th of each coordinate.

    The slope is ``C(n, m)`` times the rate of order n - m of the Jacobian of the point (Negrean 2025, equations 50-55);
    it is zero for n below m, and the same for all orders n = m.

    Parameters
    ----------
    robot, q, link, point
        As for `jacobian`, with q of order n - m or more.
    n, m : int, default 1
        Orders of the derivatives of the point and of the coordinates, 0 or more; all other derivatives stay constant.

    Returns
    -------
    array of shape (..., 3, n)
        Slopes in the frame of the base, m or m/rad, by s^(m - n).

    Raises
    ------
    RobotError
        If the link does not exist, an order is not valid, or q does not fit the robot or has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod")
    >>> robot = jn.Robot("one", links, [pin])
    >>> jn.robot.point_slope(robot, [[0.0], [3.0]], "rod", [2, 0, 0], n=3, m=2)[:, 0].tolist()  # 3 (dr/dq)'
    [-18.0, 0.0, 0.0]
    """
    n, m = whole_number("n", n, error=RobotError), whole_number("m", m, error=RobotError)
    rate = max(0, n - m)
    rates = _jacobian(robot, (checked_coordinates(robot, q, rate, rate),), frame_at(robot, link, point))
    return rates[..., rate, :3, :] * float(math.comb(n, m))


def twist(tree: Tree, q: Series, frame_in_body: Frame) -> Jet:
    """Return the velocity of a point and the angular velocity of its link, (6, batch), one order shorter than q."""
    frame = link_frame(tree, q, frame_in_body)
    assert frame.angular_velocity is not None  # there are velocities
    return concatenate([frame.position.differentiate(), frame.angular_velocity])


@Batched
def _operational(tree: Tree, arrays: tuple[Series], frame: Frame) -> Any:
    return stacked(twist(tree, arrays[0], frame))


def operational_accelerations(
    robot: Robot, q: ArrayLike, link: str, point: ArrayLike = (0.0, 0.0, 0.0)
) -> Array[Numbers, "*batch order 6"]:
    """Return the operational velocity and accelerations of all orders of a point of a link: Negrean 2025, equation 59.

    Parameters
    ----------
    robot, q, link, point
        As for `jacobian`, with q of order 1 or more.

    Returns
    -------
    array of shape (..., order, 6)
        Vectors ``X', X'', ..., X^(order)``: the velocity of the point and the angular velocity, then their derivatives,
        in the frame of the base, equal to the sum of ``C(m - 1, k) J^(k) q^(m - k)``.

    Raises
    ------
    RobotError
        If the link does not exist, or q does not fit the robot.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod")
    >>> robot = jn.Robot("one", links, [pin])
    >>> jn.robot.operational_accelerations(robot, [[0.0], [2.0], [0.0]], "rod", [1, 0, 0]).tolist()
    [[0.0, 2.0, 0.0, 0.0, 0.0, 2.0], [-4.0, 0.0, 0.0, 0.0, 0.0, 0.0]]
    """
    return _operational(robot, (checked_coordinates(robot, q, 1),), frame_at(robot, link, point))
