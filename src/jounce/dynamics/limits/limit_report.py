"""What a comparison of a trajectory with limits finds: the worst instants of each joint, and what its ends meet."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from jounce.base.display import Displayed
from jounce.base.shapes import Array
from jounce.dynamics.limits.motion_ends import TrajectoryEnd
from jounce.robot.algorithms.carried_loads import LoadChange

ROUNDING = 1e-9  # by which a ratio may exceed 1


@dataclasses.dataclass(frozen=True)
class LimitRow:
    """The worst instant of one quantity of one joint.

    Parameters
    ----------
    joint : str
        Name of the joint.
    quantity : str
        position, velocity, acceleration, jerk, torque, torque rate; force and force rate of a prismatic joint.
    unit : str
        Of the value and the limit.
    value : float
        What the trajectory has there; infinite where a lower derivative jumps.
    time : float
        The instant, s.
    limit : float or None
        The bound to which the value comes nearest, with its sign; None where there is no limit: the value is then the
        one of largest magnitude.
    ratio : float or None
        How far from the middle of what is allowed, relative to half of it: the magnitude over the limit, and for a
        range of positions 0 in its middle, 1 at its ends. Where only one end is given, 1 at that end, growing by one
        for each time the size of the bound (1 rad or m if it is zero) beyond.
    """

    joint: str
    quantity: str
    unit: str
    value: float
    time: float
    limit: float | None = None
    ratio: float | None = None

    @property
    def broken(self) -> bool:
        """Whether the limit is broken, by more than rounding."""
        return self.ratio is not None and self.ratio > 1 + ROUNDING

    @property
    def infinite(self) -> bool:
        """Whether the value is infinite, as where a lower derivative jumps."""
        return not np.isfinite(self.value)


class LimitRows:
    """Rows of quantities and their limits.

    Attributes
    ----------
    rows : tuple of LimitRow
    """

    rows: tuple[LimitRow, ...]

    @property
    def limited(self) -> tuple[LimitRow, ...]:
        """Rows that have a limit."""
        return tuple(row for row in self.rows if row.ratio is not None)

    @property
    def broken(self) -> tuple[LimitRow, ...]:
        """Rows whose limit is broken, the worst first."""
        return tuple(sorted((row for row in self.rows if row.broken), key=_ratio, reverse=True))

    @property
    def kept(self) -> bool:  # a public name
        """Whether no limit is broken."""
        return not self.broken

    @property
    def worst(self) -> LimitRow | None:
        """The row of the largest ratio; None if nothing has a limit."""
        return max(self.limited, key=_ratio, default=None)


@dataclasses.dataclass(frozen=True, eq=False)
class LimitReport(LimitRows, Displayed):
    """What `check_limits` found.

    Parameters
    ----------
    robot : str
        Name of the robot.
    joint_names : tuple of str
        Its moving joints.
    rows : tuple of LimitRow
        Joint by joint, position to torque rate.
    held : dict of str to float
        Joints that the trajectory does not name, and the coordinates at which they stand still, rad or m.
    times : ndarray of shape (time,)
        Instants that were looked at; the worst ones were then searched between them.
    values : ndarray of shape (time, 6, joints)
        Position, velocity, acceleration, jerk, torque and torque rate there.
    shares : ndarray of shape (time, 6, joints)
        The same as shares of their limits: from -1 at the lower to 1 at the upper one, NaN where there is no limit.
    drives : bool, default True
        Whether torques contain armature, damping and friction.
    ends : tuple of TrajectoryEnd
        What is met at the start and at the stop, and which limits a jump from rest, or to it, breaks there.
    hand_over : bool
        Whether the robot moves before the start and after the stop as the trajectory does there: nothing jumps then.
    loads : tuple of LoadChange
        Where what the robot carries changes, and what that does.
    """

    robot: str
    joint_names: tuple[str, ...]
    rows: tuple[LimitRow, ...]
    held: Mapping[str, float]
    times: Array[np.ndarray, " time"]
    values: Array[np.ndarray, "time 6 joint"]
    shares: Array[np.ndarray, "time 6 joint"]
    drives: bool = True
    ends: tuple[TrajectoryEnd, ...] = ()
    hand_over: bool = False
    loads: tuple[LoadChange, ...] = ()

    @property
    def kept(self) -> bool:  # a public name
        """Whether no limit is broken, neither within the motion nor by a jump from rest, or to it, at its ends."""
        return not self.broken and (self.hand_over or not any(end.breaks for end in self.ends))

    def __repr__(self) -> str:
        counts = f"{len(self.limited)} limits, {len(self.broken)} broken"
        if (worst := self.worst) is not None:
            counts += (
                f"; {worst.quantity} of {worst.joint} takes {worst.ratio:.6g} of its limit at t = {worst.time:.6g} s"
            )
        return f"<LimitReport of {self.robot}: {counts}>"


def _ratio(row: LimitRow) -> float:
    return -np.inf if row.ratio is None else row.ratio
