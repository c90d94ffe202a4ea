"""Arrays in annotations: `Float[Numbers, "order 3 *batch"]` is an array of floats with that shape.

An annotation states a shape in the notation of jaxtyping, which beartype checks during tests. Axis names and orders are
the same everywhere: within the library `order` first, components next, `*batch` last; in public functions `*batch` or
`time` first, then `derivative`, then `joint`, `row`, `column` or a component. An axis `order` or `derivative` counts
from zero.

Public functions use `Array` for `Float`, and unions named by `TypeAliasType`, whose names ``help`` shows in signatures;
the checks see the types behind them. Within `dict[...]` and `tuple[...]`, which beartype distinguishes by their text,
only one shape of `Array` is possible: use `Float` there.
"""

import datetime
import re
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard, runtime_checkable

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
from jax.core import Tracer
from typing_extensions import TypeAliasType

Numbers = jax.Array | np.ndarray
"""A JAX or NumPy array."""

if TYPE_CHECKING:
    from jaxtyping import Float as Array
else:

    class Array:
        """An array of floats with a shape, as `jaxtyping.Float`, which ``help`` shows by this short name."""

        def __class_getitem__(cls, kind_and_shape: tuple[Any, str]) -> TypeAliasType:
            return TypeAliasType("Array", jaxtyping.Float[kind_and_shape])


@runtime_checkable
class Labeled(Protocol):
    """An object that NumPy converts to an array: a column of a table, a labeled array, a quantity with a unit."""

    def __array__(self, *args: Any, **options: Any) -> np.ndarray: ...


_ARRAY = {np.ndarray}

ArrayLike = TypeAliasType("ArrayLike", Numbers | Sequence | np.floating | np.integer | float | int | Labeled)
"""An object that can be converted to an array of numbers: an array, nested lists or tuples of numbers, a number."""

Real = TypeAliasType("Real", Numbers | np.floating | np.integer | float | int)
"""Real numbers: an array or one number."""

Refused = object
"""Any other object, which a function accepts only to raise a clear error: ``int | Refused`` means a whole number."""


def is_traced(values: Any) -> bool:
    """Return whether a pytree contains JAX tracers, whose values cannot be checked."""
    return has_tracers(jax.tree.leaves(values))


def has_tracers(leaves: Sequence[Any]) -> bool:
    """Return whether some of the leaves of a pytree are JAX tracers, by their classes, which are few."""
    kinds = set(map(type, leaves))
    return kinds != _ARRAY and any(issubclass(kind, Tracer) for kind in kinds)


def real_numbers(
    name: str | None, values: Any, error: Callable[..., Exception], expected: str = "real numbers"
) -> np.ndarray:
    """Return values as an array of double precision; the same object if they are one.

    Raises
    ------
    Exception
        The class `error`, unless the values are real numbers in a rectangular array. Text, truth values, dates,
        durations, records, complex numbers, masked values, and quantities with units other than SI are refused,
        although NumPy would convert most of them.
    """
    return _checked(name, values, error, expected, timed=False)


def real_or_traced(name: str | None, values: Any, error: Callable[..., Exception], *, timed: bool = False) -> Any:
    """Return tracers and real numbers unchanged, and other values as `real_numbers`, or for times as `seconds`.

    Lists with tracers become JAX arrays.
    """
    if is_real(values) or type(values) in _PLAIN or (type(values) is np.ndarray and values.dtype.kind in "fiu"):
        return values
    if isinstance(values, Tracer) and values.dtype.kind == "b":
        return values
    if not isinstance(values, Tracer) and is_traced(values):
        return jnp.asarray(values, float)  # a list of tracers
    return (seconds if timed else real_numbers)(name, values, error)


def seconds(
    name: str | None, values: Any, error: Callable[..., Exception], expected: str = "real numbers"
) -> np.ndarray:
    """Return instants as `real_numbers` does, with durations and quantities of time converted to seconds.

    Dates are refused, since only the user knows which date is time zero.

    Examples
    --------
    >>> seconds("time", np.array([0, 500], "timedelta64[ms]"), ValueError).tolist()
    [0.0, 0.5]
    """
    return _checked(name, values, error, expected, timed=True)


def _checked(
    name: str | None, values: Any, error: Callable[..., Exception], expected: str, *, timed: bool
) -> np.ndarray:
    try:
        return _numbers(values, timed)
    except _NoNumbersError as reason:
        raise error(f"must be {expected}{reason}", name=name, value=values) from None
    except (TypeError, ValueError, OverflowError):
        raise error(f"must be {expected}", name=name, value=values) from None


class _NoNumbersError(Exception):
    """The values are not real numbers; the message names their kind and a remedy."""

    def __str__(self) -> str:
        return f"; {self.args[0]}"


def _numbers(values: Any, timed: bool) -> np.ndarray:
    """Return values as an array of double precision, with entries of lists and object arrays converted one by one."""
    if type(values) is np.ndarray and values.dtype.kind in "fiu":
        return np.asarray(values, float)
    if isinstance(values, list | tuple):
        if set(map(type, values)) <= _PLAIN:
            return np.array(values, float)
        return np.array([_numbers(entry, timed) for entry in values], float)
    if isinstance(values, datetime.timedelta) and timed:
        return np.array(values / datetime.timedelta(seconds=1))
    if isinstance(values, datetime.timedelta | datetime.date):
        raise _NoNumbersError(_DATES if isinstance(values, datetime.date) else _DURATIONS)
    if hidden := np.ma.count_masked(values) if isinstance(values, np.ma.MaskedArray) else 0:
        raise _NoNumbersError(f"{hidden} of {np.size(values)} are masked: leave them out, or fill them in")
    array = np.asarray(_unit_free(values, timed))
    kind = array.dtype.kind
    if kind in "fiu" or jnp.issubdtype(array.dtype, np.floating):
        return np.asarray(array, float)
    if kind == "m" and timed:
        return _seconds_of(array)
    if kind == "O" and array.ndim:
        return np.array([_numbers(entry, timed) for entry in array.ravel()], float).reshape(array.shape)
    if kind == "O" and not isinstance(array.item(), str | bytes):
        return np.array(float(array.item()))  # a fraction, say
    raise _NoNumbersError(_MEANT[kind]) if kind in _MEANT else ValueError


def _seconds_of(durations: np.ndarray) -> np.ndarray:
    if np.datetime_data(durations.dtype)[0] == "generic" or np.isnat(durations).any():
        raise _NoNumbersError("these are durations, of which one has no unit, or is missing (NaT)")
    return np.asarray(durations / np.timedelta64(1, "s"))


def _unit_free(values: Any, timed: bool) -> Any:
    """Return the magnitudes of a quantity; raise an error unless its unit is SI or, if `timed`, a unit of time."""
    unit = getattr(values, "attrs", {}).get("units")  # of labeled arrays
    if isinstance(unit, str) and not _SI.fullmatch(unit.strip()):
        raise _NoNumbersError(f"these are in {unit}: convert them to SI units")
    data = getattr(values, "data", values) if unit is not None or hasattr(values, "coords") else values
    given_unit = getattr(data, "units", getattr(data, "unit", None)) if hasattr(data, "to") else None
    if given_unit is None or not hasattr(data, "magnitude" if hasattr(data, "units") else "value"):
        return data
    if not timed:
        raise _NoNumbersError(
            f"these have the unit {given_unit or 1}: convert them to SI units, and give plain numbers"
        )
    try:
        in_seconds: Any = data.to("s")
    except Exception:  # noqa: BLE001 - the errors of libraries of units have no common base
        raise _NoNumbersError(f"these have the unit {given_unit or 1}, which is not a unit of time") from None
    return in_seconds.magnitude if hasattr(in_seconds, "magnitude") else in_seconds.value


_PLAIN = {float, int, np.float64, np.int64}
_DURATIONS = "these are durations: divide them by np.timedelta64(1, 's')"
_DATES = "these are dates: give seconds from the first on, (t - t[0]) / np.timedelta64(1, 's')"
_MEANT = {
    "m": _DURATIONS,
    "M": _DATES,
    "b": "these are truth values",
    "V": "these are records: take one of their fields",
}
_UNIT = r"(?:m|kg|s|rad|N|J|W|Hz|Pa|K|1|met(?:er|re)s?|seconds?|radians?|newtons?)(?:(?:\^|\*\*)?-?\d+)?"
_SI = re.compile(rf"|dimensionless|{_UNIT}(?: ?[*/ ] ?{_UNIT})*")


def real_derivatives(derivatives: Iterable[Any]) -> list[Any]:
    """Return derivatives as a list of arrays; raise ValueError unless all are real numbers as for `real_numbers`."""
    return [x if is_real(x) else real_numbers("derivatives", x, no_numbers) for x in derivatives]


def no_numbers(message: str, name: str, value: object) -> ValueError:
    """Return the error of a jet for values that are not an array of real numbers."""
    return ValueError(f"{name} {message}, got {type(value).__name__}")


def is_real(x: Any) -> TypeGuard[jax.Array]:
    """Return whether a value is a JAX array of real numbers, traced or not."""
    return isinstance(x, jax.Array) and x.dtype.kind in "fiu"


def has_labels(values: Any) -> bool:
    """Return whether values are labeled, as xarray or pandas objects are."""
    return hasattr(values, "isel") or hasattr(values, "iloc")


def by_component(name: str | None, values: Any, error: Callable[..., Exception]) -> Any:
    """Return values with labeled components sorted to x, y, z, or to w, x, y, z for a quaternion.

    Labels are those of xarray and pandas; both axes of a tensor may have labels.

    Raises
    ------
    Exception
        The class `error`, if there are other labels, or the components are not along the last axis.

    Examples
    --------
    >>> import pandas as pd
    >>> by_component("gravity", pd.Series([-9.81, 0.0, 1.0], index=["z", "y", "x"]), ValueError).tolist()
    [1.0, 0.0, -9.81]
    """
    if hasattr(values, "isel") and hasattr(values, "indexes"):
        axes = [list(values.indexes.get(axis, ())) for axis in values.dims]
    elif hasattr(values, "iloc") and hasattr(values, "axes"):
        axes = [list(axis) for axis in values.axes]
    else:
        return values
    texts = [[label.lower() if isinstance(label, str) else "" for label in axis] for axis in axes]
    named = [axis for axis, labels in enumerate(texts) if not _COMPONENTS[-1].isdisjoint(labels)]
    if named and named[-1] != len(axes) - 1:
        raise error("the components must be along the last axis: transpose it", name=name)
    for axis in named:
        labels = texts[axis]
        if set(labels) not in _COMPONENTS or len(set(labels)) < len(labels):
            message = "its labels must be x, y and z, in the plane x and y, of a quaternion w, x, y and z, each once"
            raise error(message, name=name, value=", ".join(map(str, axes[axis])))
        order = sorted(range(len(labels)), key=lambda k: "wxyz".index(labels[k]))
        values = (
            values.isel({values.dims[axis]: order})
            if hasattr(values, "isel")
            else values.iloc[(slice(None),) * axis + (order,)]
        )
    return values


_COMPONENTS = [set("xy"), set("xyz"), set("wxyz")]
