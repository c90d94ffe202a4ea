"""Checks of the numbers of motion laws; each raises an error that names the wrong number."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce import errors
from jounce.base.shapes import ArrayLike, real_numbers, seconds
from jounce.errors import JounceError, TrajectoryError
from jounce.rigid import inertia
from jounce.trajectory.labels import check_rows

whole_number = partial(errors.whole_number, error=TrajectoryError)
finite_numbers = partial(inertia.finite_numbers, error=TrajectoryError)


Read = Callable[..., np.ndarray]
"""Conversion of numbers: `real_numbers`, or `seconds` for times."""


def finite(name: str | None, value: Any, read: Read = real_numbers) -> float:
    """Return a finite number, after a check."""
    number = read(name, value, TrajectoryError, "a finite number")
    if number.ndim or not np.isfinite(number):
        raise TrajectoryError("must be a finite number", name=name, value=value)
    return float(number)


def positive(name: str, value: Any, read: Read = real_numbers) -> float:
    """Return a finite number greater than zero, after a check."""
    number = finite(name, value, read)
    if number <= 0:
        raise TrajectoryError("must be greater than zero", name=name, value=value)
    return number


def finite_row(name: str, values: ArrayLike, read: Read = real_numbers) -> Float[np.ndarray, " number"]:
    """Return finite numbers along one axis, at least one, after a check."""
    row = finite_numbers(name, values, read=read)
    if row.ndim != 1 or not row.size:
        raise TrajectoryError(f"must have one axis of at least one number, not the shape {row.shape}", name=name)
    return row


def check_samples(
    times: ArrayLike, values: ArrayLike, error: type[JounceError] = TrajectoryError
) -> tuple[Float[np.ndarray, " samples"], Float[np.ndarray, "samples *columns"]]:
    """Return times and values of samples after a check: finite, at least two, one row per time, increasing times."""
    check_rows("values", times, values, error)
    times, values = seconds("times", times, error), real_numbers("values", values, error)
    if times.ndim != 1 or values.ndim < 1 or len(times) != len(values):
        shapes = f"shapes {times.shape} and {values.shape}"
        raise error("samples need one value for each time; give lists of equal length", value=shapes)
    if len(times) < 2:
        raise error("at least two samples are needed", value=len(times))
    for name, entries in (("times", times), ("values", values)):
        failures = np.argwhere(~np.isfinite(entries))
        if len(failures):
            index = "".join(f"[{k}]" for k in failures[0])
            raise error("samples must be finite", name=f"{name}{index}", value=float(entries[tuple(failures[0])]))
    steps = np.diff(times)
    if (steps <= 0).any():
        first = int(np.argmax(steps <= 0))
        relation = "repeats the one before" if steps[first] == 0 else "comes before the one before"
        message = f"times of samples must increase; this one {relation}"
        raise error(message, name=f"times[{first + 1}]", value=float(times[first + 1]))
    return times, values


def names_of_joints(names: Iterable[str]) -> tuple[str, ...]:
    """Return names of joints, after a check that they are text and differ."""
    result = (names,) if isinstance(names, str) else tuple(names)
    if not result or not all(isinstance(name, str) for name in result):
        raise TrajectoryError("names of joints are needed, as a list of text", name="names", value=list(result))
    if len(set(result)) < len(result):
        repeated = next(name for k, name in enumerate(result) if name in result[:k])
        raise TrajectoryError("a joint is named twice", name="names", value=repeated)
    return result
