"""Generalized forces from balances of momentum: virtual work, Newton-Euler. Negrean 2025, equations 78-82, 123-125."""

from typing import Any

import jax.numpy as jnp

from jounce.base.shapes import ArrayLike
from jounce.dynamics.energy.body_coordinates import balanced_bodies
from jounce.dynamics.energy.driver_coordinates import balanced, is_driven
from jounce.dynamics.energy.energies import error_for
from jounce.errors import MechanismError, whole_number
from jounce.kinematics import Motion
from jounce.robot.algorithms.equations_of_motion import (
    centers_of,
    partial_velocities,
    times_inertia,
    work,
    work_of_weight,
)
from jounce.robot.algorithms.inverse_dynamics import inverse_dynamics
from jounce.robot.model.arguments import checked_coordinates
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.kinematics import body_frames
from jounce.robot.recursions.tree_scan import Series, to_coordinates
from jounce.robot.robot import Robot


@Batched
def _virtual_work(tree: Tree, arrays: tuple[Series], _: Any, inertial: bool) -> Any:
    """Return the generalized forces that balance inertia, or weight, along each coordinate."""
    frames = body_frames(tree, arrays[0]).without_base()
    if not inertial:
        return to_coordinates(tree, work_of_weight(tree, frames))
    force = centers_of(tree, frames).differentiate().differentiate() * jnp.asarray(tree.mass)[:, None]
    spin = frames.angular_velocity
    assert spin is not None  # there are accelerations
    moment = times_inertia(tree, frames, spin).differentiate()
    return to_coordinates(tree, work(partial_velocities(tree, frames), force, moment))


def _of_motion(motion: Motion, q: ArrayLike | None, rates: int, *, gravity: bool) -> Any:
    """Return the generalized forces that balance inertia, and weight if `gravity` is true, along a motion.

    The coordinates are those of the drivers or, where drivers do not prescribe the whole motion, those of the bodies.

    Raises
    ------
    MechanismError
        If coordinates are given, no body has a mass, or the motion has too few derivatives.
    """
    if q is not None:
        raise MechanismError("a motion has its coordinates already", name="q", value=q)
    return (balanced if is_driven(motion) else balanced_bodies)(motion, rates, gravity=gravity)


def newton_euler(system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0) -> Any:
    """Return the generalized inertia forces by recursive Newton-Euler on jets: `inverse_dynamics` without gravity.

    For a mechanism whose drivers prescribe its whole motion, multipliers solve the momentum balances of all bodies
    together. Otherwise each body is balanced by itself.

    Parameters
    ----------
    system, q, rates
        As for `lagrange`.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s; for a motion as of `lagrange`.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion has too few.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> newton_euler(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    rates = whole_number("rates", rates, error=error_for(system))
    if isinstance(system, Motion):
        return _of_motion(system, q, rates, gravity=False)
    falling, q = system.with_gravity((0.0, 0.0, 0.0)), checked_coordinates(system, q, rates + 2, rates + 2)
    return inverse_dynamics(falling, q, drives=False)


def virtual_work(system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0) -> Any:
    """Return the generalized inertia forces by d'Alembert-Lagrange: Negrean 2025, equations 81, 123 and 124.

    The virtual work of all inertia forces and moments along each coordinate, ``sum J^T F``. For a mechanism whose
    drivers prescribe its whole motion, J is the Jacobian of the bodies with respect to the laws of the drivers.
    Otherwise it is the Jacobian of each body with respect to its own coordinates.

    Parameters
    ----------
    system, q, rates
        As for `lagrange`.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s; for a motion as of `lagrange`.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion has too few.

    Examples
    --------
    >>> import jounce as jn
    >>> slide = jn.robot.JointAxis([1, 0, 0], type="prismatic", inertia=jn.Inertia(2.0))
    >>> virtual_work(jn.robot.from_screws([slide]), [[0.0], [3.0], [5.0], [7.0]], rates=1).round(12).tolist()
    [[10.0], [14.0]]
    """
    rates = whole_number("rates", rates, error=error_for(system))
    if isinstance(system, Motion):
        return _of_motion(system, q, rates, gravity=False)
    return _virtual_work(system, (checked_coordinates(system, q, rates + 2, rates + 2),), (), (True,))


def gravity_forces(system: Robot | Motion, q: ArrayLike | None = None, rates: int = 0) -> Any:
    """Return the generalized forces that balance gravity, with rates: Q_g of Negrean 2025, equation 125.

    Added to the inertia forces, they give the driving forces, ``Q_m = Q_i + Q_g``.

    Parameters
    ----------
    system, q, rates
        As for `lagrange`, with K at least `rates`.

    Returns
    -------
    array of shape (..., rates + 1, n)
        Forces and their rates, N m or N by s; for a motion as of `lagrange`.

    Raises
    ------
    RobotError, MechanismError
        If q does not fit the robot or has too few derivatives, or the motion has too few.

    Examples
    --------
    >>> import jounce as jn
    >>> lift = jn.robot.JointAxis([0, 0, 1], type="prismatic", inertia=jn.Inertia(2.0))
    >>> gravity_forces(jn.robot.from_screws([lift]), [[0.0]]).tolist()
    [[19.62]]
    """
    rates = whole_number("rates", rates, error=error_for(system))
    if isinstance(system, Motion):
        heavy, light = (_of_motion(system, q, rates, gravity=gravity) for gravity in (True, False))
        return heavy - light
    return _virtual_work(system, (checked_coordinates(system, q, rates, rates),), (), (False,))
