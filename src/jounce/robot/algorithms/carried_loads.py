"""Loads that links carry during a part of a motion: the robot of each interval, and the effect of a load change."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float

from jounce.errors import TrajectoryError, check_name, flag
from jounce.rigid.inertia import Inertia
from jounce.robot.algorithms.inverse_dynamics import inverse_dynamics
from jounce.robot.recursions.kinematics import forward_kinematics
from jounce.robot.robot import Robot

COUNTED_BY = ("time", "s", "share", "waypoint")
SAME = 1e-12  # fraction of the motion: changes nearer to each other, or to an end, count as simultaneous
NO_STEP = 1e-12  # fraction of the largest torque: smaller steps are rounding

Place = Literal["time", "s", "share", "waypoint"]


@dataclasses.dataclass(frozen=True)
class CarriedLoad:
    """A load that a link carries during a part of a motion.

    Parameters
    ----------
    link : str
        Name of the link.
    inertia : Inertia
        Inertia of the load, in the frame of the link.
    start, stop : float, optional
        Where the load is taken up and set down; by default the ends of the motion.
    by : {"time", "s", "share", "waypoint"}, default "time"
        Unit of `start` and `stop`: an instant of the trajectory, s; the parameter of a path; a share of the path, from
        0 to 1; or the number of a waypoint, the first being 1.
    moving : bool, default False
        Whether the load is taken up and set down in motion, as from a conveyor; otherwise `retime` stops at both.

    Raises
    ------
    TrajectoryError
        If a value is not valid, or the load is set down before it is taken up.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.robot.CarriedLoad("hand", jn.Inertia(3.0), start=0.8, stop=2.0).words
    'hand carries 3 kg from 0.8 s to 2 s'
    """

    link: str
    inertia: Inertia
    start: float | int | None = None
    stop: float | int | None = None
    by: Place = "time"
    moving: bool = False

    def __post_init__(self) -> None:
        check_name("place of a load", self.by, COUNTED_BY, TrajectoryError, name="by")
        flag("moving", self.moving, error=TrajectoryError)
        if not isinstance(self.inertia, Inertia):
            raise TrajectoryError("must be an Inertia", name="loads", value=type(self.inertia).__name__)
        for name in ("start", "stop"):
            value = getattr(self, name)
            if value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
                raise TrajectoryError("must be a finite number", name=f"loads.{name}", value=value)
            if self.by == "waypoint" and value != round(value):
                raise TrajectoryError("must be the whole number of a waypoint", name=f"loads.{name}", value=value)
            object.__setattr__(self, name, float(value))
        if self.start is not None and self.stop is not None and self.start >= self.stop:
            message = f"is set down at {self.stop:g}, but taken up at {self.start:g} only; the second must be later"
            raise TrajectoryError(message, name=f"loads.{self.link}")

    @property
    def words(self) -> str:
        """The load in words: its link, mass and interval."""
        unit = " s" if self.by == "time" else ""
        ends = [f" from {self.start:g}{unit}"] * (self.start is not None)
        ends += [f" to {self.stop:g}{unit}"] * (self.stop is not None)
        return f"{self.link} carries {float(self.inertia.mass):g} kg{''.join(ends)}"


@dataclasses.dataclass(frozen=True)
class LoadChange:
    """Effect of a load change on a robot in motion.

    Parameters
    ----------
    time : float
        Instant of the change, s.
    masses : dict of str to float
        Mass added to each link, kg; negative for mass removed.
    speed : float
        Speed of the center of mass of the load, m/s; the largest of several loads.
    steps : dict of str to float
        Jump of the torque or force of each joint, N m or N.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> robot = jn.load_robot("examples/robots/panda.urdf")
    >>> load = jn.robot.CarriedLoad("panda_hand", jn.Inertia(3.0), start=0.8, stop=2.0)
    >>> loaded = jn.robot.LoadedRobot(robot, [load], 0.0, 3.0)
    >>> taken, _ = loaded.at_changes(np.zeros((2, 3, len(robot.joint_names))), drives=True)
    >>> taken.time, taken.masses
    (0.8, {'panda_hand': 3.0})
    """

    time: float
    masses: Mapping[str, float]
    speed: float
    steps: Mapping[str, float]


class LoadedRobot:
    """A robot whose links carry loads during parts of a motion.

    Parameters
    ----------
    robot : Robot
        The robot without loads.
    loads : sequence of CarriedLoad
        Loads, all in the unit that the motion runs over.
    start, stop : float
        Ends of the motion.

    Attributes
    ----------
    changes : array of shape (change,)
        Load changes within the motion.
    robots : tuple of Robot
        The loaded robot before the first change, between the first and the second change, and so on.

    Raises
    ------
    RobotError, TrajectoryError
        If a link does not exist, or a load is not carried during the motion.

    Examples
    --------
    >>> import jounce as jn
    >>> robot = jn.load_robot("examples/robots/panda.urdf")
    >>> load = jn.robot.CarriedLoad("panda_hand", jn.Inertia(3.0), start=0.8, stop=2.0)
    >>> jn.robot.LoadedRobot(robot, [load], 0.0, 3.0).changes.tolist()
    [0.8, 2.0]
    """

    def __init__(self, robot: Robot, loads: Sequence[CarriedLoad], start: float, stop: float):
        self.loads, near, span = tuple(loads), SAME * (stop - start), f"the motion runs from {start:g} to {stop:g}"
        self.near = near
        intervals = []
        for load in self.loads:
            first, last = (start if load.start is None else load.start), (stop if load.stop is None else load.stop)
            if first < start - near or last > stop + near or last - first <= near:
                phrase = "is taken up or set down outside of the motion" if last > first else "is not carried at all"
                raise TrajectoryError(f"{phrase}: {span}", name=f"loads.{load.link}", value=[first, last])
            intervals.append((first, last))
        edges = np.unique(np.array(intervals).reshape(-1))
        edges = edges[(edges > start + near) & (edges < stop - near)]
        self.changes: Float[np.ndarray, " change"] = edges[np.diff(edges, prepend=-np.inf) > near]
        self.robots = tuple(
            self._carrying(robot, intervals, (a + b) / 2)
            for a, b in itertools.pairwise([start, *self.changes.tolist(), stop])
        )

    def _carrying(self, robot: Robot, intervals: list[tuple[float, float]], time: float) -> Robot:
        for load, (first, last) in zip(self.loads, intervals, strict=True):
            if first < time < last:
                robot = robot.with_payload(load.link, load.inertia)
            else:
                check_name("link", load.link, robot.links, TrajectoryError, name="loads")
        return robot

    def torques(
        self, q: Float[np.ndarray, "*some place derivative joint"], at: Float[np.ndarray, " place"], drives: bool
    ) -> Float[np.ndarray, "*some place derivative-2 joint"]:
        """Return the torques for coordinates at places of the motion; at a load change, the torques after it."""
        if len(self.robots) == 1:
            return np.asarray(inverse_dynamics(self.robots[0], q, drives=drives))
        robot_index = np.searchsorted(self.changes, at, side="right")
        torques = np.zeros((*q.shape[:-2], q.shape[-2] - 2, q.shape[-1]))
        for k in np.unique(robot_index):
            is_carrying = robot_index == k
            torques[..., is_carrying, :, :] = inverse_dynamics(self.robots[k], q[..., is_carrying, :, :], drives=drives)
        return torques

    def at_changes(self, q: Float[np.ndarray, "change derivative joint"], drives: bool) -> tuple[LoadChange, ...]:
        """Return the effect of each load change, for the coordinates at the changes."""
        return tuple(self._change(k, sample[None, :3], drives) for k, sample in enumerate(q))

    def _change(self, k: int, q: Float[np.ndarray, "1 3 joint"], drives: bool) -> LoadChange:
        before, after = self.robots[k : k + 2]
        early, late = (np.asarray(inverse_dynamics(robot, q, drives=drives))[0, 0] for robot in (before, after))
        threshold = NO_STEP * max(float(np.abs([early, late]).max()), np.finfo(float).tiny)
        steps = {
            name: float(x)
            for name, x in zip(before.joint_names, late - early, strict=True)
            if abs(float(x)) > threshold
        }
        time, masses, speed = float(self.changes[k]), dict[str, float](), 0.0
        for load in self.loads:
            for edge, sign in ((load.start, 1.0), (load.stop, -1.0)):
                if edge is None or abs(edge - time) > self.near:
                    continue
                masses[load.link] = masses.get(load.link, 0.0) + sign * float(load.inertia.mass)
                point = np.asarray(load.inertia.center_of_mass, float)
                motion = np.asarray(forward_kinematics(before, q[:, :2], load.link, point).position)
                speed = max(speed, float(np.linalg.norm(motion[0, 1])))
        return LoadChange(time, masses, speed, steps)
