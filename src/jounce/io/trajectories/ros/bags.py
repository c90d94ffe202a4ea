"""Bags of ROS and ROS 2: joint states and trajectories of a topic, read by the package rosbags."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from jounce.errors import TrajectoryError
from jounce.io.trajectories.recordings import LEVELS, Recording
from jounce.io.trajectories.ros.joint_states import State, recorded_states
from jounce.io.trajectories.ros.states import MEASURED, SEVERAL_COORDINATES, interface_levels, left_out_notes
from jounce.io.trajectories.stamps import in_sequence

SUFFIXES = (".bag", ".db3", ".mcap")
METADATA = "metadata.yaml"
NANO = 1_000_000_000
STATE, TRAJECTORY = "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"
CONTROLLER = "control_msgs/msg/JointTrajectoryControllerState"
DYNAMIC = "control_msgs/msg/DynamicJointState"
STATES = (STATE, CONTROLLER, DYNAMIC)
MOST = 20_000_000
"""Largest number of messages."""


def is_bag(path: str) -> bool:
    """Return whether a path is that of a bag: a bag file, or the folder of a ROS 2 bag."""
    place = Path(path)
    try:
        return place.suffix.lower() in SUFFIXES or (place.is_dir() and (place / METADATA).is_file())
    except (OSError, ValueError):
        return False


def read_bag(path: str, joints: Sequence[str] | None = None, topic: str | None = None) -> Recording:
    """Return the recording of a topic of a bag: states of joints or of a controller, or one JointTrajectory.

    Raises
    ------
    TrajectoryError
        If rosbags is not installed, the bag cannot be read, or the topic is missing or ambiguous.
    """
    try:
        highlevel: Any = importlib.import_module("rosbags.highlevel")
        stores: Any = importlib.import_module("rosbags.typesys")
    except ImportError:
        message = "bags need the package rosbags: pip install 'jounce[bags]'"
        raise TrajectoryError(message, path=path) from None
    place = Path(path)
    if not place.exists():
        raise TrajectoryError("file not found", path=path)
    if place.suffix.lower() in SUFFIXES[1:] and (place.parent / METADATA).is_file():
        place = place.parent
    try:
        with highlevel.AnyReader([place], default_typestore=stores.get_typestore(stores.Stores.LATEST)) as reader:
            connections = _chosen(reader, topic, path)
            if connections[0].msgtype in STATES:
                recording = _states(reader, connections, path)
            else:
                recording = _trajectory(reader, connections, path)
    except TrajectoryError:
        raise
    except Exception as reason:  # noqa: BLE001 - any error of the reader about a damaged bag
        text = " ".join(str(reason).split()).encode("ascii", "backslashreplace").decode("ascii")
        message = f"the bag cannot be read: {text or type(reason).__name__}; {_repair_advice(place)}"
        raise TrajectoryError(message, path=path) from None
    recording = in_sequence(recording)
    return recording if joints is None else recording.renamed(tuple(joints))


def _repair_advice(place: Path) -> str:
    """Return advice about repairing a bag whose recording or copy was cut short."""
    suffixes = {x.suffix.lower() for x in (place, *(place.iterdir() if place.is_dir() else ()))}
    tool = "mcap recover" if ".mcap" in suffixes else "rosbag reindex" if ".bag" in suffixes else "ros2 bag reindex"
    return f"if its recording or its copy was cut short, copy it again, or mend it by `{tool}`"


def _chosen(reader: Any, topic: str | None, path: str) -> list[Any]:
    """Return the connections of one topic of a supported type."""
    fit = [x for x in reader.connections if x.msgtype in (*STATES, TRAJECTORY)]
    topics = list(dict.fromkeys(x.topic for x in fit))
    if topic is not None:
        if topic not in topics:
            valid = ", ".join(topics) or "none"
            message = f"no topic of joint states or trajectories has this name; valid: {valid}"
            raise TrajectoryError(message, path=path, name="topic", value=topic)
        topics = [topic]
    if not topics:
        types = ", ".join(sorted({str(x.msgtype) for x in reader.connections})) or "nothing"
        message = f"the bag has no topic of {', '.join(STATES)} or {TRAJECTORY}"
        if any("MultiDOF" in str(x.msgtype) for x in reader.connections):
            message += f"; {SEVERAL_COORDINATES}"
        raise TrajectoryError(message, path=path, value=types)
    states = [x for x in topics if any(c.topic == x and c.msgtype in STATES for c in fit)]
    topics = topics if len(topics) == 1 or len(states) != 1 else states
    if len(topics) > 1:
        message = "the bag has several topics of joint states or trajectories; choose one: " + ", ".join(topics)
        raise TrajectoryError(message, path=path, name="topic")
    return [x for x in fit if x.topic == topics[0]]


def _states(reader: Any, connections: list[Any], path: str) -> Recording:
    states, received, others = [], [], dict[str, None]()
    for connection, stamp, raw in reader.messages(connections=connections):
        message = reader.deserialize(raw, connection.msgtype)
        if len(states) >= MOST:
            raise TrajectoryError(f"has more than {MOST} messages; cut the bag", path=path)
        own, (names, *levels) = message.header.stamp, _measured(message)
        number = len(states) + 1
        others.update(dict.fromkeys(x for x in getattr(message, "joint_names", ()) if x not in names))
        if not names or len(levels[0]) != len(names) or not np.isfinite(levels[0]).all():
            fault = f"message {number} of {connection.topic} must have one finite position for each joint"
            raise TrajectoryError(fault, path=path, name="position", value=levels[0].tolist()[:10])
        if len(set(names)) < len(names):
            fault = f"message {number} of {connection.topic} names a joint twice"
            raise TrajectoryError(fault, path=path, name="name", value=names[:10])
        has_velocities = len(levels[1]) == len(names) and bool(np.isfinite(levels[1]).all())
        states.append(
            State(Decimal(own.sec) + Decimal(int(own.nanosec)) / NANO, names, levels[: 1 + has_velocities], 0)
        )
        received.append(Decimal(stamp) / NANO)
    if len(states) < 2:
        raise TrajectoryError("at least two samples are needed", path=path, value=len(states))
    if not any(state.stamp for state in states):  # without stamps: the times of reception
        states = [State(stamp, x.names, x.levels) for stamp, x in zip(received, states, strict=True)]
    recording = recorded_states(path, states)
    return dataclasses.replace(recording, notes=(*recording.notes, *left_out_notes(others)))


def _measured(message: Any) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Return names, positions and velocities of a joint state, or of what a controller measured."""
    if hasattr(message, "interface_values"):
        values = [dict(zip(x.interface_names, x.values, strict=False)) for x in message.interface_values]
        names, levels = interface_levels(list(message.joint_names), values)
        velocities = levels[1] if len(levels) > 1 else []
        return list(names), np.asarray(levels[0], float), np.asarray(velocities, float)
    if hasattr(message, "joint_names"):
        part = next(getattr(message, key) for key in MEASURED if hasattr(message, key))
        return list(message.joint_names), np.asarray(part.positions, float), np.asarray(part.velocities, float)
    return list(message.name), np.asarray(message.position, float), np.asarray(message.velocity, float)


def _trajectory(reader: Any, connections: list[Any], path: str) -> Recording:
    messages = [
        reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages(connections=connections)
    ]
    if len(messages) != 1:
        message = f"the topic has {len(messages)} trajectories, and one is read; cut the bag to one of them"
        raise TrajectoryError(message, path=path, name="topic", value=connections[0].topic)
    names, points = tuple(messages[0].joint_names), messages[0].points
    if len(points) < 2:
        raise TrajectoryError("must have two points at least", path=path, name="points", value=len(points))
    values = np.full((len(points), len(LEVELS), len(names)), np.nan)
    times = np.empty(len(points))
    for k, point in enumerate(points):
        times[k] = point.time_from_start.sec + point.time_from_start.nanosec / NANO
        for level, key in enumerate(LEVELS):
            row = np.asarray(getattr(point, key), float)
            if len(row) not in ((len(names),) if level == 0 else (0, len(names))) or not np.isfinite(row).all():
                fault = f"must be {len(names)} finite numbers, one for each joint"
                raise TrajectoryError(fault, path=path, name=f"points[{k}].{key}", value=row.tolist()[:10])
            if len(row):
                values[k, level] = row
        if k and times[k] < times[k - 1]:
            fault = "must come after that of the point before"
            raise TrajectoryError(fault, path=path, name=f"points[{k}].time_from_start", value=float(times[k]))
    return Recording(path, names, times, values, points=True)
