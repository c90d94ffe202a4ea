"""Names of the columns of a trajectory in the formats of controllers, and their rates."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

from jounce.errors import TrajectoryError, check_name


@dataclasses.dataclass(frozen=True)
class ControllerFormat:
    """Columns of a controller's interface.

    Parameters
    ----------
    time : str
        Name of the column of times.
    levels : tuple of str
        Names of positions, velocities and accelerations, to which the number of the joint, from 0, is appended.
    efforts : tuple of str
        Names of torques, and of their rates, if any.
    joints : int
        Number of joints.
    rates : tuple of float
        Rows per second that it accepts; the first is the default.
    gravity, drives : bool
        Whether torques include those that hold the weight, and those that move the drives.
    """

    time: str
    levels: tuple[str, ...]
    efforts: tuple[str, ...]
    joints: int
    rates: tuple[float, ...]
    gravity: bool
    drives: bool


FORMATS = {
    # libfranka, RobotState: tau_J_d is on the link side and without gravity; it has no name for its rate
    "franka": ControllerFormat(
        "time", ("q_d", "dq_d", "ddq_d"), ("tau_J_d", "dtau_J_d"), 7, (1000.0,), gravity=False, drives=False
    ),
    # Real-Time Data Exchange, as recorded by its client
    "ur": ControllerFormat(
        "timestamp",
        ("target_q", "target_qd", "target_qdd"),
        ("target_moment",),
        6,
        (500.0, 125.0, 250.0, 1000.0),
        gravity=True,
        drives=True,
    ),
}
NAMES = (*FORMATS, "ros")


def format_of(columns: Sequence[str]) -> ControllerFormat | None:
    """Return the format whose positions are among the columns; None for other tables."""
    for controller in FORMATS.values():
        if controller.time in columns and f"{controller.levels[0]}_0" in columns:
            return controller
    return None


def joint_count(controller: ControllerFormat, columns: Sequence[str]) -> int:
    """Return the number of joints with positions in a table."""
    pattern = re.compile(rf"{controller.levels[0]}_([0-9]+)$")
    return sum(pattern.match(name) is not None for name in columns)


def checked_format(name: str) -> str:
    """Return the name of a format after a check.

    Raises
    ------
    TrajectoryError
        If the format does not exist.
    """
    check_name("controller format", name, NAMES, TrajectoryError, name="format")
    return name
