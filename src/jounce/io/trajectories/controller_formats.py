"""What controllers call the columns of a trajectory, and at what rates they take it."""

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
        Names of positions, velocities and accelerations; the number of a joint, from 0, follows.
    efforts : tuple of str
        Names of torques, and of their rates where there are such.
    joints : int
        How many there are.
    rates : tuple of float
        Rows a second that it takes; the first is usual.
    gravity, drives : bool
        Whether torques contain what holds the weight, and what moves the drives.
    """

    time: str
    levels: tuple[str, ...]
    efforts: tuple[str, ...]
    joints: int
    rates: tuple[float, ...]
    gravity: bool
    drives: bool


FORMATS = {
    # libfranka, RobotState: tau_J_d is on the link side and without gravity; its rate has no name there
    "franka": ControllerFormat(
        "time", ("q_d", "dq_d", "ddq_d"), ("tau_J_d", "dtau_J_d"), 7, (1000.0,), gravity=False, drives=False
    ),
    # Real-Time Data Exchange, as its client records it
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
    """Return the format whose positions are among columns, None for any other table."""
    for known in FORMATS.values():
        if known.time in columns and f"{known.levels[0]}_0" in columns:
            return known
    return None


def joint_count(known: ControllerFormat, columns: Sequence[str]) -> int:
    """Return how many joints a table has positions of."""
    pattern = re.compile(rf"{known.levels[0]}_([0-9]+)$")
    return sum(pattern.match(name) is not None for name in columns)


def checked_format(name: str) -> str:
    """Return the name of a format.

    Raises
    ------
    TrajectoryError
        If there is none of this name.
    """
    check_name("controller format", name, NAMES, TrajectoryError, name="format")
    return name
