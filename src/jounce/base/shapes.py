"""Arrays in annotations: `Float[Numbers, "order 3 *batch"]` is an array of floats with that shape.

An annotation states a shape as jaxtyping writes it, and beartype checks it while tests run. Axes are named alike
everywhere: within the library `order` first, components next, `*batch` last; at its doors `*batch` or `time` first,
then `derivative`, then `joint`, `row`, `column` or a component. An axis `order` or `derivative` counts from zero.

Public functions write `Array` for `Float`, and name the unions that they take by `TypeAliasType`: in a signature that
``help`` shows such an alias is its name. The checks see what it stands for. Within `dict[...]` and `tuple[...]`, which
beartype distinguishes by their text, only one shape of `Array` may be written: write `Float` there.
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
"""An array of JAX or NumPy."""

if TYPE_CHECKING:
    from jaxtyping import Float as Array
else:

    class Array:
        """An array of floats of some shape, as `jaxtyping.Float` writes it; ``help`` shows it by this short name."""

        def __class_getitem__(cls, kind_and_shape: tuple[Any, str]) -> TypeAliasType:
            return TypeAliasType("Array", jaxtyping.Float[kind_and_shape])


@runtime_checkable
class Labeled(Protocol):
    """What NumPy makes an array of: a column of a table, an array with labels, a quantity with a unit."""

    def __array__(self, *args: Any, **options: Any) -> np.ndarray: ...


ArrayLike = TypeAliasType("ArrayLike", Numbers | Sequence | np.floating | np.integer | float | int | Labeled)
"""What becomes an array of numbers: an array, lists or tuples of numbers in any nesting, a number."""

Real = TypeAliasType("Real", Numbers | np.floating | np.integer | float | int)
"""Real numbers: an array or one number."""

Refused = object
"""Anything else, which a function takes only to refuse it in words: ``int | Refused`` is a whole number."""


def is_traced(values: Any) -> bool:
    """Tell whether JAX traces an array in a pytree: then there are no numbers to check or to choose by."""
    leaves = jax.tree.leaves(values)
    return not only_arrays(leaves) and any(isinstance(x, Tracer) for x in leaves)


def only_arrays(leaves: Sequence[Any]) -> bool:
    """Tell whether all are arrays of NumPy, of which JAX would be slow to tell one by one that it traces none."""
    return set(map(type, leaves)) <= {np.ndarray}


def real_numbers(
    name: str | None, values: Any, error: Callable[..., Exception], expected: str = "real numbers"
) -> np.ndarray:
    """Return values as an array of double precision, the same one if they are one.

    Raises
    ------
    Exception
        That given, if they are no real numbers in one rectangular array: text, truth values, dates, durations, records,
        complex numbers, masked values, or quantities with a unit that is not of SI. NumPy would take most for numbers.
    """
    return _checked(name, values, error, expected, timed=False)


def real_or_traced(name: str | None, values: Any, error: Callable[..., Exception], *, timed: bool = False) -> Any:
    """Return values as they are where JAX traces them, or takes them for the real numbers that they are.

    Lists of what JAX traces become arrays. Others are read as `real_numbers` does, or, where they are times, as
    `seconds` does.
    """
    if is_real(values) or type(values) in _PLAIN or (type(values) is np.ndarray and values.dtype.kind in "fiu"):
        return values
    if isinstance(values, Tracer) and values.dtype.kind == "b":
        return values
    if not isinstance(values, Tracer) and is_traced(values):
        return jnp.asarray(values, float)  # a list of them
    return (seconds if timed else real_numbers)(name, values, error)


def seconds(
    name: str | None, values: Any, error: Callable[..., Exception], expected: str = "real numbers"
) -> np.ndarray:
    """Return instants as `real_numbers` does, durations and quantities of time converted to seconds.

    Dates are refused: which of them is time zero is for the user to say.

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
    """Says what values are in place of real numbers, and what to do."""

    def __str__(self) -> str:
        return f"; {self.args[0]}"


def _numbers(values: Any, timed: bool) -> np.ndarray:
    """Return values as an array of double precision; entries of lists and of arrays of objects one by one."""
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
    """Return the magnitudes of a quantity with a unit; raise an error unless they are in SI units, or are times."""
    unit = getattr(values, "attrs", {}).get("units")  # of arrays with labels
    if isinstance(unit, str) and not _SI.fullmatch(unit.strip()):
        raise _NoNumbersError(f"these are in {unit}: convert them to SI units")
    bare = getattr(values, "data", values) if unit is not None or hasattr(values, "coords") else values
    own = getattr(bare, "units", getattr(bare, "unit", None)) if hasattr(bare, "to") else None
    if own is None or not hasattr(bare, "magnitude" if hasattr(bare, "units") else "value"):
        return bare
    if not timed:
        raise _NoNumbersError(f"these have the unit {own or 1}: convert them to SI units, and give plain numbers")
    try:
        in_seconds: Any = bare.to("s")
    except Exception:  # noqa: BLE001 - the errors of libraries of units have no common base
        raise _NoNumbersError(f"these have the unit {own or 1}, which is not a unit of time") from None
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
    """Return derivatives as a list of arrays; a ValueError if one is not of real numbers, as `real_numbers` says."""
    return [x if is_real(x) else real_numbers("derivatives", x, no_numbers) for x in derivatives]


def no_numbers(message: str, name: str, value: object) -> ValueError:
    """Return the error of a jet for what is no array of real numbers."""
    return ValueError(f"{name} {message}, got {type(value).__name__}")


def is_real(x: Any) -> TypeGuard[jax.Array]:
    """Tell whether a value is an array of JAX, traced or not, of real numbers."""
    return isinstance(x, jax.Array) and x.dtype.kind in "fiu"


def has_labels(values: Any) -> bool:
    """Tell whether values are an array of xarray or pandas."""
    return hasattr(values, "isel") or hasattr(values, "iloc")


def by_component(name: str | None, values: Any, error: Callable[..., Exception]) -> Any:
    """Return values with their components in the order x, y, z where they have such labels, in any order.

    Arrays of xarray and pandas have; quaternions are ``w, x, y, z``. Of a tensor both axes may have labels.

    Raises
    ------
    Exception
        That given, if some of the labels are others, or the components lie along another axis than the last.

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
