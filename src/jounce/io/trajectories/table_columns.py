"""Assignment of the columns of a recording to joints and levels, by the names that tools use."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy as np

from jounce.errors import TrajectoryError
from jounce.io.files.column_units import name_and_last_word
from jounce.io.files.long_tables import Numbers
from jounce.io.files.samples import ROW_NUMBER, Table
from jounce.io.trajectories.stamps import NANO
from jounce.units.dimensions import NUMBER, TIME
from jounce.units.shown_units import unit_size

TIMES = ("time", "__time", "%time", "timestamp", "Time", "stamp", "t", "TIME", "Timestamp")
"""Names of columns of times, in results, PlotJuggler, rostopic and controllers."""
SPARE = (ROW_NUMBER, "seq", "frame_id", "success_rate", "control_command_success_rate", "robot_mode")
POSITION, VELOCITY, ACCELERATION, OTHER = 0, 1, 2, 3
WORDS = {
    **dict.fromkeys(("position", "positions", "pos"), POSITION),
    **dict.fromkeys(("velocity", "velocities", "vel"), VELOCITY),
    **dict.fromkeys(("acceleration", "accelerations", "acc", "accel"), ACCELERATION),
    **dict.fromkeys(("effort", "efforts", "eff", "torque", "tau"), OTHER),
}
NUMBERED = {
    POSITION: ("q", "position", "positions", "pos", "joint_positions", "actual_q"),
    VELOCITY: ("dq", "qd", "velocity", "velocities", "vel", "joint_velocities", "actual_qd"),
    ACCELERATION: ("ddq", "qdd", "acceleration", "accelerations", "acc"),
}
OTHER_QUANTITIES = frozenset(
    "tau torque torques effort efforts force forces current currents voltage voltages temp temperature".split()
)
"""Words in the names of columns that hold no positions."""
_BETWEEN_WORDS = re.compile(r"[^A-Za-z]+|(?<=[a-z])(?=[A-Z])")
_WITH_NUMBER = re.compile(r"(?P<word>[A-Za-z_/.]*[A-Za-z])_?(?P<open>\[)?(?P<number>[0-9]+)(?(open)\])$")
NANOSECONDS = ("nanosec", "nanosecs", "nsec", "nsecs")
_SECONDS = re.compile(r"(?P<before>(?:.*[._/ ])?)secs?")
_WHOLE = re.compile(r"\s*[-+]?[0-9]+(?:\.0*)?\s*")
_SUFFIX = re.compile(rf"(?P<joint>.+)[_./ ](?P<word>{'|'.join(WORDS)})$")
_RATE = re.compile(r"(?P<joint>.+)_d[0-9]+$")


@dataclasses.dataclass(frozen=True)
class Columns:
    """The columns of a recording.

    Parameters
    ----------
    time : int
        Index of the column of times.
    joints : dict of str to dict of int to int
        Column of each available level, by joint.
    unnamed : bool
        Whether the names of the joints are invented.
    checked : dict of str to int
        Columns of velocities in results, which are only compared with the positions.
    names : dict of str to int, optional
        Columns of text with the names of joints, by the invented names.
    per_second : int
        Units of the times in a second.
    """

    time: int
    joints: Mapping[str, Mapping[int, int]]
    unnamed: bool = False
    checked: Mapping[str, int] = dataclasses.field(default_factory=dict)
    names: Mapping[str, int] = dataclasses.field(default_factory=dict)
    per_second: int = 1


def other_quantity(name: str) -> str | None:
    """Return the word in the name of a column that shows that it holds no positions; None if there is none.

    Examples
    --------
    >>> [other_quantity(name) for name in ("tau_a", "motorTorque", "elbow", "current_pos", "torque_tube_joint")]
    ['tau', 'Torque', None, None, 'torque']
    """
    parts = _BETWEEN_WORDS.split(name)
    if any(WORDS.get(word.lower()) == POSITION for word in parts):
        return None
    return next((word for word in parts if word.lower() in OTHER_QUANTITIES), None)


def take_units(table: Table) -> None:
    """Move units from the ends of names, as ``elbow_deg``, to the units of a table, as for ``elbow [deg]``.

    Raises
    ------
    JounceError
        If two columns hold the same quantity of one joint.
    """
    header, units = list(table.header), list(table.units)
    read = [name_and_last_word(x) if unit is None else (x, None) for x, unit in zip(header, units, strict=True)]
    names = [name for name, _ in read]
    for k, (name, unit) in enumerate(read):
        dimension = NUMBER if unit is None else unit_size(unit)[1]
        level = -dict(dimension).get("time", 0)
        if dimension == NUMBER or (dimension == TIME and (name not in TIMES or name in header)):
            continue
        rate = level > 0 and names.count(name) > 1  # elbow_deg_s beside elbow_deg
        table.header[k], table.units[k] = f"{name}_{('vel', 'acc')[int(level) - 1]}" if rate else name, unit
    for k, name in enumerate(table.header):
        if (other := table.header.index(name)) != k:
            message = f"two columns are of the same joint, {header[other]} and {header[k]}; leave one of them out"
            raise table.error(message, line=table.header_line, name=name)


def join_stamps(table: Table) -> None:
    """Join seconds and nanoseconds in columns of their own, as ``sec`` and ``nanosec``, to a column of times.

    Nothing is done where another column is named after the time.
    """
    header = table.header
    if _time(header) is not None:
        return
    for k, name in enumerate(header):
        if (match := _SECONDS.fullmatch(name)) is None:
            continue
        others = [f"{match['before']}{word}" for word in NANOSECONDS if f"{match['before']}{word}" in header]
        if len(others) != 1:
            continue
        part = header.index(others[0])
        for line, row in table.rows:
            if len(row) <= max(k, part) or not _WHOLE.fullmatch(row[k]) or not _WHOLE.fullmatch(row[part]):
                message = "seconds beside nanoseconds, and these, must be whole numbers"
                raise table.error(message, line=line, name=name)
            row[k] = str(Decimal(row[k]) + Decimal(row[part]).scaleb(-9))
        if table.numbers is not None:
            table.numbers = _joined(table.numbers, k, part)
        header[k] = TIMES[0]
        for entries in (header, table.units, *(row for _, row in table.rows)):
            del entries[part]
        return


def _joined(numbers: Numbers, seconds: int, nanoseconds: int) -> Numbers:
    """Return numbers with nanoseconds added to the seconds, to which they belong, and without their column."""
    values, offsets = numbers.values.copy(), dict(numbers.offsets)
    parts = values[:, nanoseconds]
    first = Decimal(int(parts[0])) if seconds in offsets else Decimal(0)
    offset = (offsets.pop(nanoseconds, Decimal(0)) + first).scaleb(-9)
    values[:, seconds] += (parts - float(first)) / NANO
    if seconds in offsets:
        offsets[seconds] += offset
    else:
        values[:, seconds] += float(offset)
    offsets = {k - (k > nanoseconds): x for k, x in offsets.items()}
    names = [name for k, name in enumerate(numbers.names) if k != nanoseconds]
    return dataclasses.replace(numbers, names=names, values=np.delete(values, nanoseconds, axis=1), offsets=offsets)


def columns_of(header: Sequence[str]) -> Columns | None:
    """Return the content of the columns of a header; None if it is unknown.

    Raises
    ------
    TrajectoryError
        If two columns may hold the same quantity of one joint.
    """
    for reader in (_of_rostopic, _of_libfranka, _of_plotjuggler, _of_numbers, _of_names):
        columns = reader(header)
        if columns is not None:
            return columns
    return None


def _time(header: Sequence[str]) -> int | None:
    return next((header.index(name) for name in TIMES if name in header), None)


def _of_rostopic(header: Sequence[str]) -> Columns | None:
    """Return the columns of ``rostopic echo -p``: ``field.name0``, ``field.position0``, and stamps in ns."""
    if "%time" not in header or not any(name.startswith("field.") for name in header):
        return None
    stamp = header.index("field.header.stamp") if "field.header.stamp" in header else header.index("%time")
    joints: dict[str, dict[int, int]] = {}
    names: dict[str, int] = {}
    for column, name in enumerate(header):
        if match := re.fullmatch(r"field\.(name|position|velocity)([0-9]+)", name):
            joint = f"joint_{match[2]}"
            if match[1] == "name":
                names[joint] = column
            else:
                joints.setdefault(joint, {})[WORDS[match[1]]] = column
    return Columns(stamp, joints, unnamed=not names, names=names, per_second=NANO) if joints else None


def _of_plotjuggler(header: Sequence[str]) -> Columns | None:
    """Return the series of PlotJuggler: ``/joint_states/JOINT/position``."""
    time = _time(header)
    joints: dict[str, dict[int, int]] = {}
    topics: dict[tuple[str, int], str] = {}
    for column, name in enumerate(header):
        parts = name.strip("/").split("/")
        if len(parts) < 3 or parts[-1] not in WORDS:
            continue
        joint, level = parts[-2], WORDS[parts[-1]]
        if level == OTHER:
            continue
        if (joint, level) in topics:
            message = f"two series are of this joint, {topics[joint, level]} and {name}; leave one of the topics out"
            raise TrajectoryError(message, name=joint)
        topics[joint, level] = name
        joints.setdefault(joint, {})[level] = column
    joints = {joint: levels for joint, levels in joints.items() if POSITION in levels}
    return Columns(time, joints) if joints and time is not None else None


def _of_libfranka(header: Sequence[str]) -> Columns | None:
    """Return the columns of libfranka's ``logToCSV``: ``state.q[0]``, ``state.dq[0]``, and times in ms."""
    time, joints = _time(header), {}
    while (name := f"state.q[{len(joints)}]") in header:
        rate = f"state.dq[{len(joints)}]"
        levels = {POSITION: header.index(name)} | ({VELOCITY: header.index(rate)} if rate in header else {})
        joints[name] = levels
    return Columns(time, joints, unnamed=True, per_second=1000) if joints and time is not None else None


def _of_numbers(header: Sequence[str]) -> Columns | None:
    """Return numbered columns: ``q_0``, ``dq_0``, ``q[0]``, ``position_0``; None if a column is named after a joint."""
    time = _time(header)
    columns: dict[int, dict[int, int]] = {}
    for column, name in enumerate(header):
        match = _WITH_NUMBER.fullmatch(name)
        if match is None and column != time and name not in SPARE:
            return None
        word = match["word"].strip("/").rpartition("/")[2] if match else ""
        level = next((level for level, words in NUMBERED.items() if word in words), None)
        if match is None or level is None:
            continue
        levels = columns.setdefault(int(match["number"]), {})
        if level in levels:
            message = f"two columns are of the same joint, {header[levels[level]]} and {name}; leave one of them out"
            raise TrajectoryError(message, name=name)
        levels[level] = column
    numbers = sorted(number for number, levels in columns.items() if POSITION in levels)
    if time is None or not numbers or numbers[0] > 1 or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        return None
    return Columns(time, {header[columns[number][POSITION]]: columns[number] for number in numbers}, unnamed=True)


def _of_names(header: Sequence[str]) -> Columns | None:
    """Return columns named after joints: ``elbow``, or ``elbow_pos``, with ``elbow_vel`` and ``elbow_acc``."""
    time = _time(header)
    if time is None:
        return None
    joints: dict[str, dict[int, int]] = {}
    suffixes = {column: match for column, name in enumerate(header) if (match := _SUFFIX.fullmatch(name))}
    positioned = {match["joint"] for match in suffixes.values() if WORDS[match["word"]] == POSITION}
    bases, checked = {*header, *positioned}, {}
    for column, name in enumerate(header):
        rate, match = _RATE.fullmatch(name), suffixes.get(column)
        if column == time or name == ROW_NUMBER:
            continue
        if rate and rate["joint"] in bases:
            if name == f"{rate['joint']}_d1":
                checked[rate["joint"]] = column
        elif match and match["joint"] in bases:
            if (level := WORDS[match["word"]]) != OTHER:
                _add(joints, match["joint"], level, column, header)
        else:
            _add(joints, name, POSITION, column, header)
    joints = {name: levels for name, levels in joints.items() if POSITION in levels}
    return Columns(time, joints, checked=checked) if joints else None


def _add(joints: dict[str, dict[int, int]], joint: str, level: int, column: int, header: Sequence[str]) -> None:
    levels = joints.setdefault(joint, {})
    if level in levels:
        message = (
            f"two columns are of the same joint, {header[levels[level]]} and {header[column]}; leave one of them out"
        )
        raise TrajectoryError(message, name=joint)
    levels[level] = column
