"""Arrays of a program that is written for LLVM: NumPy arrays whose elements are values."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.values import Region, UnsupportedOperationError, Value

MOST_CONSTANTS = 2**20  # of an array
Values = np.ndarray  # of objects, each a Value
Rule = Callable[[Code, Any, Sequence[Values]], Sequence[Values]]  # of an equation and its arguments; its results


def filled(shape: Sequence[int], values: Sequence[Value]) -> Values:
    """Return an array of values, the last axis fastest."""
    result = np.empty(shape, object)
    result.ravel()[:] = values
    return result


def constants(code: Code, array: Any) -> Values:
    """Return an array of constants.

    Raises
    ------
    UnsupportedOperationError
        If there are too many.
    """
    array = np.asarray(array)
    if array.size > MOST_CONSTANTS:
        raise UnsupportedOperationError(f"{array.size} constants")
    return filled(array.shape, [code.constant(number) for number in array.ravel()])


def each(function: Callable[..., Value], *arrays: Values) -> Values:
    """Return what a function gives for each element of arrays, which are spread to one shape."""
    shape = arrays[0].shape
    if any(array.shape != shape for array in arrays):
        arrays = np.broadcast_arrays(*arrays)
        shape = arrays[0].shape
    return filled(shape, list(map(function, *map(flat, arrays))))


def in_memory(code: Code, values: Sequence[Value]) -> tuple[Region, int]:
    """Return where some numbers are one after another in memory, and the first place: put there if they are not yet."""
    if values[0].home is not None:
        region, first = values[0].home
        indices = range(first, first + len(values))
        if all(v.home is not None and v.home == (region, k) for k, v in zip(indices, values, strict=True)):
            return region, first
    region = code.taken_room(len(values), values[0].kind, lanes=any(value.lanes for value in values))
    for k, value in enumerate(values):
        code.store(region, k, value)
    return region, 0
