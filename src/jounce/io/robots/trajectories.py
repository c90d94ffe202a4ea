"""Trajectories of robots from files: samples in CSV, laws and point-to-point motions in YAML, TOML or JSON."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from jounce.errors import JounceError, MechanismFileError, TrajectoryError, did_you_mean, no_such, show_value
from jounce.io.files.entries import Location, Source, dotted
from jounce.io.files.reading import fault_of_number, known_name, read_rows
from jounce.io.files.samples import read_columns, read_samples
from jounce.io.files.source import SUFFIXES, read_source
from jounce.trajectory import Expression, ExpressionMotion, JointTrajectory, MeasuredMotion, SplineMotion

__all__ = ["load_trajectory"]

_DERIVATIVE = re.compile(r"(.+)_d[0-9]+")


def load_trajectory(
    path: str | PathLike[str], degree: int = 5, allow: Iterable[str | PathLike[str]] = ()
) -> JointTrajectory:
    """Read the trajectory of a robot from a CSV file of samples, or from a file of laws.

    A CSV file has a row of names, ``time, JOINT, JOINT, ...``, and below it numbers in s, m and rad; splines go through
    them. The columns ``JOINT_d1, JOINT_d2, ...`` of derivatives, which files of results have, are not read.

    A YAML, TOML or JSON file has either ``joints``, a law for each joint, or ``point_to_point`` with the keys
    ``profile``, ``duration``, ``start_time``, ``from``, ``to`` and ``limits``. Laws are expressions of ``t`` and
    of ``parameters``; ``time`` has the keys ``start``, ``stop`` and ``step`` or ``count``, and may be left out for
    ``point_to_point``. A law may also go through samples, ``{samples: FILE.csv, value: COLUMN}``, of the coordinate or,
    with ``derivative: 2``, of its acceleration; ``initial`` holds the coordinate and the velocity at the first sample.
    In the place of ``joints``, ``motion: {samples: FILE.csv, derivative: 2}`` gives each column to the joint of its
    name, ``initial`` then being a list for each joint, and ``time`` may be left out.

    Parameters
    ----------
    path
        A file ending in .csv, .yaml, .yml, .toml or .json.
    degree : int, default 5
        Degree of the splines through samples, odd from 3 to 11.
    allow
        Folders besides its own that files named in it may be below.

    Returns
    -------
    JointTrajectory
        Its `times` are those of the samples, or the instants of ``time``.

    Raises
    ------
    TrajectoryError
        The file cannot be read or something in it is wrong: the message names the file, the line, the column or entry,
        and the value.

    Examples
    --------
    >>> import jounce as jn
    >>> trajectory = jn.load_trajectory("examples/trajectories/panda_good.csv")
    >>> trajectory.names[:2], trajectory.stop
    (('panda_joint1', 'panda_joint2'), 4.0)
    """
    name = str(fspath(path))
    suffix = Path(name).suffix.lower()
    if suffix not in (".csv", *SUFFIXES):
        message = "the kind of a trajectory file is told by its ending"
        raise TrajectoryError(f"{message}; valid: {', '.join(('.csv', *SUFFIXES))}", path=name)
    if suffix == ".csv":
        return _read_csv(name, degree)
    try:
        source = read_source(name, allow)
    except MechanismFileError as error:
        message = error.message.replace("mechanism file", "trajectory file")
        raise TrajectoryError(message, path=error.path, line=error.line, name=error.name, value=error.value) from None
    return _Laws(source).trajectory()


def _read_csv(path: str, degree: int) -> JointTrajectory:
    rows = _rows(path)
    header_line, header = rows[0][0], [known_name(entry) for entry in rows[0][1]]
    columns = _columns(path, header_line, header)
    body = rows[1:]
    for line, row in body:
        if len(row) != len(header):
            message = f"each row has one value for each of the {len(header)} columns; this one has another number"
            raise TrajectoryError(message, path=path, line=line, value=len(row))
    table = np.array([[_number(path, line, header[k], row[k]) for k in columns] for line, row in body])
    table = table.reshape(-1, len(columns))
    increase = np.diff(table[:, 0])
    if (increase <= 0).any():
        first = int(np.flatnonzero(increase <= 0)[0])
        what = "repeats" if increase[first] == 0 else "comes before"
        message = f"times must increase; this one {what} that of line {body[first][0]}"
        raise TrajectoryError(
            message, path=path, line=body[first + 1][0], name="time", value=table[first + 1, 0].item()
        )
    names = [header[k] for k in columns[1:]]
    try:
        return JointTrajectory.from_samples(table[:, 0], table[:, 1:], names, degree)
    except TrajectoryError as error:
        raise error.located(path=path) from None


def _rows(path: str) -> list[tuple[int, list[str]]]:
    """Return the rows that are not blank, with their lines; the first one holds names."""
    rows = [(line, row) for line, row in read_rows(path, TrajectoryError) if any(row)]
    if not rows:
        raise TrajectoryError("the file of samples is empty", path=path)
    return rows


def _columns(path: str, line: int, header: list[str]) -> list[int]:
    """Return the indices of the columns of time and of the joints, without those of derivatives."""
    if all(_is_number(entry) for entry in header):
        message = "the first row holds the names of the columns: time, then the joints"
        raise TrajectoryError(message, path=path, line=line, value=", ".join(header))
    for k, name in enumerate(header):
        if not name:
            raise TrajectoryError(f"column {k + 1} has no name", path=path, line=line)
        if name in header[:k]:
            raise TrajectoryError("two columns have this name", path=path, line=line, value=name)
    if "time" not in header:
        message = f"there is no column 'time'; {did_you_mean('time', header)}"
        raise TrajectoryError(message, path=path, line=line)
    joints = []
    for k, name in enumerate(header):
        derivative = _DERIVATIVE.fullmatch(name)
        if name != "time" and not (derivative and derivative[1] in header):
            joints.append(k)
    if not joints:
        raise TrajectoryError("there is no column besides 'time'; give one for each joint", path=path, line=line)
    return [header.index("time"), *joints]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(path: str, line: int, column: str, text: str) -> float:
    number = float(text) if _is_number(text) else math.nan
    fault = fault_of_number(number)
    if fault:
        raise TrajectoryError(fault, path=path, line=line, name=column, value=text)
    return number


_KEYS = ("title", "parameters", "joints", "point_to_point", "motion", "time")
_KINDS = ("joints", "point_to_point", "motion")
_SAMPLE_KEYS = ("samples", "degree", "derivative", "initial", "time", "value")
_ORDERS = (("degree", 5), ("derivative", 0))
_MOTION_KEYS = ("profile", "duration", "start_time", "from", "to", "limits")


class _Laws:
    """Reads laws from the plain data of a file; every error names the file, the line and the entry."""

    def __init__(self, source: Source) -> None:
        self.source = source
        data = self._mapping((), _KEYS, source.data)
        if sum(kind in data for kind in _KINDS) != 1:
            message = "a trajectory file has either 'joints', 'point_to_point' or 'motion'"
            raise self.error(message, value=list(data))
        self.data = data
        self.parameters: dict[str, float] = {}
        self.dimensions: dict[str, Any] = {}
        self._read_parameters()

    def trajectory(self) -> JointTrajectory:
        """Return the trajectory of the file."""
        if "point_to_point" in self.data:
            return self._point_to_point()
        if "motion" in self.data:
            return self._sampled_motion()
        laws = {}
        for name, raw in self._mapping(("joints",)).items():
            at = ("joints", name)
            if isinstance(raw, dict):
                laws[name] = self._sampled_law(at)
                continue
            value = self._value(raw, "any", ("t",), at)
            laws[name] = ExpressionMotion(value, self.parameters) if isinstance(value, Expression) else value
        times = self._times()
        return self._guard(("time",), lambda: JointTrajectory(laws, times[0], times[-1], times))

    def _sampled_law(self, at: Location) -> SplineMotion:
        """Return a law through the samples of a column of a file."""
        data = self._mapping(at, _SAMPLE_KEYS)
        path = self._samples_file(at, data)
        columns = {key: self._text(data[key], (*at, key)) for key in ("time", "value") if key in data}
        times, values = self._of_file(at, data["samples"], path, lambda: read_samples(path, **columns))
        initial = data.get("initial", [])
        return self._spline(at, data, times, values, initial, (*at, "initial"))

    def _sampled_motion(self) -> JointTrajectory:
        """Return the trajectory whose joints are the columns of a file of samples."""
        at: Location = ("motion",)
        data = self._mapping(at, [key for key in _SAMPLE_KEYS if key not in ("time", "value")])
        path = self._samples_file(at, data)
        times, columns = self._of_file(at, data["samples"], path, lambda: read_columns(path))
        initial = self._mapping((*at, "initial")) if "initial" in data else {}
        for name in initial:
            if name not in columns:
                raise self.error(no_such("column", name, columns), (*at, "initial", name))
        laws = {
            name: self._spline(at, data, times, values, initial.get(name, []), (*at, "initial", name))
            for name, values in columns.items()
        }
        grid = self._times() if "time" in self.data else times
        return self._guard(("time",), lambda: JointTrajectory(laws, grid[0], grid[-1], grid))

    def _samples_file(self, at: Location, data: Mapping[str, Any]) -> str:
        if "samples" not in data:
            raise self.error("is missing; give the name of a CSV file", (*at, "samples"))
        name = self._text(data["samples"], (*at, "samples"))
        try:
            return self.source.named_file(name, (*at, "samples"))
        except MechanismFileError as error:
            raise self.error(error.message, (*at, "samples"), value=error.value) from None

    def _of_file(self, at: Location, name: str, path: str, read: Callable[[], Any]) -> Any:
        """Return what is read from a file; its path is then told as the user knows it."""
        try:
            return read()
        except JounceError as error:
            if error.path == path:
                error.path = Path(self.source.path).parent / name
            raise self.error(str(error), (*at, "samples")) from None

    def _spline(
        self, at: Location, data: Mapping[str, Any], times: Any, values: Any, initial: Any, place: Location
    ) -> SplineMotion:
        """Return the spline through samples of a coordinate, or the integral of one through those of a derivative."""
        degree, derivative = (self._whole(data.get(key, usual), (*at, key)) for key, usual in _ORDERS)
        if not isinstance(initial, list):
            raise self.error("must be a list: the coordinate, its velocity and so on", place, value=initial)
        if len(initial) > derivative:
            message = (
                f"must have at most {derivative} values: the coordinate and its derivatives below the measured one"
            )
            raise self.error(message, place, value=initial)
        known = [self._number(raw, "any", (*place, k), k) for k, raw in enumerate(initial)]
        if derivative:
            return self._guard(at, lambda: MeasuredMotion(times, values, derivative, known, degree))
        return self._guard(at, lambda: SplineMotion(times, values, degree))

    def _whole(self, raw: Any, at: Location) -> int:
        if isinstance(raw, bool) or not isinstance(raw, int) or raw < 0:
            raise self.error("must be a whole number, 0 or greater", at, value=raw)
        return raw

    def _text(self, raw: Any, at: Location) -> str:
        if not isinstance(raw, str):
            raise self.error("must be a name", at, value=raw)
        return raw

    def _point_to_point(self) -> JointTrajectory:
        at = ("point_to_point",)
        data = self._mapping(at, _MOTION_KEYS)
        for key in ("from", "to"):
            if key not in data:
                raise self.error("is missing", (*at, key))
        first, last = (self._mapping((*at, key)) for key in ("from", "to"))
        for here, there, key in ((first, last, "to"), (last, first, "from")):
            for name in here:
                if name not in there:
                    message = f"the joint {show_value(name)} is missing; 'from' and 'to' name the same joints"
                    raise self.error(message, (*at, key))
        start = [self._number(first[name], "any", (*at, "from", name)) for name in first]
        end = [self._number(last[name], "any", (*at, "to", name)) for name in first]
        times = {key: self._number(data[key], "time", (*at, key)) for key in ("duration", "start_time") if key in data}
        profile = data.get("profile", "minimum_jerk")
        if not isinstance(profile, str):
            raise self.error("must be the name of a profile", (*at, "profile"), value=profile)
        limits = self._limits((*at, "limits")) if "limits" in data else None
        motion = self._guard(
            at, lambda: JointTrajectory.point_to_point(list(first), start, end, profile, limits=limits, **times)
        )
        if "time" not in self.data:
            return motion
        grid = self._times()
        return self._guard(("time",), lambda: JointTrajectory(motion.laws, grid[0], grid[-1], grid))

    def _limits(self, at: Location) -> list[float]:
        keys = ("velocity", "acceleration", "jerk")
        data = self._mapping(at, keys)
        for key in keys:
            if key not in data:
                raise self.error("is missing", (*at, key))
        return [self._number(data[key], "any", (*at, key), power) for power, key in enumerate(keys, start=1)]

    def _times(self) -> np.ndarray:
        """Return the instants of the time grid."""
        from jounce.mechanism import TimeGrid, time_grid

        if "time" not in self.data:
            raise self.error("is missing; give start, stop and step", ("time",))
        data = self._mapping(("time",), ("start", "stop", "step", "count"))
        if "stop" not in data:
            raise self.error("is missing", ("time", "stop"))
        kinds = {"count": "ratio"}
        values = {key: self._number(raw, kinds.get(key, "time"), ("time", key)) for key, raw in data.items()}
        times = self._guard(("time",), lambda: time_grid(TimeGrid(**{"start": 0.0, **values}), {}))
        if len(times) < 2:
            raise self.error(
                "a trajectory needs at least two instants; choose a later stop or a smaller step", ("time",)
            )
        return times

    def _read_parameters(self) -> None:
        from jounce.trajectory.expression import RESERVED

        if "parameters" not in self.data:
            return
        for name, raw in self._mapping(("parameters",)).items():
            at = ("parameters", name)
            if not re.fullmatch(r"[A-Za-z_][A-Za-z_0-9]{0,99}", name):
                raise self.error("a name of a parameter is letters, digits and _", at)
            if name in RESERVED:
                raise self.error(f"the name '{name}' is reserved for expressions", at)
            value = self._read(raw, "any", (), at)
            if value.dimension is not None:
                self.dimensions[name] = value.dimension
            self.parameters[name] = self._finite(value.value, raw, at)  # an expression may use those above

    def _number(self, raw: Any, kind: str, at: Location, per_time: int = 0) -> float:
        """Return a number in SI units; "any" is a coordinate, per s to the power of `per_time`."""
        return self._finite(self._value(raw, kind, (), at, per_time), raw, at)

    def _finite(self, value: Any, raw: Any, at: Location) -> float:
        number = self._guard(at, lambda: value.evaluate(self.parameters)) if isinstance(value, Expression) else value
        fault = fault_of_number(number)
        if fault:
            raise self.error(fault, at, value=raw)
        return float(number)

    def _value(self, raw: Any, kind: str, names: Iterable[str], at: Location, per_time: int = 0) -> Any:
        """Return a number in SI units, or an expression of the parameters and of other names."""
        from jounce.io.files.units import describe_dimension

        value = self._read(raw, kind, names, at)
        if kind == "any" and value.dimension:
            rate = (("time", -per_time),) if per_time else ()
            if value.dimension not in [tuple(sorted(((base, 1), *rate))) for base in ("angle", "length")]:
                what = "an angle or a length" + (f" per s^{per_time}" if per_time > 1 else " per s" if per_time else "")
                raise self.error(f"must be {what}, not {describe_dimension(value.dimension)}", at, value=raw)
        return value.value

    def _read(self, raw: Any, kind: str, names: Iterable[str], at: Location) -> Any:
        """Return a value with its dimension."""
        from jounce.io.files.units import parse_value

        try:
            return parse_value(raw, kind, (*self.parameters, *names), self.dimensions)
        except JounceError as error:
            quoted = getattr(error, "column", None) is not None  # the text is in the message
            raise self.error(error.message, at, **({} if quoted else {"value": raw})) from None

    def _mapping(self, at: Location, keys: Iterable[str] | None = None, data: Any = None) -> Mapping[str, Any]:
        """Return the mapping at a place, which is not empty and has known keys only."""
        found = data
        if data is None and at:
            found = self.source.data
            for step in at:
                found = found[step]
        if not isinstance(found, dict) or not found:
            raise self.error("must be a mapping with at least one entry", at, value=found)
        for key in found:
            if keys is not None and key not in keys:
                raise self.error(f"unknown key; {did_you_mean(key, keys)}", (*at, key))
        return found

    def _guard(self, at: Location, make: Callable[[], Any]) -> Any:
        """Return what is made; an error from within gets the place in the file."""
        try:
            return make()
        except JounceError as error:
            name = error.name or ""
            last = name.rpartition(".")[2]
            inner = (*at, last) if last in self._keys_at(at) else at
            message = (
                error.message if inner != at or not name or name.split(".")[0] in at else f"{name}: {error.message}"
            )
            raise self.error(message, inner, value=error.value) from None

    def _keys_at(self, at: Location) -> Iterable[str]:
        found = self.source.data
        for step in at:
            found = found[step] if isinstance(found, dict) and step in found else None
        return found if isinstance(found, dict) else ()

    def error(self, message: str, at: Location = (), **value: Any) -> TrajectoryError:
        """Return an error that names the file, the line and the dotted name of an entry."""
        return TrajectoryError(
            message, path=self.source.path, line=self.source.line(at), name=dotted(at) or None, **value
        )
