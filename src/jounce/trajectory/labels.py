"""Labels of xarray and pandas arrays, so that values are assigned to joints by name instead of position.

Values of a trajectory have such labels, too: messages of ROS often have the joints in another order than the robot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np


class JointValues(np.ndarray):
    """An array that knows the joints along its last axis, as do its parts and copies, also in other processes."""

    joint_names: tuple[str, ...] = ()

    @classmethod
    def of(cls, joint_names: Iterable[str], values: np.ndarray) -> JointValues:
        """Return values, the last axis of which has these joints."""
        named = np.ascontiguousarray(values).view(cls)
        named.joint_names = tuple(joint_names)
        return named

    def __getitem__(self, key: Any) -> Any:
        part = super().__getitem__(key)
        if isinstance(part, JointValues) and self.joint_names and part.size and part.ndim:
            columns = np.broadcast_to(np.arange(self.shape[-1]), self.shape)[key]
            row = columns[(0,) * (columns.ndim - 1)].tolist()
            part.joint_names = tuple(self.joint_names[k] for k in row) if len({*row}) == len(row) else ()
        return part

    def copy(self, order: Any = "C") -> JointValues:
        """Return a copy with the same joints."""
        copied = super().copy(order)
        copied.joint_names = self.joint_names
        return copied

    def __copy__(self) -> JointValues:
        return self.copy()

    def __deepcopy__(self, memo: object) -> JointValues:
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return JointValues.of, (self.joint_names, np.asarray(self))

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else np.asarray(array)


def in_order(
    name: str, values: Any, labels: Sequence[str], error: Callable[..., Exception], plural: str = "joints"
) -> Any:
    """Return values with the labels of their last axis in a given order; unchanged if they have no such labels.

    Raises
    ------
    Exception
        Of the given type, if only some of their labels are given ones, or another axis has them; or if labeled
        derivatives are along another axis than the last but one, or are not those of order zero, one and so on.

    Examples
    --------
    >>> import xarray as xr
    >>> q = xr.DataArray([[0.1, 0.2]], dims=("derivative", "joint"), coords={"joint": ["b", "a"]})
    >>> in_order("q", q, ("a", "b"), ValueError).values.tolist()
    [[0.2, 0.1]]
    """
    if hasattr(values, "isel") and hasattr(values, "indexes"):
        axes = [_texts(values.indexes.get(axis)) for axis in values.dims]
        is_transposed = "joint" in values.dims[:-1]
    elif hasattr(values, "iloc") and hasattr(values, "axes"):
        axes, is_transposed = [_texts(axis) for axis in values.axes], False
    elif isinstance(values, JointValues):
        axes, is_transposed, values = [list(values.joint_names)], False, np.asarray(values)
    else:
        return values
    last_labels, expected = (axes[-1] if axes else []), set(labels)
    if expected.isdisjoint(last_labels) and (is_transposed or any(expected <= set(axis) for axis in axes)):
        raise error(f"the {plural} must be along the last axis: transpose it", name=name)
    _check_derivatives(name, values, error)
    if expected.isdisjoint(last_labels) or last_labels == list(labels):
        return values
    if len(last_labels) != len(expected) or set(last_labels) != expected:
        message = f"its last axis must have each of the {plural} {', '.join(labels)} once, and nothing else"
        raise error(message, name=name, value=", ".join(last_labels))
    order = [last_labels.index(label) for label in labels]
    if hasattr(values, "isel"):
        return values.isel({values.dims[-1]: order})
    return values[..., order] if isinstance(values, np.ndarray) else values.iloc[..., order]


def _check_derivatives(name: str, values: Any, error: Callable[..., Exception]) -> None:
    dims = getattr(values, "dims", ())
    if "derivative" not in dims:
        return
    if dims[-2 if len(dims) > 1 else -1] != "derivative":
        raise error("the derivatives must be along the last axis but one: transpose it", name=name, value=str(dims))
    orders = list(values.indexes.get("derivative", ()))
    if orders and orders != list(range(len(orders))):
        raise error("its derivatives must be those of order 0, 1, 2 and so on", name=name, value=orders)


def check_rows(name: str, times: Any, values: Any, error: Callable[..., Exception]) -> None:
    """Raise an error unless the labels of samples agree with their times and derivatives.

    Raises
    ------
    Exception
        Of the given type, if the labels of the rows are the times in another order, or if columns labeled as
        derivatives are not those of order zero, one and so on.
    """
    rows = labels_of_rows(values)
    instants = list(np.ravel(np.asarray(times))) if rows else []
    if rows != instants and len(rows) == len(instants) and set(rows) == set(instants):
        message = "the times are its labels, in another order: sort times and values alike"
        raise error(message, name=name, value=f"{rows[0]} first")
    if hasattr(values, "isel") and hasattr(values, "indexes") and "derivative" in values.dims[1:]:
        columns, is_named = list(values.indexes.get("derivative", ())), True
    else:
        columns = list(getattr(values, "columns", ()))
        is_named = getattr(getattr(values, "columns", None), "name", None) == "derivative"
    orders = list(range(len(columns)))
    if columns != orders and (is_named or set(columns) == set(orders)) and columns:
        raise error("its derivatives must be those of order 0, 1, 2 and so on", name=name, value=columns)


def labels_of_rows(values: Any) -> list[object]:
    """Return the labels along the first axis; empty if it has none."""
    if hasattr(values, "isel") and hasattr(values, "indexes"):
        return list(values.indexes.get(values.dims[0], ())) if values.dims else []
    return list(values.index) if hasattr(values, "iloc") else []


def _texts(index: Iterable[object] | None) -> list[str]:
    """Return the labels of an axis; empty unless all are text."""
    labels = [] if index is None else list(index)
    return [label for label in labels if isinstance(label, str)] if all(isinstance(x, str) for x in labels) else []
