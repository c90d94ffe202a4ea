"""The report of a comparison of a trajectory with limits: the worst instants of each joint, and jumps at the ends."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from jounce.base.display import Displayed
from jounce.base.shapes import Array
from jounce.dynamics.limits.motion_ends import TrajectoryEnd
from jounce.robot.algorithms.carried_loads import LoadChange
from jounce.units.instants import time_text

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
        Unit of the value and the limit.
    value : float
        Value at the worst instant; infinite where a lower derivative jumps.
    time : float
        The instant, s.
    limit : float or None
        The bound that the value comes nearest to, with its sign; None without a limit, in which case the value is that
        of largest magnitude.
    ratio : float or None
        Distance from the middle of the allowed range over half its width: the magnitude over the limit, and for a range
        of positions 0 in its middle, 1 at its ends. If only one end is given, 1 at that end, growing by one for each
        multiple of the magnitude of the bound (1 rad or m if it is zero) beyond it.
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
        """Whether the limit is exceeded by more than rounding."""
        return self.ratio is not None and self.ratio > 1 + ROUNDING

    @property
    def infinite(self) -> bool:
        """Whether the value is infinite, because a lower derivative jumps."""
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
        """Rows whose limit is exceeded, the worst first."""
        return tuple(sorted((row for row in self.rows if row.broken), key=_ratio, reverse=True))

    @property
    def kept(self) -> bool:  # a public name
        """Whether no limit is exceeded."""
        return not self.broken

    @property
    def worst(self) -> LimitRow | None:
        """The row with the largest ratio; None if no quantity has a limit."""
        return max(self.limited, key=_ratio, default=None)


@dataclasses.dataclass(frozen=True, eq=False)
class LimitReport(LimitRows, Displayed):
    """The report of `check_limits`.

    Parameters
    ----------
    robot : str
        Name of the robot.
    joint_names : tuple of str
        Moving joints of the robot.
    rows : tuple of LimitRow
        Joint by joint, position to torque rate.
    held : dict of str to float
        Joints that the trajectory does not name, with the coordinates at which they rest, rad or m.
    times : ndarray of shape (time,)
        Evaluated instants; the worst instants are then searched between them.
    values : ndarray of shape (time, 6, joints)
        Position, velocity, acceleration, jerk, torque and torque rate at these instants.
    shares : ndarray of shape (time, 6, joints)
        The values relative to their limits: from -1 at the lower to 1 at the upper one, NaN without a limit.
    drives : bool, default True
        Whether torques include armature inertia, damping and friction.
    ends : tuple of TrajectoryEnd
        Jumps from rest at the start and to rest at the stop, and the limits that they exceed.
    hand_over : bool
        Whether the robot already moves at the start and continues to move at the stop, so that nothing jumps.
    loads : tuple of LoadChange
        Changes of the carried loads, and their effects.
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
        """Whether no limit is exceeded, within the motion or by a jump from or to rest at its ends."""
        return not self.broken and (self.hand_over or not any(end.breaks for end in self.ends))

    def __repr__(self) -> str:
        counts = f"{len(self.limited)} limits, {len(self.broken)} broken"
        if (worst := self.worst) is not None:
            counts += (
                f"; {worst.quantity} of {worst.joint} takes {worst.ratio:.6g} of its limit at t = "
                f"{time_text(worst.time)} s"
            )
        return f"<LimitReport of {self.robot}: {counts}>"


def _ratio(row: LimitRow) -> float:
    return -np.inf if row.ratio is None else row.ratio
