"""Checks of the arguments of robot functions: numbers, coordinates and their derivatives."""

from collections.abc import Callable
from functools import partial, wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
from jaxtyping import Float

from jounce import errors
from jounce.base.shapes import Numbers, is_real, real_numbers
from jounce.errors import RobotError
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.trajectory.joint_trajectory import MAX_ORDER, JointTrajectory
from jounce.trajectory.labels import in_order

P = ParamSpec("P")
R = TypeVar("R")


def stacked_arguments(count: int, hint: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator for functions that take stacked derivatives: a call with separate ones raises a RobotError.

    Parameters
    ----------
    count : int
        Number of positional arguments.
    hint : str
        The call in jounce, and that in another library, for the message.
    """

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def checked_function(*arguments: P.args, **options: P.kwargs) -> R:
            if len(arguments) > count:
                message = f"takes {count} arguments without names, not {len(arguments)}; write {hint}"
                raise RobotError(message, name=function.__name__)
            return function(*arguments, **options)

        return checked_function

    return decorated


def floats(name: str, values: Any, read: Callable[..., np.ndarray] = real_numbers) -> Float[Numbers, "..."]:
    """Return values as an array of double precision: a NumPy array, or a JAX array if they are one.

    Raises
    ------
    RobotError
        If the values are not real numbers in one rectangular array.
    """
    if is_real(values):
        return values.astype(float, copy=False)
    return read(name, values, _no_array, "an array of real numbers")


def _no_array(message: str, name: str, value: object) -> RobotError:
    if isinstance(value, JointTrajectory):
        message = f"{message}; of a trajectory, give derivatives(times, order), q and its rates at instants"
    return RobotError(message, name=name, value=type(value).__name__)


whole_number = partial(errors.whole_number, error=RobotError)


def joints_of(robot: object) -> tuple[str, ...]:
    """Return the joint names of a robot.

    Raises
    ------
    RobotError
        If the argument is not a robot.
    """
    if not isinstance(robot, AbstractRobot):
        message = "must be a jn.Robot, as jn.load_robot gives it; the robot is the first argument"
        raise RobotError(message, name="robot", value=robot)
    return robot.joint_names


def _numbered(robot: AbstractRobot, name: str, q: object) -> tuple[int, Float[Numbers, "..."]]:
    """Return the number of joints, and the coordinates as an array."""
    count = len(joints_of(robot))
    if isinstance(q, str) and q in robot.frames:
        message = "must be an array of real numbers; the arguments are the robot, q, then the name of a link"
        raise RobotError(message, name=name, value=q)
    return count, floats(name, in_order(name, q, robot.joint_names, RobotError))


def checked_position(robot: AbstractRobot, q: object, name: str = "q") -> Float[Numbers, "*batch 1 joint"]:
    """Return checked coordinates without derivatives, with an axis for the order zero.

    Raises
    ------
    RobotError
        If `robot` is not a robot, or the coordinates do not have the shape (..., n).
    """
    n, q = _numbered(robot, name, q)
    if q.ndim < 1 or q.shape[-1] != n:
        raise RobotError(f"must have the shape (..., n) with n = {n}, not {q.shape}", name=name)
    return q[..., None, :]


def checked_state(robot: AbstractRobot, state: object) -> Float[Numbers, "*batch 2 joint"]:
    """Return checked coordinates and velocities.

    Raises
    ------
    RobotError
        If `robot` is not a robot, or the state does not have the shape (..., 2, n).
    """
    n, state = len(joints_of(robot)), floats("state", in_order("state", state, robot.joint_names, RobotError))
    if state.ndim < 2 or state.shape[-2:] != (2, n):
        message = f"must hold q and q', the shape (..., 2, {n}) for the joints of {robot.name}, not {state.shape}"
        raise RobotError(message, name="state")
    return state


def checked_coordinates(
    robot: AbstractRobot, q: object, least: int = 0, most: int | None = None
) -> Float[Numbers, "*batch derivative joint"]:
    """Return checked coordinates and derivatives, to the order `least` or more, truncated to the order `most`.

    Raises
    ------
    RobotError
        If `robot` is not a robot, the shape does not fit it, or the derivatives are too few or too many.
    """
    n, q = _numbered(robot, "q", q)
    if q.ndim < 2 or q.shape[-1] != n:
        joints = f"{robot.name} has {n} {'joint' if n == 1 else 'joints'}"
        stack = "; stack positions and derivatives: np.stack([q, v, a])" if q.shape == (n,) else ""
        raise RobotError(f"must have the shape (..., order + 1, n), not {q.shape}; {joints}: n = {n}{stack}", name="q")
    if q.shape[-2] < least + 1:
        names = ", ".join(["q", "q'", "q''"][: least + 1])
        lacks = f"must hold {names}" if least < 3 else f"needs derivatives of q to order {least}"
        message = f"{lacks} along its last axis but one: the shape (..., order + 1, n), not {q.shape}"
        raise RobotError(message, name="q")
    if q.shape[-2] > MAX_ORDER + 1:
        message = (
            f"must have at most {MAX_ORDER} derivatives along its last axis but one, not {q.shape[-2] - 1}; positions "
            "at many instants alone have the shape (..., 1, n), as q[..., None, :]"
        )
        raise RobotError(message, name="q")
    return q if most is None else q[..., : most + 1, :]
