"""Samples in CSV files: a table of numbers below a row with the names of its columns."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jounce.errors import JounceError, MechanismFileError, did_you_mean, no_such
from jounce.io.files.reading import fault_of_number, known_name, read_rows


def read_samples(
    path: str | Path,
    time: str | None = None,
    value: str | None = None,
    error_type: type[JounceError] = MechanismFileError,
) -> tuple[list[float], list[float]]:
    """Read the columns of time and value from a CSV file.

    Parameters
    ----------
    path
        The file: numbers in SI units, below a row with the names of the columns. Without that row the file has two
        columns, time and value.
    time : str, optional
        Name of the column of time, s; when not given, ``time``, or else the first column.
    value : str, optional
        Name of the column of the driven quantity, m or rad; the only other column when not given.
    error_type : type
        Of the exceptions.

    Returns
    -------
    times, values : list of float
        One for each row, s, and m or rad.

    Raises
    ------
    JounceError
        Of the type given: the file cannot be read, a column does not exist, or an entry is not a finite number.
    """
    table = _Table(str(path), error_type)
    if len(table.header) < 2:
        raise table.error("samples need a column of times and one of values", line=1)
    first = table.find(time) if time is not None else table.header.index("time") if "time" in table.header else 0
    if value is None and len(table.header) != 2:
        others = [column for k, column in enumerate(table.header) if k != first]
        message = f"has several columns besides the time, name that of the value; {did_you_mean('', others)}"
        raise table.error(message, line=1)
    return table.column(first), table.column(1 - first if value is None else table.find(value))


def read_columns(
    path: str | Path, error_type: type[JounceError] = MechanismFileError
) -> tuple[Float[np.ndarray, " time"], dict[str, Float[np.ndarray, " time"]]]:
    """Read the column ``time``, which increases, and all others from a CSV file, whose first row names them.

    Raises
    ------
    JounceError
        Of the type given: the file cannot be read, names are missing or repeat, there is no ``time`` or it does not
        increase, or an entry is not a finite number.
    """
    table = _Table(str(path), error_type)
    header, line = table.header, table.header_line
    if line is None:
        message = "the first row holds the names of the columns: time, then the joints"
        raise table.error(message, line=table.rows[0][0], value=", ".join(table.rows[0][1]))
    for k, name in enumerate(header):
        if not name:
            raise table.error(f"column {k + 1} has no name", line=line)
        if name in header[:k]:
            raise table.error("two columns have this name", line=line, value=name)
    time = table.find("time")
    if len(header) < 2:
        raise table.error("there is no column besides 'time'; give one for each joint", line=line)
    for row_line, row in table.rows:
        if len(row) != len(header):
            message = f"each row has one value for each of the {len(header)} columns; this one has another number"
            raise table.error(message, line=row_line, value=len(row))
    found = {name: np.array(table.column(k)) for k, name in enumerate(header)}
    times = found.pop(header[time])
    for k in np.flatnonzero(np.diff(times) <= 0)[:1]:
        what = "repeats" if times[k + 1] == times[k] else "comes before"
        message = f"times must increase; this one {what} that of line {table.rows[k][0]}"
        raise table.error(message, line=table.rows[k + 1][0], name="time", value=float(times[k + 1]))
    return times, found


def read_points(
    path: str | Path, error_type: type[JounceError] = MechanismFileError
) -> tuple[Float[np.ndarray, " point"] | None, Float[np.ndarray, "point component"]]:
    """Read points from a CSV file, and their times where it has a column ``time``.

    The first row names the columns ``x``, ``y`` and, in space, ``z``, or ``NAME_x`` ..., as results have them; others
    are not read. Without that row the file has the columns of coordinates only. Lengths are in m, times in s.

    Raises
    ------
    JounceError
        Of the type given: the file cannot be read, columns are missing, or an entry is not a finite number.
    """
    table = _Table(str(path), error_type)
    if table.header_line is None:
        if len(table.header) not in (2, 3):
            message = "points have two or three columns; name them in the first row where there are others"
            raise table.error(message, line=table.rows[0][0], value=len(table.header))
        return None, np.stack([table.column(k) for k in range(len(table.header))], axis=1)
    found = {}
    for letter in "xyz":
        named = [k for k, name in enumerate(table.header) if name == letter or name.endswith(f"_{letter}")]
        exact = [k for k in named if table.header[k] == letter] or named
        if len(exact) > 1:
            message = f"several columns may be the {letter} of the points; name one of them '{letter}'"
            raise table.error(message, line=table.header_line)
        if exact:
            found[letter] = table.column(exact[0])
    if list(found) not in (["x", "y"], ["x", "y", "z"]):
        message = "points need columns x and y, and in space z"
        raise table.error(message, line=table.header_line, value=", ".join(table.header))
    points = np.stack(list(found.values()), axis=1)
    return (np.array(table.column(table.header.index("time"))) if "time" in table.header else None), points


class _Table:
    """Rows of a CSV file with their lines, and the names of its columns, made up where it has none."""

    def __init__(self, path: str, error_type: type[JounceError]):
        self.path, self.error_type = path, error_type
        self.rows = [(line, row) for line, row in read_rows(path, error_type) if any(row)]
        if not self.rows:
            raise self.error("the file of samples is empty")
        self.header_line: int | None = None
        self.header = [f"column {k + 1}" for k in range(len(self.rows[0][1]))]
        if any(_number(entry) is None for entry in self.rows[0][1]):
            self.header_line, names = self.rows.pop(0)
            self.header = [known_name(name) for name in names]

    def error(self, message: str, **place: object) -> JounceError:
        return self.error_type(message, path=self.path, **place)  # type: ignore[arg-type]

    def find(self, column: str) -> int:
        """Return the number of a column by its name."""
        if column not in self.header:
            raise self.error(no_such("column", column, self.header), line=self.header_line or 1, value=column)
        return self.header.index(column)

    def column(self, number: int) -> list[float]:
        """Return the numbers of a column."""
        found = []
        for line, row in self.rows:
            text = row[number] if number < len(row) else ""
            entry = _number(text)
            if fault := fault_of_number(math.nan if entry is None else entry):
                raise self.error(fault, line=line, name=self.header[number], value=text)
            found.append(entry)
        return found


def _number(text: str) -> float | None:
    """Return the number that a text is."""
    try:
        return float(text)
    except ValueError:
        return None
