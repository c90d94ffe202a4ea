"""Trajectories in the file formats of controllers, sampled at their rates."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import TrajectoryError, check_name
from jounce.io.files.writing import check_target, replacing
from jounce.io.trajectories.controller_formats import FORMATS, ControllerFormat, checked_format
from jounce.robot import CarriedLoad, LoadedRobot, Robot
from jounce.settings import under_own_settings
from jounce.trajectory import JointTrajectory

UNITS = ("", "/s", "/s^2")
REST_SPEED = 1e-9  # rad/s or m/s, below which a joint is at rest
UNFORCED = 1e-6  # rad/s^2 or m/s^2
NANO = 1_000_000_000
LEVELS = ("positions", "velocities", "accelerations")


@under_own_settings
def export_trajectory(
    robot: Robot,
    trajectory: JointTrajectory,
    path: str | PathLike[str],
    format: str,  # noqa: A002 - also the name of the option of the command
    rate: float | None = None,
    *,
    joints: Sequence[str] | None = None,
    torques: bool = False,
    loads: Sequence[CarriedLoad] = (),
    header_units: bool = False,
    overwrite: bool = False,
) -> Float[np.ndarray, " time"]:
    """Write a trajectory in the file format of a controller, at its rate.

    Parameters
    ----------
    robot : Robot
        Robot with its loads.
    trajectory : JointTrajectory
        Trajectory of its joints.
    path
        File to write: .csv for ``franka`` and ``ur``, .yaml for ``ros``.
    format : {"franka", "ur", "ros"}
        Columns of libfranka's robot state (``q_d_0``, ``dq_d_0``, ``ddq_d_0``, ...), of Universal Robots' real-time
        data exchange (``target_q_0``, ``target_qd_0``, ``target_qdd_0``, ...), or a ROS ``JointTrajectory`` message.
    rate : float, optional
        Rows per second; by default 1000 for ``franka``, 500 for ``ur``, 100 for ``ros``.
    joints : sequence of str, optional
        Joints in the order of the controller; by default those of the trajectory in the order of the robot.
    torques : bool, default False
        Whether to write torques, too: ``tau_J_d_0``, on the link side and without gravity, and its rate ``dtau_J_d_0``;
        ``target_moment_0``; ``effort``.
    loads : sequence of CarriedLoad, optional
        Loads that links carry during parts of the motion, for the torques.
    header_units : bool, default False
        Whether to state units in the heading of a table, as ``q_d_0 [rad]``.
    overwrite : bool, default False
        Whether the file may be one that was read as an input.

    Returns
    -------
    numpy.ndarray of shape (time,)
        Instants of the rows, s. If the period does not divide the duration, the last row of a table holds the end for
        the rest of its period, which requires a trajectory that ends at rest; a ROS message ends exactly at the end.

    Raises
    ------
    TrajectoryError
        If the format does not exist, the joints or the rate do not suit it, or a required rest at the end is missing.
    OutputError
        If the file cannot be written.

    Examples
    --------
    >>> import jounce as jn
    >>> robot = jn.load_robot("examples/robots/ur5.urdf")
    >>> trajectory = jn.load_trajectory("examples/trajectories/ur5_stack.yaml")
    >>> times = jn.io.export_trajectory(robot, trajectory, "stack.csv", "ur")  # doctest: +SKIP
    """
    controller = FORMATS.get(checked_format(format))
    check_target(path, (".csv",) if controller else (".yaml", ".yml"), f"{format} trajectory", overwrite=overwrite)
    names = _chosen(robot, trajectory, controller, format, joints)
    frequency = _checked_rate(controller, format, rate)
    if controller is None:
        text, times = _message(robot, trajectory, names, frequency, torques, loads)
    else:
        text, times = _table(
            robot, trajectory, names, frequency, controller, torques=torques, loads=loads, units=header_units
        )
    with replacing(path, overwrite=overwrite) as scratch:
        scratch.write_text(text, encoding="utf-8")
    return times


def _chosen(
    robot: Robot,
    trajectory: JointTrajectory,
    controller: ControllerFormat | None,
    name: str,
    joints: Sequence[str] | None,
) -> tuple[str, ...]:
    """Return the joints to write, in the order of the controller."""
    for joint in trajectory.names:
        check_name("moving joint", joint, robot.joint_names, TrajectoryError, name="joint")
    names = (
        tuple(joint for joint in robot.joint_names if joint in trajectory.names) if joints is None else tuple(joints)
    )
    for k, joint in enumerate(names):
        check_name("joint of the trajectory", joint, trajectory.names, TrajectoryError, name="joints")
        if joint in names[:k]:
            raise TrajectoryError("a joint is named twice", name="joints", value=joint)
    if controller is not None and len(names) != controller.joints:
        message = f"the format {name} has {controller.joints} joints; name those that it is for, in its order"
        raise TrajectoryError(message, name="joints", value=list(names))
    return names


def _checked_rate(controller: ControllerFormat | None, name: str, rate: float | None) -> float:
    if rate is None:
        return controller.rates[0] if controller else 100.0
    if not (np.isfinite(rate) and rate > 0):
        raise TrajectoryError("must be greater than zero", name="rate", value=rate)
    if controller is not None and rate not in controller.rates:
        valid = " or ".join(f"{x:g}" for x in sorted(controller.rates))
        raise TrajectoryError(f"the format {name} takes {valid} rows a second", name="rate", value=rate)
    return float(rate)


def _values(
    robot: Robot,
    trajectory: JointTrajectory,
    names: tuple[str, ...],
    times: Any,
    efforts: int,
    controller: Any,
    loads: Sequence[CarriedLoad],
) -> list[np.ndarray]:
    """Return positions, velocities, accelerations, torques and their rates at instants, (time, joints) each."""
    # local, because the import takes a sixth of a second, which reading does not need
    from jounce.dynamics.limits.trajectories import FollowedTrajectory, in_time

    order = max(2, efforts + 1)
    followed = FollowedTrajectory(robot, trajectory)
    q = followed.coordinates(times, order)
    columns = [robot.joint_names.index(name) for name in names]
    values = [q[:, k, columns] for k in range(3)]
    if efforts:
        robot_in_gravity = robot if controller is None or controller.gravity else robot.with_gravity([0.0, 0.0, 0.0])
        loaded = LoadedRobot(robot_in_gravity, in_time(loads), trajectory.start, trajectory.stop)
        tau = loaded.torques(q, times, controller is None or controller.drives)
        values += [tau[:, k, columns] for k in range(efforts)]
    return values


def _table(
    robot: Robot,
    trajectory: JointTrajectory,
    names: tuple[str, ...],
    frequency: float,
    controller: ControllerFormat,
    *,
    torques: bool,
    loads: Sequence[CarriedLoad],
    units: bool,
) -> tuple[str, np.ndarray]:
    duration = trajectory.stop - trajectory.start
    rows = int(np.floor(duration * frequency * (1 + 1e-12) + 1e-9))
    exact = duration * frequency - rows <= 1e-6
    times = trajectory.start + np.arange(rows + (1 if exact else 2)) / frequency
    levels = (*controller.levels, *(controller.efforts if torques else ()))
    inside = np.minimum(times, trajectory.stop)
    values = _values(robot, trajectory, names, inside, len(controller.efforts) if torques else 0, controller, loads)
    fastest, hardest = (float(np.abs(level[-1]).max()) for level in values[1:3])
    if not exact and (fastest > REST_SPEED or hardest > UNFORCED):
        message = (
            f"the period does not divide the duration of {duration:.9g} s, and at its end the joints move at up to "
            f"{fastest:.3g} rad/s or m/s and accelerate at up to {hardest:.3g} rad/s^2 or m/s^2: a row after the end "
            "would stop that at once; choose another rate, or let the trajectory end at rest"
        )
        raise TrajectoryError(message, name="rate", value=frequency)
    kinds = [_units(robot, name) for name in names]
    heading = [f"{controller.time} [s]" if units else controller.time]
    for k, level in enumerate(levels):
        unit_texts = [f" [{kind[k]}]" if units else "" for kind in kinds]
        heading += [f"{level}_{j}{unit}" for j, unit in enumerate(unit_texts)]
    table = np.column_stack([times, *values])
    line = ",".join(["%.17g"] * table.shape[1])
    return "\n".join([",".join(heading), *(line % tuple(row) for row in table.tolist()), ""]), times


def _units(robot: Robot, name: str) -> list[str]:
    turning = robot.joints[name].turning
    base, effort = ("rad", "N*m") if turning else ("m", "N")
    return [*(base + unit for unit in UNITS), effort, f"{effort}/s"]


def _message(
    robot: Robot,
    trajectory: JointTrajectory,
    names: tuple[str, ...],
    frequency: float,
    torques: bool,
    loads: Sequence[CarriedLoad],
) -> tuple[str, np.ndarray]:
    """Return a ROS message as YAML; its times are whole nanoseconds, at which the values are evaluated."""
    duration = round((trajectory.stop - trajectory.start) * NANO)
    count = int(np.ceil(duration / NANO * frequency * (1 - 1e-12) - 1e-9))
    ticks = [*(tick for k in range(count) if (tick := round(k * NANO / frequency)) < duration), duration]
    times = np.minimum(trajectory.start + np.array(ticks) / NANO, trajectory.stop)
    values = _values(robot, trajectory, names, times, int(torques), None, loads)
    keys = (*LEVELS, "effort")[: len(values)]
    lines = [
        "header: {stamp: {sec: 0, nanosec: 0}, frame_id: ''}",
        f"joint_names: [{', '.join(map(_quoted, names))}]",
        "points:",
    ]
    for row, tick in enumerate(ticks):
        for k, (key, value) in enumerate(zip(keys, values, strict=True)):
            numbers = ", ".join(map(_number, value[row].tolist()))
            lines.append(f"{'- ' if k == 0 else '  '}{key}: [{numbers}]")
        lines.append(f"  time_from_start: {{sec: {tick // NANO}, nanosec: {tick % NANO}}}")
    return "\n".join([*lines, ""]), times


def _number(value: float) -> str:
    """Return a number with a decimal point: without it, YAML 1.1 reads 1e-09 as text, and 0 as an integer."""
    mantissa, exponent, power = repr(value).partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{exponent}{power}"


def _quoted(name: str) -> str:
    return "'" + name.replace("'", "''") + "'"
