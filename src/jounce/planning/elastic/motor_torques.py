"""Motor torques given by a user, sorted into numbers, laws of time and feedback."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jounce.errors import RobotError, check_name
from jounce.planning.elastic.drives import DriveArrays
from jounce.trajectory import AbstractMotion, JointTrajectory
from jounce.trajectory.laws.user_laws import law_or_number, read_laws

MOTOR = "_motor"  # suffix of the joint or body of a rotor, after the name of its joint or driver


def torques_of(
    arrays: DriveArrays, torque: object
) -> tuple[np.ndarray, tuple[tuple[int, AbstractMotion], ...], Callable[..., Any] | None]:
    """Return the constant motor torques, the laws of time with the numbers of their drives, and the feedback.

    Raises
    ------
    RobotError
        If a drive does not exist, or a law is not valid.
    """
    constant = np.zeros(len(arrays.names))
    if isinstance(torque, JointTrajectory):
        torque = torque.laws
    if torque is None or callable(torque):
        return constant, (), torque
    if not isinstance(torque, Mapping):
        raise RobotError("must be a mapping of names to laws of time, or a function", name="torque", value=torque)
    laws = []
    for name, value in torque.items():
        check_name("drive", str(name), arrays.names, RobotError, name="torque")
        index, law = arrays.names.index(name), law_or_number("torque", name, value, RobotError)
        if isinstance(law, float):
            constant[index] = law
        else:
            laws.append((index, read_laws(law)))
    return constant, tuple(laws), None
