"""Samples in CSV files: a table of numbers below a row with the names of its columns."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jounce.errors import JounceError, MechanismFileError, TrajectoryError, UnitError, did_you_mean, no_such
from jounce.io.files.column_units import name_and_unit, unit_unread
from jounce.io.files.long_tables import Numbers, numbers_of
from jounce.io.files.reading import LARGEST_NUMBER, fault_of_number, known_name, read_rows
from jounce.units.dimensions import KINDS, NUMBER, TIME, Dimension, describe_dimension, times
from jounce.units.shown_units import unit_size

SEPARATORS = {";": "semicolons", "\t": "tabs", " ": "spaces"}
"""Separators of entries that other programs use, and their names."""

COMMENT = "# "
"""Beginning of comments before the rows, one of which names the columns in a file of NumPy."""

ROW_NUMBER = "(row)"
"""Name for an unnamed first column of row numbers, as pandas writes it; it is not read."""

UNITLESS = {"", "-"}
"""Entries of a row of units for columns without one."""

_RATE = re.compile(r"_d([0-9]{1,2})$")


def read_samples(
    path: str | Path,
    time: str | None = None,
    value: str | None = None,
    error_type: type[JounceError] = MechanismFileError,
    allowed: tuple[Sequence[Dimension], Sequence[Dimension]] = ((), ()),
) -> tuple[list[float], list[float]]:
    """Read the columns of time and value from a CSV file.

    Parameters
    ----------
    path
        File with a row of column names and rows of numbers, in SI units unless a name states another unit, as in
        ``psi [deg]``. A file without names has two columns, time and value.
    time : str, optional
        Name of the column of time, s; by default ``time``, or else the first column.
    value : str, optional
        Name of the column of values, m or rad; by default the only other column.
    error_type : type
        Type of the exceptions.
    allowed : tuple of sequence of Dimension, optional
        Dimensions that the units of the columns of time and value may have; any dimension if empty.

    Returns
    -------
    times, values : list of float
        One number for each row, s, and m or rad.

    Raises
    ------
    JounceError
        Of the given type, if the file cannot be read, a column does not exist, an entry is not a finite number, or a
        unit is unknown or has another dimension.
    """
    table, first, second = _sampled(path, time, value, error_type)
    return table.column(first, allowed[0]), table.column(second, allowed[1])


def sampled_dimension(
    path: str | Path,
    time: str | None = None,
    value: str | None = None,
    error_type: type[JounceError] = MechanismFileError,
) -> Dimension:
    """Return the dimension of the unit of the value column that `read_samples` reads; that of a number without a unit.

    Raises
    ------
    JounceError
        As for `read_samples`.
    """
    table, _, second = _sampled(path, time, value, error_type)
    return table.unit(second)[1]


def _sampled(
    path: str | Path, time: str | None, value: str | None, error_type: type[JounceError]
) -> tuple[Table, int, int]:
    """Return a table of samples, and the indices of the columns of time and value."""
    table = Table(str(path), error_type)
    if len(table.header) < 2:
        raise table.error("samples need a column of times and one of values", line=1)
    first = table.find(time) if time is not None else table.header.index("time") if "time" in table.header else 0
    if value is None and len(table.header) != 2:
        value_columns = [column for k, column in enumerate(table.header) if k != first]
        message = f"has several columns besides the time, name that of the value; {did_you_mean('', value_columns)}"
        raise table.error(message, line=1)
    return table, first, 1 - first if value is None else table.find(value)


def read_columns(
    path: str | Path, error_type: type[JounceError] = MechanismFileError, derivative: int = 0
) -> tuple[Float[np.ndarray, " time"], dict[str, Float[np.ndarray, " time"]], dict[str, Dimension]]:
    """Read the column ``time``, which increases, and all other columns from a CSV file with a row of names.

    Values are in SI units unless the name of a column states another unit: ``elbow [deg]``, ``elbow_d1 [deg/s]``. They
    are angles and lengths, or their time derivatives of order `derivative`, or of a higher order by the ending of a
    name. The last result holds the dimensions of the columns whose names state units.

    Raises
    ------
    JounceError
        Of the given type, if the file cannot be read, names are missing or repeated, there is no ``time`` or it does
        not increase, or an entry is not a finite number.
    """
    table = Table(str(path), error_type)
    line = check_named(table)
    header = table.header
    time = table.find("time")
    if len(header) < 2:
        raise table.error("there is no column besides 'time'; give one for each joint", line=line)
    columns = {}
    for k, name in enumerate(header):
        rate = _RATE.search(name)
        order = derivative + (int(rate[1]) if rate else 0)
        columns[name] = np.array(table.column(k, (TIME,) if k == time else rates(("angle", "length"), order)))
    times = columns.pop(header[time])
    for k in np.flatnonzero(np.diff(times) <= 0)[:1]:
        relation = "repeats" if times[k + 1] == times[k] else "comes before"
        message = f"times must increase; this one {relation} that of line {table.line(int(k))}"
        raise table.error(message, line=table.line(int(k) + 1), name="time", value=float(times[k + 1]))
    return (
        times,
        columns,
        {name: table.unit(k)[1] for k, name in enumerate(header) if name in columns and table.units[k]},
    )


def read_table(path: str | Path) -> dict[str, Float[np.ndarray, " row"]]:
    """Read the named columns of a CSV file without time: angles and lengths, in SI units or the stated ones.

    Raises
    ------
    TrajectoryError
        If the file cannot be read, names are missing or repeated, or an entry is not a finite number.
    """
    table = Table(str(path), TrajectoryError)
    check_named(table)
    return {
        name: np.array(table.column(k, rates(("angle", "length"), 0)))
        for k, name in enumerate(table.header)
        if name != ROW_NUMBER
    }


def has_column(path: str | Path, names: Iterable[str]) -> bool:
    """Return whether a CSV file has a column with one of some names, or does not name its columns."""
    table = Table(str(path), TrajectoryError)
    return table.header_line is None or any(name in table.header for name in names)


def check_named(table: Table) -> int:
    """Return the line of the column names; raise an error if names are missing or repeated, or a row is incomplete."""
    header, line = table.header, table.header_line
    if line is None:
        message = "the first row holds the names of the columns: time, then the joints"
        raise table.error(message, line=table.rows[0][0], value=", ".join(table.rows[0][1]))
    if len(header) > 3 and [_number(name) is None for name in header[:3]] == [False, False, True]:
        message = (
            "the first row holds the names of the columns, and this one has numbers; 'ros2 topic echo --csv' writes no "
            "names: leave --csv out, and give the YAML"
        )
        raise table.error(message, line=line, value=", ".join(header[:3]))
    earlier: set[str] = set()
    for k, name in enumerate(header):
        if not name:
            raise table.error(f"column {k + 1} has no name", line=line)
        if name in earlier:
            raise table.error("two columns have this name", line=line, value=name)
        earlier.add(name)
    table.check_lengths()
    return line


def rates(bases: Iterable[str], order: int) -> tuple[Dimension, ...]:
    """Return the dimensions of time derivatives of kinds of value, such as angles, lengths or forces."""
    return tuple(times(KINDS[base][1][0], TIME, -order) for base in bases)


def read_points(
    path: str | Path,
) -> tuple[Float[np.ndarray, " point"] | None, Float[np.ndarray, "point component"]]:
    """Read points from a CSV file, and their times if it has a column ``time``.

    The first row names the columns ``x``, ``y`` and, in space, ``z``, or ``NAME_x`` and so on, as in results; other
    columns are ignored. A file without names has columns of coordinates only. Lengths are in m and times in s unless
    the name of a column states another unit: ``x [mm]``.

    Raises
    ------
    MechanismFileError
        If the file cannot be read, columns are missing, or an entry is not a finite number.
    """
    table = Table(str(path), MechanismFileError)
    if table.header_line is None:
        if len(table.header) not in (2, 3):
            message = "points have two or three columns; name them in the first row where there are others"
            raise table.error(message, line=table.rows[0][0], value=len(table.header))
        return None, np.stack([table.column(k) for k in range(len(table.header))], axis=1)
    targets = {}
    for letter in "xyz":
        columns = [k for k, name in enumerate(table.header) if name == letter or name.endswith(f"_{letter}")]
        exact = [k for k in columns if table.header[k] == letter] or columns
        if len(exact) > 1:
            message = f"several columns may be the {letter} of the points; name one of them '{letter}'"
            raise table.error(message, line=table.header_line)
        if exact:
            targets[letter] = table.column(exact[0], rates(("length",), 0))
    if list(targets) not in (["x", "y"], ["x", "y", "z"]):
        message = "points need columns x and y, and in space z"
        raise table.error(message, line=table.header_line, value=", ".join(table.header))
    points = np.stack(list(targets.values()), axis=1)
    times = np.array(table.column(table.header.index("time"), (TIME,))) if "time" in table.header else None
    return times, points


class Table:
    """Rows of a CSV file with their lines, and the names of its columns, which are invented if it has none.

    Long files of numbers only have an array `numbers` instead of rows of text.
    """

    def __init__(self, path: str, error_type: type[JounceError]):
        self.path, self.error_type = path, error_type
        self.rows: list[tuple[int, list[str]]] = []
        self.numbers: Numbers | None = numbers_of(path, error_type)
        if self.numbers is not None:
            self.header_line = self.numbers.header_line
            self._name(self.numbers.names)
            self._name_index()
            return
        self.rows = _without_comments([(line, row) for line, row in read_rows(path, error_type) if any(row)])
        if not self.rows:
            raise self.error("the file of samples is empty")
        self._check_commas()
        self.rows = _without_empty_end(self.rows)
        self.header_line: int | None = None
        self.header = [f"column {k + 1}" for k in range(len(self.rows[0][1]))]
        self.units: list[str | None] = [None] * len(self.header)
        if any(_number(entry) is None for entry in self.rows[0][1]):
            self.header_line, names = self.rows.pop(0)
            self._name(names)
            self._take_row_of_units()
            self._name_index()

    def _name(self, names: Sequence[str]) -> None:
        names = [names[0].lstrip(COMMENT), *names[1:]]
        pairs = [name_and_unit(known_name(name)) for name in names]
        self.header, self.units = [name for name, _ in pairs], [unit for _, unit in pairs]
        self.units_line = self.header_line

    def _take_row_of_units(self) -> None:
        """Take the units of columns from the row below the names, if the names have none and it states at least one."""
        line, row = self.rows[0] if self.rows else (0, [])
        units = [entry.strip("[]() ") for entry in row]
        if {*units} - UNITLESS and len(row) == len(self.header) and not any(self.units) and all(map(_is_unit, units)):
            self.units, self.units_line = [None if unit in UNITLESS else unit for unit in units], line
            del self.rows[0]

    def _name_index(self) -> None:
        """Name an unnamed first column, the index that pandas writes: row numbers, or the times."""
        if len(self.header) < 2 or self.header[0] or not all(self.header[1:]) or not len(self):
            return
        first = [row[0] for _, row in self.rows] if self.numbers is None else self.numbers.values[:, 0].tolist()
        numbers = [_number(str(entry)) for entry in first]
        first_number = numbers[0]
        if first_number in (0.0, 1.0) and all(number == first_number + k for k, number in enumerate(numbers)):
            self.header[0] = ROW_NUMBER
        elif "time" not in self.header:
            self.header[0] = "time"

    def __len__(self) -> int:
        return len(self.rows) if self.numbers is None else len(self.numbers.values)

    def line(self, row: int) -> int:
        """Return the line of a row."""
        return self.rows[row][0] if self.numbers is None else self.numbers.header_line + 1 + row

    def error(self, message: str, **location: object) -> JounceError:
        """Return an error about the file."""
        return self.error_type(message, path=self.path, **location)  # type: ignore[arg-type]

    def _check_commas(self) -> None:
        """Raise an error if other marks than commas separate entries, as from spreadsheets or robot controllers."""
        line, row = self.rows[0]
        counts = [len(other[0].split()) if len(other) == 1 else 0 for _, other in self.rows[:2]]
        for mark, name in SEPARATORS.items():
            if mark == " " and (len(counts) < 2 or counts[0] != counts[1]):
                continue
            parts = [part for entry in row for part in entry.split(mark)]
            if len(parts) > len(row) and (len(row) == 1 or all(_number(part) is not None for part in parts)):
                message = f"entries are separated by commas, here by {name}; write commas, and points in decimals"
                raise self.error(message, line=line)

    def check_lengths(self) -> None:
        """Raise an error unless each row has an entry for each column."""
        for row_line, row in self.rows:
            if len(row) != len(self.header):
                message = (
                    f"each row has one value for each of the {len(self.header)} columns; this one has another number"
                )
                raise self.error(message, line=row_line, value=len(row))

    def find(self, column: str) -> int:
        """Return the index of a column by its name, with its unit or without."""
        column = column if column in self.header else name_and_unit(column)[0]
        if column not in self.header:
            raise self.error(no_such("column", column, self.header), line=self.header_line or 1, value=column)
        return self.header.index(column)

    def unit(self, number: int, allowed: Sequence[Dimension] = ()) -> tuple[float, Dimension]:
        """Return the size, in SI units, and the dimension of the unit of a column; 1 and a number if there is none."""
        unit = self.units[number]
        name = self.header[number]
        if unit is None:
            if unit_text := unit_unread(name, allowed):
                hint = f"units are read in brackets: write NAME [{unit_text}], or another"
                message = f"this name seems to say {unit_text}; {hint}"
                raise self.error(message, line=self.header_line, value=name)
            return 1.0, NUMBER
        location = {"line": self.units_line, "name": name, "value": unit}
        try:
            size, dimension = unit_size(unit)
        except UnitError as error:
            raise self.error(error.message, **location) from None
        if allowed and dimension not in allowed:
            units = " or ".join(map(describe_dimension, allowed))
            raise self.error(f"the unit measures {describe_dimension(dimension)}, not {units}", **location)
        return size, dimension

    def column(self, number: int, allowed: Sequence[Dimension] = ()) -> list[float]:
        """Return the numbers of a column, in SI units."""
        size, _ = self.unit(number, allowed)
        if self.numbers is not None:
            column = self.numbers.values[:, number] + float(self.numbers.offsets.get(number, 0))
            invalid = np.flatnonzero(~(np.abs(column) <= LARGEST_NUMBER))
            if len(invalid):
                value = float(column[invalid[0]])
                raise self.error(
                    fault_of_number(value), line=self.line(int(invalid[0])), name=self.header[number], value=value
                )
            return (column * size).tolist()
        values = []
        for line, row in self.rows:
            text = row[number] if number < len(row) else ""
            entry = _number(text)
            entry = math.nan if entry is None else entry
            if fault := fault_of_number(entry):
                raise self.error(fault, line=line, name=self.header[number], value=text)
            values.append(entry * size)
        return values


def _without_comments(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Return rows without the leading comments; the last comment is kept if it names the columns."""
    first = next((k for k, (_, row) in enumerate(rows) if not row[0].startswith(COMMENT[0])), len(rows))
    numbers = rows[first][1] if first < len(rows) else []
    has_header = first > 0 and len(rows[first - 1][1]) == len(numbers) and all(_number(x) is not None for x in numbers)
    return rows[first - has_header :]


def _without_empty_end(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Return rows without their last entry where that is empty in all, as where each row ends with a comma."""
    if any(len(row) < 2 or len(row) != len(rows[0][1]) or row[-1] for _, row in rows):
        return rows
    return [(line, row[:-1]) for line, row in rows]


def _is_unit(text: str) -> bool:
    """Return whether an entry of a row of units states a unit, or that there is none."""
    if text in UNITLESS:
        return True
    try:
        return _number(text) is None and bool(unit_size(text))
    except UnitError:
        return False


def _number(text: str) -> float | None:
    """Return the number that a text denotes; None if none, also for 1_5, which only Python reads as 15."""
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None
