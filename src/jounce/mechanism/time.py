"""Time grids: evenly spaced or given instant by instant, checked before the solution."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from typing_extensions import TypeAliasType

from jounce.base.shapes import Array, ArrayLike, seconds
from jounce.errors import MechanismError, UnitWarning, warn_caller
from jounce.mechanism.resolve import resolve
from jounce.trajectory import Expression

MAX_INSTANTS = 10_000_000
FEW = 3  # a smaller integer is no likely number of instants
PART_OF_STEP = 1e-6  # a last step shorter than this share is merged with the one before


@dataclasses.dataclass(frozen=True)
class TimeGrid:
    """Evenly spaced instants from start to stop, both included, s.

    Parameters
    ----------
    start, stop : number or expression
        First and last instant, s.
    step : number or expression, optional
        Spacing, s. The last step is shorter if the step does not divide the interval.
    count : number or expression, optional
        Number of instants, both ends included, instead of `step`.

    Warns
    -----
    UnitWarning
        If the step is a whole number longer than the grid: the number of instants was likely meant.

    Examples
    --------
    >>> from jounce.mechanism import time_grid
    >>> time_grid(TimeGrid(0, 1, step=0.3), {}).tolist()
    [0.0, 0.3, 0.6, 0.8999999999999999, 1.0]
    """

    start: Any
    stop: Any
    step: Any = None
    count: Any = None

    def __post_init__(self) -> None:
        are_numbers = all(isinstance(x, int | float) for x in (self.start, self.stop))
        if are_numbers and type(self.step) is int and self.step >= FEW and 0 < self.stop - self.start < self.step:
            phrase = f"the third value of a TimeGrid is its step, s, and {self.step} s is longer than the grid"
            warn_caller(UnitWarning(f"{phrase}: it has two instants; count={self.step} gives so many"))


TimeLike = TypeAliasType("TimeLike", ArrayLike | TimeGrid)
"""Instants, s: a list or an array of them, or an evenly spaced grid."""


@dataclasses.dataclass(frozen=True)
class SpacedInstants:
    """The instants of an evenly spaced grid, computed when requested, s.

    Parameters
    ----------
    start, step : float
        First instant and spacing, s.
    count : int
        Number of instants.
    stop : float
        Last instant, s, which is exact.
    """

    start: float
    step: float
    count: int
    stop: float

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: Any) -> Any:
        """Return instants by index or slice, like an array."""
        indices = range(self.count)[index]
        if isinstance(indices, int):
            return self._at(np.array([indices]))[0]
        return self._at(np.arange(indices.start, indices.stop, indices.step))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self._at(np.arange(self.count)).astype(dtype or float, copy=False)

    def _at(self, index: Int[np.ndarray, " time"]) -> Float[np.ndarray, " time"]:
        instants = self.start + self.step * index
        instants[index == self.count - 1] = self.stop
        return instants


Instants = Float[np.ndarray, " time"] | SpacedInstants


def time_grid(time: TimeLike | None, parameters: Mapping[str, Any]) -> Array[np.ndarray, " time"]:
    """Return the instants of a grid, shape (time,), s; raise MechanismError like `instants_of`."""
    return np.asarray(instants_of(time, parameters))


def instants_of(time: TimeLike | None, parameters: Mapping[str, Any]) -> Instants:
    """Return the instants of a grid, s; an evenly spaced grid takes no memory.

    Raises
    ------
    MechanismError
        If no grid is given, or its instants are not finite, not increasing, or more than ten million.
    """
    if time is None:
        message = "no time grid is given; add one, such as time: {start: 0, stop: 2, step: 0.01}, or give the instants"
        raise MechanismError(message, name="time")
    if isinstance(time, TimeGrid):
        return _spaced(time, parameters)
    instants = np.array(seconds("time", time, MechanismError))  # a copy, since the argument may change later
    if instants.ndim != 1 or not instants.size:
        raise MechanismError("the time grid must be a list of at least one instant", name="time", value=time)
    if not np.isfinite(instants).all():
        first = int(np.flatnonzero(~np.isfinite(instants))[0])
        raise MechanismError("instants must be finite", name=f"time[{first}]", value=float(instants[first]))
    if (instants[1:] <= instants[:-1]).any():
        first = int(np.flatnonzero(np.diff(instants) <= 0)[0]) + 1
        message = f"instants must increase strictly; this one does not come after {instants[first - 1]:g}"
        raise MechanismError(message, name=f"time[{first}]", value=float(instants[first]))
    return instants


def _resolved(name: str, value: Any, parameters: Mapping[str, Any]) -> Any:
    return resolve(value if isinstance(value, str | Expression) else seconds(name, value, MechanismError), parameters)


def _spaced(grid: TimeGrid, parameters: Mapping[str, Any]) -> SpacedInstants:
    given = {k: getattr(grid, k) for k in ("start", "stop", "step", "count") if getattr(grid, k) is not None}
    resolved = {k: _resolved(f"time.{k}", v, parameters) for k, v in given.items()}
    for name, value in resolved.items():
        if np.ndim(value):
            raise MechanismError("must be one number", name=f"time.{name}", value=given[name])
    values = {k: float(value) for k, value in resolved.items()}
    for name, value in values.items():
        if not np.isfinite(value):
            raise MechanismError("must be finite", name=f"time.{name}", value=value)
    start, stop = values["start"], values["stop"]
    if ("step" in values) == ("count" in values):
        raise MechanismError("a time grid takes either step or count", name="time", value=given)
    if stop < start:
        raise MechanismError(f"stop must not come before start ({start:g} s)", name="time.stop", value=stop)
    if "count" in values:
        count = values["count"]
        if count < 1 or count != int(count) or (count == 1) != (stop == start):
            message = "count must be a whole number of instants, at least 2 unless start and stop are the same"
            raise MechanismError(message, name="time.count", value=float(count))
    elif values["step"] <= 0:
        raise MechanismError("the step must be greater than zero", name="time.step", value=values["step"])
    else:
        steps = (stop - start) / values["step"]
        part = PART_OF_STEP + 2 * np.spacing(max(abs(start), abs(stop))) / values["step"]  # rounding of late instants
        full_steps = np.floor(steps + part)
        count = full_steps + 1 + (steps > full_steps + part)  # the last step is shorter
    if count > MAX_INSTANTS:
        raise MechanismError(f"a time grid holds at most {MAX_INSTANTS} instants", name="time", value=float(count))
    step = values["step"] if "step" in values else (stop - start) / max(int(count) - 1, 1)
    return SpacedInstants(start, step, int(count), stop)


def last_step_words(instants: Instants) -> str:
    """Return a remark that the last step of a grid is shorter than the other, equal steps; empty if it is not.

    Examples
    --------
    >>> last_step_words(np.array([0.0, 0.4, 0.8, 1.0]))
    'the step of 0.4 s does not divide the time: the last one is 0.2 s'
    """
    if len(instants) < 3:
        return ""
    steps = np.diff(instants)
    step, last = float(steps[0]), float(steps[-1])
    are_equal = np.abs(steps[:-1] - step).max() <= PART_OF_STEP * step
    if not (are_equal and last < step * (1 - 2 * PART_OF_STEP)):
        return ""
    return f"the step of {step:.6g} s does not divide the time: the last one is {last:.6g} s"


def nearest_instants(
    known: Float[np.ndarray, " known"], instants: Float[np.ndarray, " time"]
) -> Int[np.ndarray, " time"]:
    """Return, for each instant, the index of the nearest known instant, in any order; of two, the earlier.

    Examples
    --------
    >>> nearest_instants(np.array([0.0, 1.0, 2.0]), np.array([-1.0, 0.6, 1.5])).tolist()
    [0, 1, 1]
    """
    order = np.argsort(known, kind="stable")
    ordered = known[order]
    if len(known) < len(instants) and np.all(instants[:-1] <= instants[1:]):
        ends = np.searchsorted(instants, ordered[:-1] + 0.5 * (ordered[1:] - ordered[:-1]), side="right")
        counts = np.append(ends, len(instants))
        counts[1:] -= ends
        return np.repeat(order, counts)
    after = np.clip(np.searchsorted(ordered, instants), 1, max(len(known) - 1, 1))
    before, after = after - 1, np.minimum(after, len(known) - 1)
    return order[np.where(instants - ordered[before] <= ordered[after] - instants, before, after)]


def first_instant(time: TimeLike | None, parameters: Mapping[str, Any]) -> float:
    """Return the first instant of a mechanism, s; 0 if it has no time grid."""
    return 0.0 if time is None else float(time_grid(time, parameters)[0])
