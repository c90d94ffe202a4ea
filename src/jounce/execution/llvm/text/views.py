"""Arrays in memory, too large for single values, described by offsets and strides.

Parts, transposes and repetitions of such an array are views, as in NumPy, and need no operations on numbers. Numbers
that are used once need not be in memory: they are computed where they are used, from arrays in memory.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided

from jounce.execution.buffer_pool import address_of
from jounce.execution.llvm.text.arrays import Values
from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.values import Region, Value

ORIGIN = np.zeros(1, np.int8)  # base of NumPy arrays that serve only to compute views


class Shaped:
    """An object with a shape, as a NumPy array."""

    shape: Any

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)


@dataclass(frozen=True, eq=False)
class Stored(Shaped):
    """An array in memory.

    Attributes
    ----------
    region : Region
        Memory of its numbers.
    shape, strides : tuple of int
        As for a NumPy array; strides count numbers.
    first : int or Value
        Index of the first number, which may differ from lane to lane.
    """

    region: Region
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    first: int | Value = 0

    @property
    def kind(self) -> str:
        """Kind of the numbers."""
        return self.region.kind

    @property
    def lanes(self) -> bool:
        """Whether numbers differ from lane to lane."""
        return self.region.lanes or (isinstance(self.first, Value) and self.first.lanes)

    def is_same(self, other: Any) -> bool:
        """Return whether another array is the same view."""
        return (
            isinstance(other, Stored)
            and (other.region is self.region and other.shape == self.shape and other.strides == self.strides)
            and (other.first is self.first or (isinstance(self.first, int) and other.first == self.first))
        )


@dataclass(frozen=True, eq=False)
class Deferred(Shaped):
    """An array whose numbers are computed where they are used, once.

    Attributes
    ----------
    given : tuple of Stored
        Operands of its shape, from which it is computed number by number.
    kind : str
        Kind of the numbers.
    body : callable
        Function from numbers of the operands to one of its own.
    parts : bool, default False
        Whether the function itself makes lanes differ.
    """

    given: tuple[Stored, ...]
    kind: str
    body: Callable[[Sequence[Value]], Value]
    parts: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes."""
        return self.given[0].shape

    @property
    def lanes(self) -> bool:
        """Whether numbers differ from lane to lane."""
        return self.parts or any(array.lanes for array in self.given)

    def viewed(self, view: Callable[[Stored], Stored]) -> "Deferred":
        """Return a view of the array, by views of its operands."""
        return replace(self, given=tuple(map(view, self.given)))

    def in_shape(self, shape: Sequence[int]) -> "Deferred | None":
        """Return the same numbers in another shape; None if an operand has no strides for it."""
        result = [in_shape(array, shape) for array in self.given]
        operands = tuple(array for array in result if array is not None)
        return replace(self, given=operands) if len(operands) == len(result) else None


def as_read(array: Stored) -> Deferred:
    """Return a deferred array whose numbers are loaded where they are used."""
    return Deferred((array,), array.kind, lambda values: values[0])


InMemory = Stored | Deferred
Array = Values | InMemory


def contiguous(region: Region, shape: Sequence[int], first: int | Value = 0) -> Stored:
    """Return a contiguous array, the last axis fastest."""
    ends = np.cumprod([1, *shape[:0:-1]]) if len(shape) else []
    return Stored(region, tuple(shape), tuple(int(x) for x in ends[::-1]), first)


def further(code: Code, first: int | Value, steps: int | Value, stride: int) -> int | Value:
    """Return an index advanced by a number of strides."""
    if not isinstance(steps, Value) and not isinstance(first, Value):
        return first + int(steps) * stride
    offset = code.arithmetic("mul", _whole(code, steps), code.constant(stride, "l"))
    return _plain(code.arithmetic("add", _whole(code, first), offset))


def _whole(code: Code, number: int | Value) -> Value:
    return code.converted(number, "l") if isinstance(number, Value) else code.constant(number, "l")


def _plain(value: Value) -> int | Value:
    return value if value.constant is None else int(value.constant)


def views_of(code: Code, array: Stored, views: Callable[[np.ndarray], Sequence[np.ndarray]]) -> list[Stored]:
    """Return the views that a function of a NumPy array, with one byte for each number, returns."""
    byte_array, origin = as_strided(ORIGIN, array.shape, array.strides), address_of(ORIGIN)
    return [
        Stored(array.region, view.shape, view.strides, further(code, array.first, address_of(view) - origin, 1))
        for view in views(byte_array)
    ]


def part_at(code: Code, array: Stored, index: int | Value) -> Stored:
    """Return the part of an array at an index of its first axis."""
    first = further(code, array.first, index, array.strides[0])
    return Stored(array.region, array.shape[1:], array.strides[1:], first)


def between(code: Code, array: Stored, axis: int, start: int | Value, size: int, step: int = 1) -> Stored:
    """Return `size` numbers along an axis from an index on, with a step."""
    shape, strides = list(array.shape), list(array.strides)
    first = further(code, array.first, start, strides[axis])
    shape[axis], strides[axis] = size, strides[axis] * step
    return Stored(array.region, tuple(shape), tuple(strides), first)


def transposed(array: Stored, axes: Sequence[int]) -> Stored:
    """Return an array with its axes in another order."""
    return replace(array, shape=tuple(array.shape[k] for k in axes), strides=tuple(array.strides[k] for k in axes))


def spread(array: Stored, shape: Sequence[int], axes: Sequence[int]) -> Stored:
    """Return an array broadcast along new axes and those of length one; `axes` are the places of its own axes."""
    strides = [0] * len(shape)
    for axis, size, stride in zip(axes, array.shape, array.strides, strict=True):
        strides[axis] = stride if size == shape[axis] else 0
    return replace(array, shape=tuple(shape), strides=tuple(strides))


def merged(shape: Sequence[int], strides: Sequence[Sequence[int]]) -> tuple[list[int], list[list[int]]]:
    """Return axes without those of length one, with neighbors merged that are contiguous in all arrays."""
    sizes: list[int] = []
    steps: list[list[int]] = [[] for _ in strides]
    for k, size in enumerate(shape):
        if size == 1:
            continue
        axis_strides = [s[k] for s in strides]
        if sizes and all(step[-1] == size * stride for step, stride in zip(steps, axis_strides, strict=True)):
            sizes[-1] *= size
            for step, stride in zip(steps, axis_strides, strict=True):
                step[-1] = stride
            continue
        sizes.append(size)
        for step, stride in zip(steps, axis_strides, strict=True):
            step.append(stride)
    return sizes, steps


def divided(sizes: Sequence[int], strides: Sequence[Sequence[int]], shape: Sequence[int]) -> tuple[int, ...] | None:
    """Return the strides of merged axes split to another shape; None if there are none."""
    result, axes, remaining, stride = [], list(zip(sizes, strides[0], strict=True)), 1, 0
    for size in reversed(shape):
        if size == 1:
            result.append(0)
            continue
        if remaining == 1:
            remaining, stride = axes.pop()
        if remaining % size:
            return None
        result.append(stride)
        remaining, stride = remaining // size, stride * size
    return tuple(reversed(result))


def in_shape(array: Stored, shape: Sequence[int]) -> Stored | None:
    """Return the same numbers in another shape; None if there are no strides for it."""
    strides = divided(*merged(array.shape, [array.strides]), shape) if array.size else None
    return None if strides is None else replace(array, shape=tuple(shape), strides=strides)
