"""Motion laws from samples in a CSV file."""

from __future__ import annotations

import math
from pathlib import Path

from jounce.errors import MechanismFileError, check_name, did_you_mean
from jounce.io.files.reading import fault_of_number, read_rows

__all__ = ["read_columns", "read_samples"]


def read_samples(
    path: str | Path, time: str | None = None, value: str | None = None
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

    Returns
    -------
    times, values : list of float
        One for each row, s, and m or rad.

    Raises
    ------
    MechanismFileError
        The file cannot be read, a column does not exist, or an entry is not a finite number.
    """
    name = str(path)
    header, rows = _table(name)
    columns = _columns(name, header, time, value)
    samples = [[_number(name, line, header, row, column) for line, row in rows] for column in columns]
    return samples[0], samples[1]


def read_columns(path: str | Path) -> tuple[list[float], dict[str, list[float]]]:
    """Read the column ``time`` and all others from a CSV file, whose first row names them.

    Raises
    ------
    MechanismFileError
        The file cannot be read, names repeat or there is no ``time``, or an entry is not a finite number.
    """
    name = str(path)
    header, rows = _table(name)
    for k, column in enumerate(header):
        if column in header[:k] or not column:
            raise MechanismFileError("each column needs a name of its own", path=name, line=1, value=column)
    time = _find(name, header, "time")
    found = {column: [_number(name, line, header, row, k) for line, row in rows] for k, column in enumerate(header)}
    if len(found) < 2:
        raise MechanismFileError("there is no column besides 'time'", path=name, line=1)
    return found.pop(header[time]), found


def _table(path: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the names of the columns, made up where there are none, and the rows with their lines."""
    rows = [(line, row) for line, row in read_rows(path, MechanismFileError) if row]
    if not rows:
        raise MechanismFileError("the file of samples is empty", path=path)
    header = [f"column {k + 1}" for k in range(len(rows[0][1]))]
    if not all(map(_is_number, rows[0][1])):
        header = rows.pop(0)[1]
    return header, rows


def _columns(path: str, header: list[str], time: str | None, value: str | None) -> tuple[int, int]:
    """Find the columns of time and value."""
    if len(header) < 2:
        raise MechanismFileError("samples need a column of times and one of values", path=path, line=1)
    if time is None:
        first = header.index("time") if "time" in header else 0
    else:
        first = _find(path, header, time)
    if value is not None:
        return first, _find(path, header, value)
    if len(header) != 2:
        others = [column for column in header if column != header[first]]
        message = f"has several columns besides the time, name that of the value; {did_you_mean('', others)}"
        raise MechanismFileError(message, path=path, line=1)
    return first, 1 - first


def _find(path: str, header: list[str], column: str) -> int:
    check_name("column", column, header, MechanismFileError, path=path, line=1)
    return header.index(column)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(path: str, line: int, header: list[str], row: list[str], column: int) -> float:
    text = row[column] if column < len(row) else ""
    number = float(text) if _is_number(text) else math.nan
    fault = fault_of_number(number)
    if fault:
        raise MechanismFileError(fault, path=path, line=line, name=header[column], value=text)
    return number
