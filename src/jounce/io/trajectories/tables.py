"""Tables of recordings: CSV files of results, PlotJuggler, rostopic, libfranka, and of columns named after joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from jaxtyping import Float

from jounce.errors import RecordingWarning, TrajectoryError, warn_caller
from jounce.io.files.reading import fault_of_number
from jounce.io.files.samples import Table, check_named, rates
from jounce.io.trajectories.agreement import check_agreement
from jounce.io.trajectories.controller_formats import ControllerFormat, format_of, joint_count
from jounce.io.trajectories.recordings import Recording
from jounce.io.trajectories.stamps import NANO, epoch, in_sequence, relative
from jounce.io.trajectories.table_columns import (
    NUMBERED,
    POSITION,
    Columns,
    columns_of,
    join_stamps,
    other_quantity,
    take_units,
)
from jounce.units.dimensions import TIME, Dimension

NOTHING = ("", "nan", "NaN", "NAN")
"""Entries of a table for missing values of a series."""


def read_recording(path: str, joints: Iterable[str] | None = None) -> Recording:
    """Return the recording in a CSV file.

    Parameters
    ----------
    path : str
        Path of the file.
    joints : iterable of str, optional
        Names of the joints of a table without names, in its order.

    Raises
    ------
    TrajectoryError
        If the file cannot be read or contains an error: the message names the line, the column and the value.
    """
    table = Table(path, TrajectoryError)
    line = check_named(table)
    join_stamps(table)
    take_units(table)
    controller = format_of(table.header)
    try:
        columns = _of_controller(table, controller) if controller else columns_of(table.header)
    except TrajectoryError as error:
        raise error.located(path=path, line=line) from None
    if columns is None:
        table.find("time")  # raises an error if there is none
        raise table.error("there is no column besides 'time'; give one for each joint", line=line)
    recording = in_sequence(_recording(table, columns, points=controller is not None))
    measured_names = [name for word in NUMBERED[POSITION] if (name := f"{word}_0") in table.header]
    if controller and measured_names:
        message = f"{path}, line {line}: measured positions are left out ({measured_names[0]} and the like)"
        advice = f"to have them read, leave out the commanded ones, {controller.levels[0]}_0 and the like"
        warn_caller(RecordingWarning(f"{message}; {advice}"))
    if joints is not None:
        if not recording.unnamed:
            message = "this file names its joints; give names for what controllers take only"
            raise TrajectoryError(message, path=path, name="joints")
        recording = recording.renamed(tuple(joints))
    return recording


def _of_controller(table: Table, controller: ControllerFormat) -> Columns:
    """Return the columns of a table for a controller; only commanded values are read."""
    levels = [level for level in controller.levels if f"{level}_0" in table.header]
    joints = {
        f"joint_{j}": {k: table.find(f"{level}_{j}") for k, level in enumerate(levels)}
        for j in range(joint_count(controller, table.header))
    }
    return Columns(table.find(controller.time), joints, unnamed=True)


def _recording(table: Table, columns: Columns, *, points: bool) -> Recording:
    if len(table) == 0:
        raise TrajectoryError("at least two samples are needed", path=table.path, value=0)
    levels = 1 + max(max(own) for own in columns.joints.values())
    names = _names(table, columns)
    values = np.full((len(table), levels, len(names)), np.nan)
    dimensions: list[Dimension] = []
    missing: list[str] = []
    for k, (joint, own) in enumerate(columns.joints.items()):
        for level, column in own.items():
            values[:, level, k] = _numbers(table, column, level, empty=not points)
        if np.isnan(values[:, POSITION, k]).all():
            raise table.error("this column has no position; leave it out", line=table.header_line, name=joint)
        dimensions.append(table.unit(own[0])[1])
        if column := columns.checked.get(joint):
            _check_rate(table, columns, joint, values[:, :1, k], _numbers(table, column, 1, empty=False))
    times, note = _times(table, columns)
    has_values = ~np.isnan(values[:, 0]).all(axis=1)
    empty_count = int((~has_values).sum())
    notes = [note] if note else []
    for name, own in zip(names, columns.joints.values(), strict=True):
        if not _is_series(table.header[own[POSITION]]):
            absent = np.flatnonzero(np.isnan(values[:, POSITION, names.index(name)]) & has_values)
            if len(absent):
                missing.append(f"{len(absent)} of {name} (the first in line {table.line(int(absent[0]))})")
    if missing:
        notes.append(f"positions are missing, and left to the splines: {', '.join(missing)}")
    if empty_count:
        notes.append(f"{empty_count} rows without a position are left out")
    if not has_values.any():
        raise table.error("no row has a position", line=table.header_line)
    lines = np.array([table.line(k) for k in range(len(table))])[has_values]
    unknown = np.isnan(values[has_values]).all(axis=(0, 2))
    count = int(np.argmax(np.append(unknown, True)))
    return Recording(
        table.path,
        names,
        times[has_values],
        values[has_values][:, :count],
        lines,
        points=points,
        notes=tuple(notes),
        measures={name: measure for name, own in zip(names, dimensions, strict=True) if (measure := measured(own))},
        unnamed=columns.unnamed,
        others=frozenset(n for n, x in zip(names, columns.joints.values(), strict=True) if _is_other(table, x)),
    )


def _is_other(table: Table, levels: Mapping[int, int]) -> bool:
    return other_quantity(table.header[levels[POSITION]]) is not None


def measured(dimension: Dimension | None) -> str | None:
    """Return angle or length, as the kind of coordinate whose value or rate has a dimension; None if unknown."""
    return next((base for base, _ in dimension or () if base in ("angle", "length")), None)


def _is_series(name: str) -> bool:
    return name.startswith("/")


def _names(table: Table, columns: Columns) -> tuple[str, ...]:
    """Return the names of the joints; names in the text of a table must be the same in all rows."""
    names = []
    for joint in columns.joints:
        if (column := columns.names.get(joint)) is None:
            names.append(joint)
            continue
        texts = [row[column] for _, row in table.rows]
        for k, text in enumerate(texts):
            if text != texts[0] or not text:
                message = "the name of a joint changes from row to row; sort the columns first"
                raise table.error(message, line=table.line(k), name=table.header[column], value=text)
        names.append(texts[0])
    if len(set(names)) < len(names):
        duplicate = next(name for k, name in enumerate(names) if name in names[:k])
        raise table.error("a joint is named twice", line=table.line(0), value=duplicate)
    return tuple(names)


def _numbers(table: Table, column: int, level: int, *, empty: bool) -> Float[np.ndarray, " row"]:
    """Return the numbers of a column; with `empty`, missing entries become NaN."""
    allowed = rates(("angle", "length"), level)
    if table.numbers is not None or not empty:
        return np.array(table.column(column, allowed))
    size, _ = table.unit(column, allowed)
    values = np.full(len(table), np.nan)
    for k, (line, row) in enumerate(table.rows):
        if row[column] in NOTHING:
            continue
        try:
            values[k] = float(row[column]) * size if "_" not in row[column] else np.nan
        except ValueError:
            values[k] = np.nan
        if fault := fault_of_number(values[k]):
            raise table.error(fault, line=line, name=table.header[column], value=row[column])
    return values


def _times(table: Table, columns: Columns) -> tuple[Float[np.ndarray, " row"], str]:
    """Return the times, s, relative to the first if they count from an epoch, and a description of that."""
    name, unit = table.header[columns.time], table.units[columns.time]
    size = table.unit(columns.time, (TIME,))[0]
    if table.numbers is not None:
        values, origin = np.array(table.column(columns.time)), table.numbers.offsets.get(columns.time)
        epoch_unit = None if origin is None else epoch(origin, _units(columns, values), unit)
        if epoch_unit is None:
            return (values / _units(columns, values) if unit is None else values), ""
        digits, note = epoch_unit
        return table.numbers.values[:, columns.time] / 10**digits, note

    def fail(message: str, row: int) -> TrajectoryError:
        return table.error(message, line=table.line(row), name=name, value=table.rows[row][1][columns.time])  # type: ignore[return-value]

    values, note = relative([row[columns.time] for _, row in table.rows], fail, columns.per_second, unit)
    if note:
        return values, note
    return values / _units(columns, values) if unit is None else values * size, ""


def _units(columns: Columns, stamps: Float[np.ndarray, " row"]) -> int:
    """Return the units of the stamps in a second; stamps in ns that are not whole were converted to seconds."""
    return 1 if columns.per_second == NANO and (stamps != np.rint(stamps)).any() else columns.per_second


def _check_rate(
    table: Table, columns: Columns, joint: str, positions: Float[np.ndarray, "row 1"], rate: Float[np.ndarray, " row"]
) -> None:
    """Raise an error if velocities, which are not read otherwise, disagree with the positions."""
    times = np.array(table.column(columns.time))
    if (np.diff(times) <= 0).any() or not np.isfinite(positions).all():
        return
    lines = [table.line(k) for k in range(len(table))]
    values = np.stack([positions, rate[:, None]], axis=1)
    check_agreement(Recording(table.path, (joint,), times, values, lines))
