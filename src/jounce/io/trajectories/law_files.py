"""Laws and point-to-point motions of joints in YAML, TOML or JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from jounce.base.shapes import ArrayLike
from jounce.errors import JounceError, TrajectoryError, no_such, show_value
from jounce.io.files.located_data import Location, Source
from jounce.io.files.reading import fault_of_number
from jounce.io.files.samples import rates, read_columns, read_samples, sampled_dimension
from jounce.io.trajectories.tables import measured
from jounce.mechanism import TimeGrid, time_grid
from jounce.trajectory import (
    AbstractMotion,
    Expression,
    ExpressionMotion,
    JointTrajectory,
    MeasuredMotion,
    SplineMotion,
)  # fmt: skip
from jounce.trajectory.laws.trapezoid import LIMITS
from jounce.units.dimensions import TIME, Dimension, describe_dimension, is_rate, per_power
from jounce.units.expression import check_parameter_name

_KINDS = ("joints", "point_to_point", "motion")
_KEYS = ("title", "parameters", "time", *_KINDS)
_SAMPLE_KEYS = ("samples", "degree", "derivative", "initial")
_ORDERS = (("degree", 5), ("derivative", 0))
_MOTION_KEYS = ("profile", "duration", "start_time", "from", "to", "limits")


def _order(data: Mapping[str, Any]) -> int:
    """Return the order of the derivative that samples give; an invalid entry is refused later."""
    order = data.get("derivative", 0)
    return order if isinstance(order, int) else 0


class LawFile:
    """Reads laws from the data of a file; every error names the file, the line and the entry."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.data = source.mapping((), _KEYS)
        if sum(kind in self.data for kind in _KINDS) != 1:
            message = "a trajectory file has either 'joints', 'point_to_point' or 'motion'"
            raise source.error(message, value=list(self.data))
        self.parameters: dict[str, float] = {}
        self.dimensions: dict[str, Dimension] = {}
        self.measures: dict[str, str] = {}  # angle or length, for joints whose laws state a unit
        for name, raw in (source.mapping(("parameters",)) if "parameters" in self.data else {}).items():
            self._add_parameter(name, raw)

    def _add_parameter(self, name: str, raw: Any) -> None:
        place = ("parameters", name)
        check_parameter_name(name, self.source.error_type, **self.source.error_fields(place))
        value = self.source.value(place, raw, "any", self.parameters, self.dimensions)
        if value.dimension is not None:
            self.dimensions[name] = value.dimension
        self.parameters[name] = self._finite(value.value, raw, place)  # an expression may use the parameters above it

    def trajectory(self) -> JointTrajectory:
        """Return the trajectory of the file."""
        if "point_to_point" in self.data:
            return self._point_to_point()
        if "motion" in self.data:
            return self._sampled_motion()
        laws = {name: self._law(("joints", name), raw) for name, raw in self.source.mapping(("joints",)).items()}
        return self._on_grid(laws, self._times())

    def _law(self, location: Location, raw: Any) -> AbstractMotion | float:
        """Return the law of a joint: an expression, a number, or samples in a column of a file."""
        if not isinstance(raw, dict):
            value = self._value(raw, "any", location, ("t",), joint=location[-1])
            return ExpressionMotion(value, self.parameters) if isinstance(value, Expression) else value
        data = self.source.mapping(location, (*_SAMPLE_KEYS, "time", "value"))
        columns: dict[str, Any] = {
            key: self._text(data[key], (*location, key)) for key in ("time", "value") if key in data
        }
        allowed = rates(("angle", "length"), _order(data))
        columns["error_type"] = TrajectoryError
        times, values = self._samples(location, lambda path: read_samples(path, **columns, allowed=((TIME,), allowed)))
        self._note(location[-1], self._samples(location, lambda path: sampled_dimension(path, **columns)), location)
        return self._spline(location, data, times, values, (*location, "initial"), location[-1])

    def _sampled_motion(self) -> JointTrajectory:
        """Return the trajectory whose joints are the columns of a sample file."""
        location: Location = ("motion",)
        data = self.source.mapping(location, _SAMPLE_KEYS)
        times, columns, units = self._samples(location, lambda path: read_columns(path, TrajectoryError, _order(data)))
        for name in self.source.mapping((*location, "initial")) if "initial" in data else ():
            if name not in columns:
                raise self.source.error(no_such("column", name, columns), (*location, "initial", name))
        for name, dimension in units.items():
            self._note(name, dimension, location)
        laws = {
            name: self._spline(location, data, times, values, (*location, "initial", name), name)
            for name, values in columns.items()
        }
        return self._on_grid(laws, self._times() if "time" in self.data else times)

    def _on_grid(self, laws: Mapping[str, Any], times: np.ndarray) -> JointTrajectory:
        return self._with_location(("time",), lambda: JointTrajectory(laws, times[0], times[-1], times, self.measures))

    def _samples(self, place: Location, read: Callable[[str], Any]) -> Any:
        """Return the content of the sample file that an entry names."""
        location = (*place, "samples")
        if self.source.at(location) is None:
            raise self.source.error("is missing; give the name of a CSV file", location)
        return self.source.read_named(self._text(self.source.at(location), location), location, read)

    def _spline(
        self,
        place: Location,
        data: Mapping[str, Any],
        times: ArrayLike,
        values: ArrayLike,
        location: Location,
        joint: Any,
    ) -> SplineMotion:
        """Return the spline through samples of a coordinate, or the integral of the spline through a derivative."""
        degree, derivative = (self._whole(data.get(key, default), (*place, key)) for key, default in _ORDERS)
        initial = [] if self.source.at(location) is None else self.source.at(location)
        if not isinstance(initial, list):
            raise self.source.error("must be a list: the coordinate, its velocity and so on", location, value=initial)
        if len(initial) > derivative:
            message = f"must have at most {derivative} values: the coordinate and what is below the measured derivative"
            raise self.source.error(message, location, value=initial)
        initial_values = [self._number(raw, "any", (*location, k), k, joint) for k, raw in enumerate(initial)]
        if derivative:
            return self._with_location(place, lambda: MeasuredMotion(times, values, derivative, initial_values, degree))
        return self._with_location(place, lambda: SplineMotion(times, values, degree))

    def _whole(self, raw: Any, location: Location) -> int:
        if isinstance(raw, bool) or not isinstance(raw, int) or raw < 0:
            raise self.source.error("must be a whole number, 0 or greater", location, value=raw)
        return raw

    def _text(self, raw: Any, location: Location) -> str:
        if not isinstance(raw, str):
            raise self.source.error("must be a name", location, value=raw)
        return raw

    def _point_to_point(self) -> JointTrajectory:
        location: Location = ("point_to_point",)
        data = self.source.mapping(location, _MOTION_KEYS)
        self._check_given(location, ("from", "to"))
        first, last = (self.source.mapping((*location, key)) for key in ("from", "to"))
        for names, other_names, key in ((first, last, "to"), (last, first, "from")):
            for name in names:
                if name not in other_names:
                    message = f"the joint {show_value(name)} is missing; 'from' and 'to' name the same joints"
                    raise self.source.error(message, (*location, key))
        start = [self._number(first[name], "any", (*location, "from", name), joint=name) for name in first]
        end = [self._number(last[name], "any", (*location, "to", name), joint=name) for name in first]
        times = {
            key: self._number(data[key], "time", (*location, key)) for key in ("duration", "start_time") if key in data
        }
        profile = self._text(data.get("profile", "minimum_jerk"), (*location, "profile"))
        limits = self._limits((*location, "limits")) if "limits" in data else None
        motion = self._with_location(
            location, lambda: JointTrajectory.point_to_point(list(first), start, end, profile, limits=limits, **times)
        )
        return self._on_grid(motion.laws, self._times() if "time" in self.data else motion.times)

    def _check_given(self, location: Location, keys: Iterable[str]) -> None:
        for key in keys:
            if key not in self.source.mapping(location):
                raise self.source.error("is missing", (*location, key))

    def _limits(self, location: Location) -> list[float]:
        data = self.source.mapping(location, LIMITS)
        self._check_given(location, LIMITS)
        return [self._number(data[key], "any", (*location, key), power) for power, key in enumerate(LIMITS, start=1)]

    def _times(self) -> np.ndarray:
        """Return the instants of the time grid."""
        if "time" not in self.data:
            raise self.source.error("is missing; give start, stop and step", ("time",))
        data = self.source.mapping(("time",), ("start", "stop", "step", "count"))
        self._check_given(("time",), ("stop",))
        kinds = {"count": "ratio"}
        values = {key: self._number(raw, kinds.get(key, "time"), ("time", key)) for key, raw in data.items()}
        times = self._with_location(("time",), lambda: time_grid(TimeGrid(**{"start": 0.0, **values}), {}))
        if len(times) < 2:
            message = "a trajectory needs at least two instants; choose a later stop"
            raise self.source.error(message, ("time",))
        return times

    def _number(self, raw: Any, kind: str, location: Location, per_time: int = 0, joint: Any = None) -> float:
        """Return a number in SI units; "any" is a coordinate, per second to the power `per_time`."""
        return self._finite(self._value(raw, kind, location, (), per_time, joint), raw, location)

    def _finite(self, value: float | Expression, raw: Any, location: Location) -> float:
        number = (
            self._with_location(location, lambda: value.evaluate(self.parameters))
            if isinstance(value, Expression)
            else value
        )
        if fault := fault_of_number(number):
            raise self.source.error(fault, location, value=raw)
        return float(number)

    def _value(
        self, raw: Any, kind: str, location: Location, names: Iterable[str] = (), per_time: int = 0, joint: Any = None
    ) -> float | Expression:
        """Return a number in SI units, or an expression of the parameters and of other names."""
        value = self.source.value(location, raw, kind, (*self.parameters, *names), self.dimensions)
        if kind == "any" and value.dimension and not is_rate(value.dimension, ("angle", "length"), per_time):
            message = f"must be an angle or a length{per_power(per_time)}, not {describe_dimension(value.dimension)}"
            raise self.source.error(message, location, value=raw)
        if joint is not None:
            self._note(joint, value.dimension, location)
        return value.value

    def _note(self, joint: Any, dimension: Dimension | None, location: Location) -> None:
        """Record whether the unit of a law shows that the coordinate of its joint is an angle or a length."""
        measure = measured(dimension)
        if measure and self.measures.setdefault(joint, measure) != measure:
            message = f"the units of {show_value(joint)} are those of an angle here and of a length there"
            raise self.source.error(message, location)

    def _with_location(self, location: Location, make: Callable[[], Any]) -> Any:
        """Return the result of a call; errors within it get a location in the file."""
        try:
            return make()
        except JounceError as error:
            name = error.name or ""
            entry, last = self.source.at(location), name.rpartition(".")[2]
            inside = isinstance(entry, dict) and last in entry
            is_located = inside or not name or name.split(".")[0] in location
            message = error.message if is_located else f"{name}: {error.message}"
            raise self.source.error(message, (*location, last) if inside else location, value=error.value) from None
