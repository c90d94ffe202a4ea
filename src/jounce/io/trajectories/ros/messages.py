"""ROS messages as files: trajectories, goals of controllers, and joint states, as printed and saved by tools."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from jounce.io.files.located_data import Location, Source
from jounce.io.trajectories.recordings import LEVELS, Recording
from jounce.io.trajectories.ros.fields import check_whole, joint_names, joint_row, number_of, seconds_of
from jounce.io.trajectories.ros.states import (
    SEVERAL_COORDINATES,
    is_joint_state,
    is_state,
    read_states,
    without_unfinished,
)
from jounce.io.trajectories.stamps import in_sequence

SEVERAL = ("multi_dof_joint_trajectory", "multi_dof_trajectory")
"""Where RobotTrajectory and goals of controllers hold the motion of planar and floating joints."""
START = 1e-6  # rad or m, largest distance of the robot from the start of a trajectory
_POINT = {*LEVELS, "effort", "time_from_start"}
_OF_GOALS: tuple[tuple[str, ...], ...] = ((), ("trajectory",), ("goal", "trajectory"))
_OF_ROBOTS: tuple[tuple[str, ...], ...] = (*_OF_GOALS, ("planned_trajectory",), ("motion_plan_response", "trajectory"))
_INSIDE = (*_OF_GOALS, *((*keys, "joint_trajectory") for keys in _OF_ROBOTS))
"""Locations of a JointTrajectory: itself, in goals of controllers, and in a RobotTrajectory, goals and plans of MoveIt.
"""


def is_message(data: Any) -> bool:
    """Return whether the data of a file are those of one or several ROS messages."""
    first = data[0] if isinstance(data, list) and data else data
    if not isinstance(first, dict):
        return False
    displayed = isinstance(first.get("trajectory"), list) and "model_id" in first
    return displayed or is_state(first) or any(_is_trajectory(_inside(first, keys)) for keys in _INSIDE)


def _inside(data: Any, keys: Sequence[str]) -> Any:
    for key in keys:
        data = data.get(key) if isinstance(data, dict) else None
    return data


def _is_trajectory(data: Any) -> bool:
    return isinstance(data, dict) and "joint_names" in data and "points" in data


def read_messages(source: Source, joints: Sequence[str] | None = None) -> Recording:
    """Return the recording of a ROS message, or of a list of joint states; `joints` replace the names in it.

    The message is a JointTrajectory, a FollowJointTrajectory goal, a RobotTrajectory, DisplayTrajectory, plan or goal
    of ExecuteTrajectory of MoveIt, a JointState, a DynamicJointState, or a JointTrajectoryControllerState, whose
    measured values are read.

    Raises
    ------
    TrajectoryError
        If something is missing, or is not the required number: the message names the line.
    """
    data = source.data
    if is_state(data[0] if isinstance(data, list) else data):
        recording = read_states(source)
    elif isinstance(data, list) and len(data) == 1:
        lines = {location[1:]: line for location, line in source.lines.items() if location[:1] == (0,)}
        recording = _trajectories(dataclasses.replace(source, data=data[0], lines=lines))
    elif isinstance(data, list):
        message = f"the file has {len(data)} messages, each a trajectory of its own; keep one"
        raise source.error(message, (1,))
    else:
        recording = without_unfinished(source, _trajectories(source))
    recording = in_sequence(recording)
    return recording if joints is None else recording.renamed(tuple(joints))


def _trajectories(source: Source) -> Recording:
    """Return the points of a trajectory, or of consecutive ones."""
    displayed = source.data.get("trajectory")
    if not isinstance(displayed, list):
        keys = next(keys for keys in _INSIDE if _is_trajectory(_inside(source.data, keys)))
        recording = _without_base(source, keys[:-1], _points(source, keys))
        return _started(source, recording, keys[:-2])
    if not displayed:
        raise source.error("holds no trajectory", ("trajectory",))
    locations: list[Location] = [("trajectory", k, "joint_trajectory") for k in range(len(displayed))]
    for location in locations:
        if not _is_trajectory(_at(source, location)):
            raise source.error("must hold joint_names and points", location[:2])
    parts = [_points(source, location) for location in locations]
    merged = parts[0]
    for location, part in zip(locations[1:], parts[1:], strict=True):
        merged = _joined(source, location, merged, part)
    for location in locations:
        merged = _without_base(source, location[:-1], merged)
    return _started(source, merged)


def _without_base(source: Source, location: Location, recording: Recording) -> Recording:
    """Return a recording with a note about joints of several coordinates that a message moves beside its joints."""
    for key in SEVERAL:
        base_location = _at(source, (*location, key))
        if isinstance(base_location, dict) and base_location.get("points"):
            names = ", ".join(str(name) for name in base_location.get("joint_names") or ())
            place = f"{key}, line {source.line((*location, key))}"
            note = f"the motion of joints of several coordinates is left out: {names} ({place})"
            return dataclasses.replace(recording, notes=(*recording.notes, note))
    return recording


def _joined(source: Source, place: Location, first: Recording, second: Recording) -> Recording:
    is_alike = first.names == second.names and first.values.shape[1] == second.values.shape[1]
    if not is_alike or np.nanmax(np.abs(first.values[-1, 0] - second.values[0, 0])) > START:
        message = "does not start where the trajectory before it ends, with the same joints; keep one of them"
        raise source.error(message, place)
    if not np.array_equal(first.values[-1], second.values[0], equal_nan=True):
        message = "does not go on with the velocities and accelerations of the trajectory before it; keep one of them"
        raise source.error(message, place)
    times = np.append(first.times, first.times[-1] + second.times[1:] - second.times[0])
    lines = [*first.lines, *second.lines[1:]]
    values = np.concatenate([first.values, second.values[1:]])
    return Recording(first.path, first.names, times, values, lines, points=True)


def _started(source: Source, recording: Recording, place: Location = ()) -> Recording:
    """Raise an error if a message states that the robot does not start where its trajectory does."""
    location: Location = (*place, "trajectory_start", "joint_state")
    state = _at(source, location)
    if not is_joint_state(state) or len(state["name"]) != len(state["position"]):
        return recording
    where = dict(zip(state["name"], state["position"], strict=True))
    for k, name in enumerate(recording.names):
        position = number_of(where.get(name))
        if position is not None and abs(position - recording.values[0, 0, k]) > START:
            message = (
                f"the robot starts at {position:.9g}, and the trajectory of {name} at "
                f"{recording.values[0, 0, k]:.9g}: it would jump"
            )
            raise source.error(message, (*location, "position"))
    return recording


def _at(source: Source, location: Location) -> Any:
    """Return the value at a location, also within lists; None if there is none."""
    entry = source.data
    for step in location:
        if isinstance(step, int):
            entry = entry[step] if isinstance(entry, list) and step < len(entry) else None
        else:
            entry = entry.get(step) if isinstance(entry, dict) else None
    return entry


def _points(source: Source, location: Location) -> Recording:
    """Return the points of the JointTrajectory at a location."""
    data = _at(source, location)
    for key in data:
        if key not in ("header", "joint_names", "points"):
            raise source.error("unknown key of a trajectory; valid: header, joint_names, points", (*location, key))
    names = joint_names(source, (*location, "joint_names"), data["joint_names"])
    points = data["points"]
    check_whole(source, (*location, "points"), points)
    if not isinstance(points, list) or len(points) < 2:
        raise source.error("must be a list of two points at least", (*location, "points"))
    values = np.full((len(points), len(LEVELS), len(names)), np.nan)
    times, lines = [], []
    for k, point in enumerate(points):
        place: Location = (*location, "points", k)
        if isinstance(point, dict) and "transforms" in point:
            raise source.error(SEVERAL_COORDINATES, place)
        if not isinstance(point, dict) or set(point) - _POINT:
            raise source.error("must be a point of a trajectory, with positions", place, value=point)
        if not point.get("positions"):
            raise source.error("positions are missing", place)
        for level, key in enumerate(LEVELS):
            if point.get(key):
                values[k, level] = joint_row(source, (*place, key), point[key], len(names))
        times.append(seconds_of(source, (*place, "time_from_start"), point.get("time_from_start")))
        lines.append(source.line(place) or 0)
        if k and times[k] < times[k - 1]:
            message = "must come after that of the point before"
            raise source.error(message, (*place, "time_from_start"), value=times[k])
    given = len(LEVELS) - int(np.argmax(np.append(~np.isnan(values).all(axis=(0, 2)), True)[::-1][1:]))
    return Recording(source.path, names, np.array(times), values[:, :given], lines, points=True)
