"""Arrays of a program for LLVM: NumPy arrays of values."""

from collections.abc import Callable, Sequence
from itertools import repeat
from typing import Any

import numpy as np

from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.values import Region, UnsupportedOperationError, Value, kind_of

MOST_CONSTANTS = 2**20  # of an array
Values = np.ndarray  # of objects, each a Value
Rule = Callable[[Code, Any, Sequence[Values]], Sequence[Values]]  # from an equation and its arguments to its results


def filled(shape: Sequence[int], values: Sequence[Value]) -> Values:
    """Return an array of values, the last axis fastest."""
    result = np.empty(shape, object)
    result.ravel()[:] = values
    return result


def constants(array: Any) -> Values:
    """Return an array of constants.

    Raises
    ------
    UnsupportedOperationError
        If there are too many.
    """
    array = np.asarray(array)
    if array.size > MOST_CONSTANTS:
        raise UnsupportedOperationError(f"{array.size} constants")
    kind = kind_of(array.dtype) if array.size else ""
    return filled(array.shape, [Value("", kind, False, number) for number in array.ravel()])


def each(function: Callable[..., Value], *arrays: Values) -> Values:
    """Return the results of a function for each element of arrays, which are broadcast to one shape."""
    shape = max([array.shape for array in arrays], key=len)
    if all(array.shape == shape or not array.ndim for array in arrays):
        parts = [flat(array) if array.ndim or not shape else repeat(array.item()) for array in arrays]
    else:
        arrays = np.broadcast_arrays(*arrays)
        shape, parts = arrays[0].shape, map(flat, arrays)
    return filled(shape, list(map(function, *parts)))


def in_memory(code: Code, values: Sequence[Value]) -> tuple[Region, int]:
    """Return the memory of contiguous numbers and the index of the first; store them if they are not in memory."""
    if values[0].home is not None:
        region, first = values[0].home
        indices = range(first, first + len(values))
        if all(v.home is not None and v.home == (region, k) for k, v in zip(indices, values, strict=True)):
            return region, first
    region = code.taken_room(len(values), values[0].kind, lanes=any(value.lanes for value in values))
    for k, value in enumerate(values):
        code.store(region, k, value)
    return region, 0
