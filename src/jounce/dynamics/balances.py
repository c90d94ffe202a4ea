"""Generalised forces from balances of momentum: virtual work, Newton-Euler. Negrean 2025, equations 79-81, 121-125."""

from typing import Any

import jax.numpy as jnp

from jounce.dynamics.energies import whole_number
from jounce.dynamics.equations import checked_order
from jounce.robot.batches import Batched
from jounce.robot.equations_of_motion import centers_of, partial_velocities, times_inertia, work, work_of_weight
from jounce.robot.inverse_dynamics import inverse_dynamics
from jounce.robot.kinematics import body_frames
from jounce.robot.robot import Robot
from jounce.robot.tree import Tree
from jounce.robot.tree_scan import to_coordinates


@Batched
def _virtual_work(tree: Tree, arrays: Any, _: Any, inertial: bool) -> Any:
    """Return the work of inertia, or of weight, along each coordinate."""
    frames = body_frames(tree, arrays[0]).without_base()
    if not inertial:
        return to_coordinates(tree, work_of_weight(tree, frames))
    force = centers_of(tree, frames).differentiate().differentiate() * jnp.asarray(tree.mass)[:, None]
    moment = times_inertia(tree, frames, frames.angular_velocity).differentiate()
    return to_coordinates(tree, work(partial_velocities(tree, frames), force, moment))


def newton_euler(robot: Robot, q: Any, rates: int = 0) -> Any:
    """Return the generalised inertia forces by recursive Newton-Euler on jets: `inverse_dynamics` without gravity.

    Parameters
    ----------
    robot, q, rates
        As for `lagrange`.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s.

    Raises
    ------
    RobotError
        If q does not fit the robot or has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.Screw([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> newton_euler(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    q = checked_order(robot, q, whole_number("rates", rates, 0) + 2)
    return inverse_dynamics(robot.with_gravity((0.0, 0.0, 0.0)), q)


def virtual_work(robot: Robot, q: Any, rates: int = 0) -> Any:
    """Return the generalised inertia forces by the principle of d'Alembert-Lagrange: Negrean 2025, equations 121-124.

    The work that the inertia forces and moments of all bodies do along each coordinate, ``sum J^T F``.

    Parameters
    ----------
    robot, q, rates
        As for `lagrange`.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s.

    Raises
    ------
    RobotError
        If q does not fit the robot or has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.Screw([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> virtual_work(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    q = checked_order(robot, q, whole_number("rates", rates, 0) + 2)
    return _virtual_work(robot, (q,), (), (True,))


def gravity_forces(robot: Robot, q: Any, rates: int = 0) -> Any:
    """Return the generalised forces that hold the robot against gravity, and their rates: Q_g of Negrean 2025, 125.

    With the inertia forces they make the driving forces, ``Q_m = Q_i + Q_g``.

    Parameters
    ----------
    robot, q, rates
        As for `lagrange`, with K at least `rates`.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s.

    Raises
    ------
    RobotError
        If q does not fit the robot or has too few derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> lift = jn.robot.Screw([0, 0, 1], type="prismatic", inertia=jn.Inertia(2.0))
    >>> gravity_forces(jn.robot.from_screws([lift]), [[0.0]]).tolist()
    [[19.62]]
    """
    q = checked_order(robot, q, whole_number("rates", rates, 0))
    return _virtual_work(robot, (q,), (), (False,))
