"""Robots in the viewer: a trajectory, or joints that swing within their limits."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping
from functools import cached_property

import numpy as np
from jaxtyping import Float
from xarray import Dataset

from jounce.dynamics.limits.trajectories import check_measures
from jounce.errors import RobotError, SampleWarning, check_name
from jounce.reporting.peaks import derivative_name
from jounce.rigid.euler_parameters import from_rotation_matrices
from jounce.robot import forward_kinematics, inverse_dynamics, joint_wrenches
from jounce.robot.model.links_and_joints import Joint, Limits
from jounce.robot.robot import Robot
from jounce.trajectory import JointTrajectory
from jounce.units.shown_units import time_axes
from jounce.viewer.shapes.appearance import Appearance, Position
from jounce.viewer.shapes.recording import Load, Parameter, Quantity, Recording, rotated

FRAMES = 181
SWING = 4.0  # period of a swing, s, unless a limit of velocity needs a longer one
REACH = {True: np.pi / 4, False: 0.1}  # amplitude of joints without limits, rad and m
TORQUES = ("torque", "yank", "second rate", "third rate", "fourth rate")

Times = Float[np.ndarray, " time"]
Coordinates = Float[np.ndarray, "time derivative joint"]


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class RobotRecording(Recording):
    """The motion of a tree of links for the page.

    Parameters
    ----------
    robot : Robot
    q : numpy.ndarray of shape (time, order + 1, n)
        Coordinates and their derivatives.
    """

    robot: Robot
    q: Coordinates

    @cached_property
    def torques(self) -> Float[np.ndarray, "time derivative joint"] | None:
        """Torques and forces of the joints with their rates; None if they are unknown."""
        if self.order < 2 or not has_masses(self.robot):
            return None
        return np.asarray(inverse_dynamics(self.robot, self.q))

    def quantities(self) -> dict[str, Quantity]:
        """Return the coordinates and torques of the joints."""
        names = tuple(derivative_name(k) for k in range(self.order + 1))
        rates = (*TORQUES, *(f"{derivative_name(k)} rate" for k in range(5, 40)))
        coordinates, torques = {}, {}
        for k, name in enumerate(self.robot.joint_names):
            turning, values = self.robot.joints[name].turning, self.q[..., k : k + 1]
            unit, first = ("rad", "angle") if turning else ("m", "position")
            coordinates[name] = Quantity(unit, values, (first, *names[1:]))
            if self.torques is not None:
                unit, first = ("N*m", "torque") if turning else ("N", "force")
                values = self.torques[..., k : k + 1]
                torques[f"{first} of {name}"] = Quantity(unit, values, (first, *rates[1 : values.shape[1]]))
        return coordinates | torques

    def derivatives(self, body: str, point: Position) -> Float[np.ndarray, "time derivative 3"]:
        """Return the position and derivatives of a point."""
        return np.asarray(forward_kinematics(self.robot, self.q, body, np.asarray(point, float)).position)

    def all_loads(self) -> list[Load]:
        """Return the reactions of the joints, and the forces of their drives."""
        if self.torques is None:
            return []
        wrenches = np.asarray(joint_wrenches(self.robot, self.q, frame="base"))[:, 0]
        loads = []
        for k, joint in enumerate(joint for joint in self.robot.joints.values() if joint.moving):
            position = self.position[:, k + 1]
            loads.append(Load(joint.name, "reaction", position, wrenches[:, k, :3], wrenches[:, k, 3:]))
            if joint.name in self.robot.joint_names:
                axis = rotated(self.quaternion[:, k + 1], np.asarray(joint.axis, float))
                effort = axis * self.torques[:, 0, self.robot.joint_names.index(joint.name), None]
                loads.append(Load(joint.name, "driver", position, **{"torque" if joint.turning else "force": effort}))
        return loads

    def dataset(self) -> Dataset:
        """Return the dataset of coordinates and torques."""
        variables = {}
        for name, quantity in self.outputs.items():
            padded = np.full(self.q.shape[:2], np.nan)
            padded[:, : quantity.values.shape[1]] = quantity.values[..., 0]
            key = name.replace("torque of ", "torque_").replace("force of ", "force_")
            variables[key] = (("time", "derivative"), padded, {"units": quantity.unit})
        axes = time_axes(self.time, self.order + 1)
        return Dataset(variables, coords=axes, attrs={"title": self.robot.name, "source": "jounce"})


class RobotSubject:
    """A robot whose joints follow a trajectory, or swing.

    Parameters
    ----------
    robot : Robot
        A robot without closures.
    appearance : Appearance
        Shapes of its moving links and its base.
    trajectory : JointTrajectory, optional
        By default each joint swings; its middle and amplitude are sliders.

    Raises
    ------
    RobotError
        If the robot has no moving joint, or the trajectory names other joints.
    """

    no_sliders = "The robot follows a trajectory. Without one, each joint swings, and has sliders here."

    def __init__(self, robot: Robot, appearance: Appearance, trajectory: JointTrajectory | None = None):
        if not robot.joint_names:
            raise RobotError("nothing moves: the robot has no moving joint", name=robot.name)
        for name in trajectory.names if trajectory is not None else ():
            check_name("moving joint", name, robot.joint_names, RobotError, name="trajectory")
        if trajectory is not None:
            check_measures(robot, trajectory)
        self.robot, self.appearance, self.trajectory = robot, appearance, trajectory
        self.name, self.loaded = robot.name, has_masses(robot)
        self.driven, share = self.joints_driven()
        self.parameters = () if trajectory is not None else swing_parameters(robot, self.driven, share)

    def joints_driven(self) -> tuple[tuple[str, ...], float]:
        """Return the driven joints, and the fraction of their swings that is possible."""
        return self.robot.joint_names, 1.0

    def laws(self, values: Mapping[str, float]) -> tuple[JointTrajectory, Times]:
        """Return the trajectory, by default that of swinging joints, and the shown instants."""
        if self.trajectory is not None:
            return self.trajectory, np.asarray(self.trajectory.times)
        laws = swinging(values, self.driven)
        return laws, np.linspace(laws.start, laws.stop, FRAMES)

    def solve(self, values: Mapping[str, float], order: int) -> Recording:
        """Return the motion for some swings.

        Raises
        ------
        JounceError
            If the trajectory does not fit, or the period is not positive.
        """
        robot, (laws, time) = self.robot, self.laws(values)
        q = coordinates(robot, laws, time, max(order, 1))
        links = (robot.base, *robot.moving_links)
        frames = [forward_kinematics(robot, q[:, :1], link) for link in links]
        rotations = [from_rotation_matrices(np.asarray(frame.rotation)[:, 0]) for frame in frames]
        return RobotRecording(
            robot=robot,
            q=q,
            title=robot.name,
            planar=False,
            time=time,
            order=max(order, 1),
            bodies=links,
            position=np.stack([np.asarray(frame.position)[:, 0] for frame in frames], axis=1),
            quaternion=np.stack(rotations, axis=1),
            values=dict(values),
            appearance=self.appearance,
        )


def has_masses(robot: Robot) -> bool:
    """Return whether links have a mass."""
    return any(link.inertia is not None for link in robot.links.values())


def swing_of(joint: Joint, limits: Limits) -> tuple[float, float, float, float]:
    """Return the range of a joint, and the middle and amplitude of its swing, rad or m; about zero without a range."""
    low, high, reach = limits.lower, limits.upper, REACH[joint.turning]
    if low is None or high is None or not high > low:
        middle = low if low is not None and low == high else 0.0
        low, high = middle - 2 * reach, middle + 2 * reach
    return low, high, 0.5 * (low + high), min(0.2 * (high - low), reach)


def swing_parameters(robot: Robot, names: tuple[str, ...], fraction: float) -> tuple[Parameter, ...]:
    """Return the parameters of swings: the period, and the amplitude, times a share, and middle of each joint."""
    swings, middles = [], []
    limits = robot.limits  # with those of the joints that follow
    for joint in (robot.joints[name] for name in names):
        low, high, middle, swing = swing_of(joint, limits[joint.name])
        swings.append(Parameter(f"{joint.name} swing", fraction * swing, 0.0, 0.5 * (high - low), "Swings (rad or m)"))
        middles.append(Parameter(f"{joint.name} middle", middle, low, high, "Middles (rad or m)"))
    return (Parameter("period", _period(robot), 1.0, 20.0), *swings, *middles)


def _period(robot: Robot) -> float:
    """Return a period at which all joints keep their limits of velocity."""
    slowest = SWING
    for name, limits in robot.limits.items():
        if limits.velocity:
            slowest = max(slowest, 2 * np.pi * swing_of(robot.joints[name], limits)[3] / limits.velocity)
    return float(np.ceil(slowest))


def swinging(values: Mapping[str, float], names: tuple[str, ...]) -> JointTrajectory:
    """Return the trajectory of swinging joints, with phases shifted from joint to joint.

    Raises
    ------
    RobotError
        If the period is not positive.
    """
    period = float(values["period"])
    if not period > 0:
        raise RobotError("must be greater than zero", name="period", value=period)
    laws = {
        name: f"{values[f'{name} middle']!r} + {values[f'{name} swing']!r}"
        f"*sin(2*pi*t/{period!r} + {2 * np.pi * k / len(names)!r})"
        for k, name in enumerate(names)
    }
    return JointTrajectory(laws, 0.0, period)


def coordinates(robot: Robot, trajectory: JointTrajectory, time: Times, order: int) -> Coordinates:
    """Return the coordinates of all joints with their derivatives; joints without a law stay at zero."""
    q = np.zeros((len(time), order + 1, len(robot.joint_names)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)  # the page shows their roughness
        derivatives = trajectory.derivatives(time, order)
    for k, name in enumerate(trajectory.names):
        q[..., robot.joint_names.index(name)] = derivatives[..., k]
    return q
