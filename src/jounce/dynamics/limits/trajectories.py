"""A robot that follows a trajectory: coordinates with derivatives, and the required torques with rates."""

import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Refused, seconds
from jounce.errors import RobotError, SampleWarning, TrajectoryError, UnitWarning, flag, no_such
from jounce.execution.chunks import in_chunks
from jounce.robot.algorithms.carried_loads import CarriedLoad, LoadChange, LoadedRobot
from jounce.robot.model.arguments import joints_of, whole_number
from jounce.robot.model.links_and_joints import Limits
from jounce.robot.robot import Robot
from jounce.trajectory.joint_trajectory import JointTrajectory
from jounce.trajectory.law_checks.unit_doubts import trajectory_doubt
from jounce.units.instants import time_text
from jounce.units.shown_units import derivatives_of, time_axes

if TYPE_CHECKING:
    import xarray

BLOCK = 2048  # instants evaluated at once; a fixed number, so that programs are compiled once
QUANTITIES = ("position", "velocity", "acceleration", "jerk")
EFFORTS = ("effort", "effort rate")


class FollowedTrajectory:
    """The coordinates of a robot that follows a trajectory; joints that it does not name rest.

    Parameters
    ----------
    robot : Robot
        The robot.
    trajectory : JointTrajectory
        Trajectory of some or all of its joints.
    given : bool, default True
        Whether the trajectory is a user's, so that angles that are likely in degrees give a warning.
    loads : sequence of CarriedLoad, optional
        Loads that links carry during parts of the trajectory, by time.

    Attributes
    ----------
    resting_joints : dict of str to float
        Joints that the trajectory does not name, with their coordinates: zero, or the end of their range nearest to it.
    loaded : LoadedRobot
        The robot with its loads and their changes.
    doubts : list of str
        Warnings about samples that do not support requested derivatives.

    Raises
    ------
    RobotError, TrajectoryError
        If the robot has no joints, or the trajectory names a joint that it does not have or that cannot be commanded.
    """

    def __init__(
        self, robot: Robot, trajectory: JointTrajectory, *, given: bool = True, loads: Sequence[CarriedLoad] = ()
    ):
        if not joints_of(robot):
            raise RobotError("the robot has no moving joint; nothing can follow the trajectory", name="joints")
        for name in trajectory.names:
            if name not in robot.joint_names:
                advice = "" if name not in robot.joints else ", of a file by joints (--joints) that name the others"
                raise TrajectoryError(reason_not_movable(robot, name) + advice, name="joint", value=name)
        check_measures(robot, trajectory)
        self.robot, self.trajectory = robot, trajectory
        self.loaded = LoadedRobot(robot, in_time(loads), trajectory.start, trajectory.stop)
        self.columns = [robot.joint_names.index(name) for name in trajectory.names]
        resting_names = [name for name in robot.joint_names if name not in trajectory.names]
        limits = robot.limits if resting_names else {}
        self.resting_joints = {name: _rest(limits[name]) for name in resting_names}
        self.doubts: list[str] = []
        if given:
            warn_of_degrees(robot, trajectory)

    def coordinates(self, times: Float[np.ndarray, " time"], order: int) -> Float[np.ndarray, "time {order}+1 joint"]:
        """Return coordinates and derivatives.

        Raises
        ------
        TrajectoryError
            If one is not finite.
        """
        q = np.zeros((len(times), order + 1, len(self.robot.joint_names)))
        for name, value in self.resting_joints.items():
            q[:, 0, self.robot.joint_names.index(name)] = value
        with warnings.catch_warnings(record=True) as messages:
            warnings.simplefilter("always", SampleWarning)
            q[:, :, self.columns] = _in_blocks(lambda block: self.trajectory.derivatives(block, order), times)
        self.doubts += [str(w.message) for w in messages if str(w.message) not in self.doubts]
        self._check_finite(q, times, QUANTITIES)
        return q

    def torques(
        self, q: Float[np.ndarray, "time derivative joint"], times: Float[np.ndarray, " time"], drives: bool
    ) -> Float[np.ndarray, "time derivative-2 joint"]:
        """Return torques and rates for coordinates from `coordinates`.

        Raises
        ------
        TrajectoryError
            If one is not finite.
        """
        torques = in_chunks(lambda chunk: self.loaded.torques(q[chunk], times[chunk], drives), len(q), (BLOCK,), axis=0)
        self._check_finite(torques, times, EFFORTS)
        return torques

    def load_changes(self, drives: bool) -> tuple[LoadChange, ...]:
        """Return the effect of each change of the loads on the robot."""
        changes = self.loaded.changes
        return self.loaded.at_changes(self.coordinates(changes, 2), drives) if len(changes) else ()

    def _check_finite(self, values: np.ndarray, times: np.ndarray, names: tuple[str, ...]) -> None:
        failures = np.argwhere(~np.isfinite(values))
        if len(failures):
            instant, level, joint = failures[0]
            quantity = names[level] if level < len(names) else f"derivative {level} of the {names[0]}"
            message = f"the {quantity} of this joint is not finite at t = {time_text(float(times[instant]))} s"
            raise TrajectoryError(f"{message}; choose another law there", name=self.robot.joint_names[joint])


def in_time(loads: Sequence[CarriedLoad]) -> Sequence[CarriedLoad]:
    """Return the loads, or raise TrajectoryError unless all change at instants."""
    for load in loads:
        if not isinstance(load, CarriedLoad):
            raise TrajectoryError("must be CarriedLoads", name="loads", value=type(load).__name__)
        if load.by != "time" and (load.start, load.stop) != (None, None):
            message = f"of a trajectory a load changes at instants, not by {load.by}; give by='time'"
            raise TrajectoryError(message, name=f"loads.{load.link}", value=load.by)
    return loads


def warn_of_degrees(robot: Robot, trajectory: JointTrajectory) -> None:
    """Warn of revolute joints whose values have no unit and are likely in degrees.

    Warns
    -----
    UnitWarning
    """
    laws = {
        name: law
        for name, law in trajectory.laws.items()
        if name in robot.joint_names and robot.joints[name].turning and name not in trajectory.measures
    }
    if doubt := trajectory_doubt(
        laws, trajectory.start, trajectory.stop, {name: robot.joints[name].limits for name in laws}
    ):
        warnings.warn(UnitWarning(doubt), stacklevel=3)


def drives_note(drives: bool) -> str:
    """Return a text on the parts of the drives that torques include."""
    kinds = "armature, damping and friction"
    return f"{kinds}, as far as the robot file has them" if drives else f"the bare bodies, without {kinds}"


def trajectory_torques(
    robot: Robot,
    trajectory: JointTrajectory | Refused,
    rates: int = 0,
    *,
    times: ArrayLike | None = None,
    drives: bool = True,
    loads: Sequence[CarriedLoad] = (),
) -> "xarray.Dataset":
    """Return the joint torques and forces that a trajectory of a robot requires, with rates, as a labeled data set.

    Parameters
    ----------
    robot : Robot
        The robot, with its loads.
    trajectory : JointTrajectory
        Joints that it does not name rest at zero, or at the end of their range nearest to zero.
    rates : int, default 0
        Number of rates of the torques.
    times : array_like of shape (time,), optional
        Instants, s; by default those of the trajectory.
    drives : bool, default True
        Whether torques include armature inertia, damping and friction of the drives.
    loads : sequence of CarriedLoad, optional
        Loads that links carry during parts of the motion; at the instant of a change, the load after it counts.

    Returns
    -------
    xarray.Dataset
        One variable for each joint, with dimensions time and derivative; N m, or N for prismatic joints, by s.

    Raises
    ------
    RobotError, TrajectoryError
        If the robot has no joints or has closed loops, it does not have a joint of the trajectory, or a value is not
        finite.

    Warns
    -----
    SampleWarning
        If the samples of the trajectory do not support the required derivatives.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    >>> pendulum = jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin], gravity=[0, 0, 0])
    >>> trajectory = jn.JointTrajectory({"pin": "t**3"}, start=0.0, stop=2.0)
    >>> torques = jn.dynamics.trajectory_torques(pendulum, trajectory, rates=1, times=[0.0, 1.0])
    >>> torques["pin"].values.round(12).tolist()  # 6 t / 3 N m, and its rate
    [[0.0, 2.0], [2.0, 2.0]]
    """
    import xarray

    rates, drives = whole_number("rates", rates), flag("drives", drives, error=RobotError)
    trajectory = checked_trajectory(trajectory)
    followed = FollowedTrajectory(robot, trajectory, loads=loads)
    instants = trajectory.times if times is None else np.atleast_1d(seconds("times", times, TrajectoryError))
    values = followed.torques(followed.coordinates(instants, rates + 2), instants, drives)
    for message in followed.doubts:
        warnings.warn(SampleWarning(message), stacklevel=2)
    variables = {}
    for k, name in enumerate(robot.joint_names):
        attributes = {"units": "N*m" if robot.joints[name].turning else "N", "long_name": derivatives_of(name)}
        variables[name] = (("time", "derivative"), values[..., k], attributes)
    axes = time_axes(instants, rates + 1)
    header = {"title": robot.name, "source": "jounce", "drives": drives_note(drives)}
    return xarray.Dataset(variables, coords=axes, attrs=header)


def _in_blocks(function: Callable[[np.ndarray], Any], values: np.ndarray) -> np.ndarray:
    """Return the results of a function for values along their first axis, in blocks of one padded size."""
    return in_chunks(lambda chunk: function(values[chunk]), len(values), (BLOCK,), axis=0)


def reason_not_movable(robot: Robot, name: str) -> str:
    """Return the reason why a name is not that of a joint that can be commanded."""
    joint = robot.joints.get(name)
    if joint is None:
        return no_such(f"moving joint of {robot.name}", name, robot.joint_names)
    if joint.mimic is not None:
        return f"this joint follows {', '.join(joint.mimic.weights)}; leave it out"
    return "this joint is fixed; leave it out"


def checked_trajectory(trajectory: JointTrajectory | Refused) -> JointTrajectory:
    """Return a trajectory, after a check that it is one."""
    if not isinstance(trajectory, JointTrajectory):
        message = "must be a jn.JointTrajectory, as jn.load_trajectory or jn.JointTrajectory.from_samples gives it"
        raise TrajectoryError(message, name="trajectory", value=type(trajectory).__name__)
    return trajectory


def check_measures(robot: Robot, trajectory: JointTrajectory) -> None:
    """Raise TrajectoryError unless the units of a trajectory fit the joints of the robot."""
    for name, measure in trajectory.measures.items():
        turning = robot.joints[name].turning
        if measure != ("angle" if turning else "length"):
            message = (
                "this joint turns, its coordinate is an angle, but its law has the unit of a length"
                if turning
                else "this joint slides, its coordinate is a length, but its law has the unit of an angle"
            )
            raise TrajectoryError(message, name=name)


def _rest(limits: Limits) -> float:
    """Return zero, or the value nearest to zero in the range of a joint."""
    low = 0.0 if limits.lower is None else max(limits.lower, 0.0)
    return low if limits.upper is None else min(limits.upper, low)
