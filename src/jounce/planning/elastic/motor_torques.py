"""Torques of motors as a user gives them, sorted into numbers, laws of time and feedback."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jounce.errors import RobotError, check_name
from jounce.planning.elastic.drives import DriveArrays
from jounce.trajectory import AbstractMotion, ExpressionMotion
from jounce.trajectory.laws.user_laws import read_laws

MOTOR = "_motor"  # what the joint or body of a rotor is called after what it moves


def torques_of(
    arrays: DriveArrays, torque: object
) -> tuple[np.ndarray, tuple[tuple[int, AbstractMotion], ...], Callable[..., Any] | None]:
    """Return torques of motors that do not change, those that are laws of time with their places, and feedback.

    Raises
    ------
    RobotError
        If a name is none of the drives, or a law is none.
    """
    constant = np.zeros(len(arrays.names))
    if torque is None or callable(torque):
        return constant, (), torque
    if not isinstance(torque, Mapping):
        raise RobotError("must be a mapping of names to laws of time, or a function", name="torque", value=torque)
    laws = []
    for name, law in torque.items():
        check_name("drive", str(name), arrays.names, RobotError, name="torque")
        index = arrays.names.index(name)
        if isinstance(law, str):
            law = ExpressionMotion(law)
        if isinstance(law, AbstractMotion):
            laws.append((index, read_laws(law)))
        elif isinstance(law, int | float) and np.isfinite(law):
            constant[index] = law
        else:
            message = "must be a law of time: a motion law, an expression of t, or a finite number"
            raise RobotError(message, name=f"torque.{name}", value=law)
    return constant, tuple(laws), None
