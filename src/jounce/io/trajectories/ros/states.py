"""States of joints as ROS prints them one after another: joint states, and those of controllers of ros2_control."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection
from typing import Any

from jounce.io.files.located_data import Source
from jounce.io.trajectories.recordings import LEVELS, Recording
from jounce.io.trajectories.ros.fields import joint_names, joint_row, stamp_of
from jounce.io.trajectories.ros.joint_states import State, recorded_states

STATES = ("position", "velocity")
MEASURED = ("feedback", "actual")
"""Keys of the measured values in a controller state, in newer and older versions."""
SEVERAL_COORDINATES = (
    "poses of planar and floating joints are not read; write their coordinates, and those of the other joints, as "
    "columns of a table, or keep to what holds the other joints, as /joint_states"
)


def is_joint_state(data: Any) -> bool:
    """Return whether data are a JointState."""
    return isinstance(data, dict) and "name" in data and "position" in data


def measured_part(data: Any) -> str | None:
    """Return the key of the measured values in a controller state; None for other data."""
    if not isinstance(data, dict) or "joint_names" not in data or "points" in data:
        return None
    return next((key for key in MEASURED if isinstance(data.get(key), dict)), None)


def _is_dynamic_state(data: Any) -> bool:
    return isinstance(data, dict) and "joint_names" in data and "interface_values" in data


def _is_multiple_state(data: Any) -> bool:
    return isinstance(data, dict) and "joint_names" in data and "transforms" in data


def is_state(data: Any) -> bool:
    """Return whether data are one of the messages that `read_states` knows."""
    return _is_multiple_state(data) or any(kind(data) for kind in READERS)


def read_states(source: Source) -> Recording:
    """Return the recording of a list of messages of one kind.

    The last one is left out, with a note, if its printing was interrupted.

    Raises
    ------
    TrajectoryError
        If a message lacks something, or has poses of joints of several coordinates.
    """
    messages = source.data if isinstance(source.data, list) else [source.data]
    if _is_multiple_state(messages[0]):
        raise source.error(SEVERAL_COORDINATES)
    if source.unfinished is None and len(messages) > 1 and _ends_early(messages[-1], messages[-2]):
        unfinished = source.line((len(messages) - 1,))
        source = dataclasses.replace(source, data=messages[:-1], unfinished=unfinished)
    if len(messages) < 2 or len(source.data) < 2:
        raise source.error("a single state is no trajectory; echo more than one")
    kind, read = next(row for row in READERS.items() if row[0](messages[0]))
    other = next((k for k, message in enumerate(source.data) if not kind(message)), None)
    if other is not None:
        message = f"message {other + 1} is not of the kind of the first one, or lacks a part; leave it out"
        raise source.error(message, (other,))
    return without_unfinished(source, read(source))


def without_unfinished(source: Source, recording: Recording) -> Recording:
    """Return a recording with a note about a last message that was not printed to its end."""
    if source.unfinished is None:
        return recording
    note = f"the last message, from line {source.unfinished}, was not printed to its end, and is left out"
    return dataclasses.replace(recording, notes=(note, *recording.notes))


def _ends_early(last: Any, before: Any) -> bool:
    """Return whether a message lacks what the one before it has."""
    sizes = [len(_named(x)) for x in (last, before)]
    pairs = [(last, before)]
    while pairs:
        own, other = pairs.pop()
        if isinstance(other, dict):
            if not isinstance(own, dict) or other.keys() - own.keys():
                return True
            pairs += [(own[key], other[key]) for key in other]
        elif own is None and other is not None:
            return True
        elif isinstance(other, list) and isinstance(own, list) and len(other) == sizes[1]:
            if len(own) < sizes[0]:
                return True
            pairs += zip(own, other, strict=False)
    return False


def _named(message: Any) -> list[Any]:
    names = message.get("name", message.get("joint_names")) if isinstance(message, dict) else None
    return names if isinstance(names, list) else []


def _joint_states(source: Source) -> Recording:
    states = []
    for k, state in enumerate(source.data):
        names = joint_names(source, (k, "name"), state["name"])
        levels = [
            joint_row(source, (k, key), state[key], len(names), key != STATES[0]) for key in STATES if state.get(key)
        ]
        if not state["position"]:
            raise source.error("positions are missing", (k, "position"))
        states.append(_state(source, k, names, levels))
    return recorded_states(source.path, states)


def _controller_states(source: Source) -> Recording:
    """Return the recording of the measured values in a list of controller states."""
    states, keys = [], set()
    for k, state in enumerate(source.data):
        key = str(measured_part(state))
        names, part = joint_names(source, (k, "joint_names"), state["joint_names"]), state[key]
        if not part.get("positions"):
            raise source.error("positions are missing", (k, key))
        levels = [
            joint_row(source, (k, key, x), part[x], len(names), x != LEVELS[0]) for x in LEVELS[:2] if part.get(x)
        ]
        states.append(_state(source, k, names, levels))
        keys.add(key)
    recording = recorded_states(source.path, states)
    note = f"of the states of a controller, only measured values are read ({', '.join(sorted(keys))})"
    return dataclasses.replace(recording, notes=(*recording.notes, note))


def _dynamic_states(source: Source) -> Recording:
    """Return the recording of interface values: positions, and velocities where all joints have one."""
    states, others = [], dict[str, None]()
    for k, state in enumerate(source.data):
        names = joint_names(source, (k, "joint_names"), state["joint_names"])
        interfaces = state["interface_values"]
        if not isinstance(interfaces, list) or len(interfaces) != len(names):
            raise source.error(f"must be a list of {len(names)} entries, one for each joint", (k, "interface_values"))
        values = [_interfaces(source, k, j) for j in range(len(names))]
        measured, levels = interface_levels(names, values)
        if not measured:
            raise source.error("no joint has an interface named position", (k, "interface_values"))
        joint_row(source, (k, STATES[0]), levels[0], len(measured))
        others.update(dict.fromkeys(name for name in names if name not in measured))
        states.append(_state(source, k, measured, levels))
    recording = recorded_states(source.path, states)
    return dataclasses.replace(recording, notes=(*recording.notes, *left_out_notes(others)))


def _interfaces(source: Source, k: int, j: int) -> dict[str, float]:
    """Return the values of the interfaces of a joint, by name."""
    location = (k, "interface_values", j)
    entry = source.data[k]["interface_values"][j]
    if not isinstance(entry, dict) or not {"interface_names", "values"} <= entry.keys():
        raise source.error("must have interface_names and values", location, value=entry)
    names = entry["interface_names"] and joint_names(source, (*location, "interface_names"), entry["interface_names"])
    if not names:
        return {}
    return dict(
        zip(names, joint_row(source, (*location, "values"), entry["values"], len(names), unknown=True), strict=True)
    )


def interface_levels(names: Any, values: Any) -> tuple[tuple[str, ...], list[list[float]]]:
    """Return the joints that have a position, and their positions, then velocities if all have one."""
    own = {name: x for name, x in zip(names, values, strict=True) if STATES[0] in x}
    count = 2 if all(STATES[1] in x for x in own.values()) else 1
    return tuple(own), [[x[key] for x in own.values()] for key in STATES[:count]]


def left_out_notes(names: Collection[str]) -> tuple[str, ...]:
    """Return a note about what a dynamic state names without a position, such as sensors."""
    return (f"without an interface position, and left out: {', '.join(names)}",) if names else ()


def _state(source: Source, k: int, names: tuple[str, ...], levels: list[list[float]]) -> State:
    header = source.data[k].get("header")
    stamp = stamp_of(source, (k, "header", "stamp"), header.get("stamp") if isinstance(header, dict) else None)
    return State(stamp, names, levels, source.line((k,)) or 0)


READERS: dict[Callable[[Any], Any], Callable[[Source], Recording]] = {
    is_joint_state: _joint_states,
    measured_part: _controller_states,
    _is_dynamic_state: _dynamic_states,
}
"""Functions that recognize messages, with those that read lists of them."""
