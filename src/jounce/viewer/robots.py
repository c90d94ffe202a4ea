"""Robots as the view sees them: a trajectory, or joints that swing within their limits; shapes of the file, or bars."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from jounce.errors import RobotError, check_name
from jounce.reporting.peaks import derivative_name
from jounce.rigid.euler_parameters import from_rotation_matrices
from jounce.robot.model import Joint
from jounce.robot.robot import Robot
from jounce.viewer.take import Exertion, Parameter, Quantity, Take, rotated

__all__ = ["RobotSubject", "RobotTake"]

FRAMES = 181
SWING = 4.0  # s, of one swing, unless a limit of velocity is slower
REACH = {True: np.pi / 4, False: 0.1}  # of joints without limits, rad and m: half a swing
TORQUES = ("torque", "yank", "second rate", "third rate", "fourth rate")


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class RobotTake(Take):
    """The motion of a tree of links as the page shows it.

    Parameters
    ----------
    robot : Robot
    q : array of shape (time, order + 1, n)
        Coordinates and their derivatives.
    """

    robot: Robot
    q: np.ndarray

    def quantities(self) -> dict[str, Quantity]:
        """Return coordinates and torques of the joints."""
        return _quantities(self.robot, self.q)

    def motion_of(self, body: str, point: Any) -> np.ndarray:
        """Return position and derivatives of a point."""
        from jounce.robot import forward_kinematics

        return np.asarray(forward_kinematics(self.robot, self.q, body, np.asarray(point, float)).position)

    def exertions_of(self) -> list[Exertion]:
        """Return what the joints carry, and what their drives exert."""
        return _exertions(self.robot, self.q, self.position, self.quaternion)

    def dataset(self) -> Any:
        """Return coordinates and torques."""
        return _dataset(self.robot, self.q, self.time)


class RobotSubject:
    """A robot whose joints follow a trajectory, or swing.

    Parameters
    ----------
    robot : Robot
        A tree.
    looks : Looks
        Shapes of its moving links and its base.
    trajectory : JointTrajectory, optional
        Without, each joint swings about a middle, by an amount; both are sliders.

    Raises
    ------
    RobotError
        If the robot has no moving joint, or the trajectory names others.
    """

    no_sliders = "The robot follows a trajectory. Without one, each joint swings, and has sliders here."

    def __init__(self, robot: Robot, looks: Any, trajectory: Any = None):
        if not robot.joint_names:
            raise RobotError("nothing moves: the robot has no moving joint", name=robot.name)
        self.robot, self.looks, self.trajectory = robot, looks, trajectory
        if trajectory is not None:
            _check_joints(robot, trajectory)

    @property
    def name(self) -> str:
        """The name of the robot."""
        return self.robot.name

    @property
    def loaded(self) -> bool:
        """Whether links have a mass."""
        return any(link.inertia is not None for link in self.robot.links.values())

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """How the joints swing; none with a trajectory."""
        return () if self.trajectory is not None else swing_parameters(self.robot)

    def solve(self, values: Mapping[str, float], order: int) -> Take:
        """Return the motion for some swings.

        Raises
        ------
        JounceError
            If the trajectory does not fit, or the period is not above zero.
        """
        robot = self.robot
        order = max(order, 1)
        trajectory = self.trajectory if self.trajectory is not None else swinging(robot, values)
        time = (
            trajectory.times if self.trajectory is not None else np.linspace(trajectory.start, trajectory.stop, FRAMES)
        )
        q = coordinates(robot, trajectory, time, order)
        position, quaternion = _poses(robot, q)
        return RobotTake(
            robot=robot,
            q=q,
            title=robot.name,
            planar=False,
            time=time,
            order=order,
            bodies=(robot.base, *robot.moving_links),
            position=position,
            quaternion=quaternion,
            values=dict(values),
            looks=self.looks,
        )


def _check_joints(robot: Robot, trajectory: Any) -> None:
    """Raise RobotError where a trajectory moves joints that a robot does not have."""
    for name in trajectory.names:
        check_name("moving joint", name, robot.joint_names, RobotError, name="trajectory")


def swing_of(joint: Joint) -> tuple[float, float, float]:
    """Return the limits of a joint and the middle of its swing, rad or m; of joints without limits some near zero."""
    low, high = joint.limits.lower, joint.limits.upper
    if low is None or high is None or not high > low:
        reach = REACH[joint.turning]
        middle = low if low is not None and low == high else 0.0
        return middle - 2 * reach, middle + 2 * reach, middle
    return low, high, 0.5 * (low + high)


def swing_parameters(robot: Robot, names: tuple[str, ...] | None = None) -> tuple[Parameter, ...]:
    """Return the period, and the middle and the swing of each joint."""
    found = [Parameter("period", _period(robot), 1.0, 20.0)]
    chosen = [robot.joints[name] for name in (robot.joint_names if names is None else names)]
    for joint in chosen:
        low, high, middle = swing_of(joint)
        half = 0.5 * (high - low)
        start = min(0.4 * half, REACH[joint.turning])
        found += [
            Parameter(f"{joint.name} swing", start, 0.0, half, "Swings (rad or m)"),
            Parameter(f"{joint.name} middle", middle, low, high, "Middles (rad or m)"),
        ]
    return tuple(sorted(found, key=lambda p: ("", "Swings (rad or m)", "Middles (rad or m)").index(p.group)))


def _period(robot: Robot) -> float:
    """Return a period at which no joint has to be faster than it can."""
    slowest = SWING
    for name in robot.joint_names:
        joint = robot.joints[name]
        low, high, _ = swing_of(joint)
        if joint.limits.velocity:
            swing = min(0.2 * (high - low), REACH[joint.turning])
            slowest = max(slowest, 2 * np.pi * swing / joint.limits.velocity)
    return float(np.ceil(slowest))


def swinging(robot: Robot, values: Mapping[str, float], names: tuple[str, ...] | None = None) -> Any:
    """Return the trajectory on which each joint swings, one after the other by a part of the period.

    Raises
    ------
    RobotError
        If the period is not above zero.
    """
    from jounce.trajectory import JointTrajectory

    period = float(values["period"])
    if not period > 0:
        raise RobotError("must be greater than zero", name="period", value=period)
    names = robot.joint_names if names is None else names
    laws = {
        name: f"{values[f'{name} middle']!r} + {values[f'{name} swing']!r}"
        f"*sin(2*pi*t/{period!r} + {2 * np.pi * k / max(len(names), 1)!r})"
        for k, name in enumerate(names)
    }
    return JointTrajectory(laws, 0.0, period)


def coordinates(robot: Robot, trajectory: Any, time: np.ndarray, order: int) -> np.ndarray:
    """Return the coordinates of all joints, (time, order + 1, n); those without a law stay at zero."""
    import warnings

    from jounce.errors import SampleWarning

    q = np.zeros((len(time), order + 1, len(robot.joint_names)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)  # the page shows how rough they are
        found = trajectory.derivatives(time, order)
    for k, name in enumerate(trajectory.names):
        q[..., robot.joint_names.index(name)] = found[..., k]
    return q


def _poses(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses of the base and of the moving links."""
    from jounce.robot import forward_kinematics

    still = q[:, :1]
    frames = [forward_kinematics(robot, still, link) for link in (robot.base, *robot.moving_links)]
    position = np.stack([np.asarray(frame.position)[:, 0] for frame in frames], axis=1)
    return position, np.stack([from_rotation_matrices(np.asarray(frame.rotation)[:, 0]) for frame in frames], axis=1)


def _torques(robot: Robot, q: np.ndarray) -> np.ndarray | None:
    """Return torques and forces of the joints with their rates, (time, orders, n); None where nothing tells them."""
    from jounce.robot import inverse_dynamics

    if q.shape[1] < 3 or not any(link.inertia is not None for link in robot.links.values()):
        return None
    return np.asarray(inverse_dynamics(robot, q))


def _quantities(robot: Robot, q: np.ndarray) -> dict[str, Quantity]:
    """Return the coordinates of the joints, and their torques."""
    words = tuple(derivative_name(k) for k in range(q.shape[1]))
    turning = [robot.joints[name].turning for name in robot.joint_names]
    found = {
        name: Quantity("rad" if turns else "m", q[..., k : k + 1], ("angle", *words[1:]) if turns else words)
        for k, (name, turns) in enumerate(zip(robot.joint_names, turning, strict=True))
    }
    torque = _torques(robot, q)
    if torque is not None:
        rates = (*TORQUES, *(f"{derivative_name(k)} rate" for k in range(5, 40)))[: torque.shape[1]]
        for k, (name, turns) in enumerate(zip(robot.joint_names, turning, strict=True)):
            unit, first = ("N*m", "torque") if turns else ("N", "force")
            found[f"{first} of {name}"] = Quantity(unit, torque[..., k : k + 1], (first, *rates[1:]))
    return found


def _exertions(robot: Robot, q: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> list[Exertion]:
    """Return what the joints carry, and what their drives exert."""
    from jounce.robot import joint_wrenches

    torque = _torques(robot, q)
    if torque is None:
        return []
    carried = np.asarray(joint_wrenches(robot, q, frame="base"))[:, 0]
    found = []
    moving = [joint for joint in robot.joints.values() if joint.moving]
    for k, joint in enumerate(moving):
        place = position[:, k + 1]
        found.append(Exertion(joint.name, "reaction", place, carried[:, k, :3], carried[:, k, 3:]))
        if joint.name in robot.joint_names:
            axis = rotated(quaternion[:, k + 1], np.asarray(joint.axis, float))
            effort = axis * torque[:, 0, robot.joint_names.index(joint.name)][:, None]
            pair = (None, effort) if joint.turning else (effort, None)
            found.append(Exertion(joint.name, "driver", place, *pair))
    return found


def _dataset(robot: Robot, q: np.ndarray, time: np.ndarray) -> Any:
    """Return coordinates and torques as an xarray.Dataset, for a table."""
    import xarray

    variables = {}
    for name, quantity in _quantities(robot, q).items():
        values = quantity.values[..., 0]
        padded = np.full(q.shape[:2], np.nan)
        padded[:, : values.shape[1]] = values
        key = name.replace("torque of ", "torque_").replace("force of ", "force_")
        variables[key] = (("time", "derivative"), padded, {"units": quantity.unit})
    axes = {"time": ("time", time, {"units": "s"}), "derivative": np.arange(q.shape[1])}
    return xarray.Dataset(variables, coords=axes, attrs={"title": robot.name, "source": "jounce"})
