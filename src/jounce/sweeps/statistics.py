"""Stored results of every design: peaks with their instants, root mean squares, minima, maxima, and the outcome."""

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import MechanismError
from jounce.kinematics import Status
from jounce.sweeps.problems import Histories, Quantity

STATISTICS = {
    "peak": "largest magnitude of {} at the instants and where laws jump or bend",
    "peak_time": "instant of the largest magnitude of {}",
    "rms": "root mean square of {} over time",
    "min": "least value of {} at the instants and where laws jump or bend",
    "max": "largest value of {} at the instants and where laws jump or bend",
}


@dataclasses.dataclass(frozen=True)
class Variable:
    """One array of a result; its first dimension is design.

    Attributes
    ----------
    dims : tuple of str
        Dimensions after the first one.
    shape : tuple of int
        Sizes of these dimensions.
    """

    name: str
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: str
    attributes: dict[str, Any]


def variables_of(
    quantities: Sequence[Quantity], parameters: Sequence[str], levels: int, instants: int, *, histories: bool
) -> list[Variable]:
    """Return the arrays to store: parameters, outcomes, statistics, and histories if requested.

    Raises
    ------
    MechanismError
        If two arrays would have the same name.
    """
    flags = {"flag_values": [int(s) for s in Status], "flag_meanings": " ".join(s.name.lower() for s in Status)}
    variables = [
        Variable("failed_instants", (), (), "i4", {"long_name": "instants not solved, -1 where not computed"}),
        Variable("first_status", (), (), "i1", {"long_name": "outcome at the first instant not solved", **flags}),
    ]
    if histories:
        variables.append(Variable("status", ("time",), (instants,), "i1", {"long_name": "outcome", **flags}))
    for quantity in quantities:
        dims = ("derivative", *(axis for axis, _ in quantity.axes))
        shape = (levels, *quantity.shape)
        for kind, template in STATISTICS.items():
            units = "s" if kind == "peak_time" else quantity.units
            attributes = {"units": units, "long_name": template.format(quantity.name)}
            variables.append(Variable(f"{quantity.name}_{kind}", dims, shape, "f8", attributes))
        if histories:
            attributes = {"units": quantity.units, "long_name": quantity.name}
            variables.append(Variable(quantity.name, ("time", *dims), (instants, *shape), "f8", attributes))
    taken_names = {"time", "derivative", "design", *(axis for quantity in quantities for axis, _ in quantity.axes)}
    for variable in variables:
        if variable.name in taken_names:
            message = f"two arrays of the result would be called {variable.name}; give the output another name"
            raise MechanismError(message, name=f"outputs.{variable.name}")
        taken_names.add(variable.name)
    array_names = {name: name if name not in taken_names else f"parameter_{name}" for name in parameters}
    return [*(Variable(array_names[name], (), (), "f8", {"long_name": name}) for name in parameters), *variables]


def stored_values(
    results: Histories, quantities: Sequence[Quantity], levels: int, instants: np.ndarray, *, histories: bool
) -> dict[str, np.ndarray]:
    """Return the arrays of some designs, by name; designs not solved at all instants have no statistics."""
    count = len(results.status)
    is_failed = results.status != Status.OK
    first = np.take_along_axis(results.status, np.argmax(is_failed, axis=1)[:, None], axis=1)[:, 0]
    stored: dict[str, np.ndarray] = {
        "failed_instants": is_failed.sum(axis=1).astype("i4"),
        "first_status": first.astype("i1"),
    }
    if histories:
        stored["status"] = results.status.astype("i1")
    for quantity in quantities:
        values = results.values.get(quantity.name)
        if values is None:  # none of the designs was solved
            values = np.full((count, len(instants), levels, *quantity.shape), np.nan)
        sides = None if results.sides is None or quantity.name not in results.sides.values else results.sides
        summary = statistics(values, instants, results.pace, sides and (sides.values[quantity.name], sides.instants))
        stored |= {f"{quantity.name}_{kind}": x for kind, x in summary.items()}
        if histories:
            stored[quantity.name] = values
    return stored


def statistics(
    values: Float[np.ndarray, "design time *rest"],
    instants: np.ndarray,
    pace: np.ndarray | None = None,
    sides: tuple[np.ndarray, np.ndarray] | None = None,
) -> dict[str, Float[np.ndarray, "design *rest"]]:
    """Return statistics of histories over time; NaN where a value is unknown.

    Parameters
    ----------
    values : array of shape (designs, time, ...)
    instants : array of shape (time,)
        Instants, s; the mean of squares over time uses the trapezoidal rule.
    pace : array of shape (designs,), optional
        Factor by which each design moves faster than at the instants.
    sides : tuple of arrays of shape (designs, sides, ...) and (designs, sides), optional
        Further values for extremes, on both sides of breaks of laws, and their instants, s.

    Examples
    --------
    >>> found = statistics(np.array([[0.0, -3.0, 2.0]]), np.array([0.0, 1.0, 2.0]))
    >>> {name: value.tolist() for name, value in found.items() if name != "rms"}
    {'peak': [3.0], 'peak_time': [1.0], 'min': [-3.0], 'max': [2.0]}
    """
    series = np.moveaxis(values, (0, 1), (-2, -1))  # the memory layout of families, so that nothing is copied
    low, high, size = series.min(axis=-1), series.max(axis=-1), np.abs(series)
    index = np.argmax(size, axis=-1)
    peak = np.take_along_axis(size, index[..., None], axis=-1)[..., 0]
    scale = np.where(peak > 0, peak, 1.0)  # squares of large numbers would overflow
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        size /= scale[..., None]
        mean = np.einsum("t,...t,...t->...", _weights(instants), size, size)
    low, high, index, peak, rms = (np.moveaxis(x, -1, 0) for x in (low, high, index, peak, scale * np.sqrt(mean)))
    is_unknown, times = np.isnan(peak), instants[index]
    if sides is not None and sides[0].shape[1]:
        side_values, side_times = sides
        low = np.where(is_unknown, low, np.fmin(low, np.fmin.reduce(side_values, axis=1)))
        high = np.where(is_unknown, high, np.fmax(high, np.fmax.reduce(side_values, axis=1)))
        sizes = np.nan_to_num(np.abs(side_values), nan=-np.inf)
        index = np.argmax(sizes, axis=1)
        larger = np.take_along_axis(sizes, index[:, None], axis=1)[:, 0]
        instant = np.take_along_axis(side_times, index.reshape(len(index), -1), axis=1).reshape(index.shape)
        times = np.where(larger > peak, instant, times)
        peak = np.where(larger > peak, larger, peak)
    if pace is not None:
        times = instants[0] + (times - instants[0]) / pace.reshape(-1, *[1] * (times.ndim - 1))
    return {
        "peak": peak,
        "peak_time": np.where(is_unknown, np.nan, times),
        "rms": np.where(is_unknown, np.nan, rms),
        "min": low,
        "max": high,
    }


def _weights(instants: np.ndarray) -> Float[np.ndarray, " time"]:
    """Return the weights of a mean over time by the trapezoidal rule."""
    if len(instants) == 1:
        return np.ones(1)
    step = np.diff(instants)
    weight = np.zeros(len(instants))
    weight[:-1] += step / 2
    weight[1:] += step / 2
    return weight / (instants[-1] - instants[0])
