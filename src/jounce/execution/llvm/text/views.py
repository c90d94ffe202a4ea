"""Arrays that stay in memory, where they are too large to be single values, as places and strides.

Parts, transposes and repetitions of such an array are views, as in NumPy: where numbers begin, and how far apart they
lie. None of them takes an operation on numbers. Numbers that are used once need not be in memory at all: they are
computed where they are used, from those that are.
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

ORIGIN = np.zeros(1, np.int8)  # where arrays begin whose views are asked for, of numbers that nobody reads


class Shaped:
    """What has a shape as an array of NumPy has."""

    shape: Any

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of numbers."""
        return math.prod(self.shape)


@dataclass(frozen=True, eq=False)
class Stored(Shaped):
    """An array in memory.

    Attributes
    ----------
    region : Region
        Where its numbers are.
    shape, strides : tuple of int
        As those of an array of NumPy; strides count numbers.
    first : int or Value
        Place of the first number, which may differ from lane to lane.
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
        """Tell whether another array is this one."""
        return (
            isinstance(other, Stored)
            and (other.region is self.region and other.shape == self.shape and other.strides == self.strides)
            and (other.first is self.first or (isinstance(self.first, int) and other.first == self.first))
        )


@dataclass(frozen=True, eq=False)
class Deferred(Shaped):
    """An array whose numbers are computed where they are used, which is once.

    Attributes
    ----------
    given : tuple of Stored
        Arrays of its shape, from which it is computed number by number.
    kind : str
        Kind of the numbers.
    body : callable
        Maps numbers of these arrays to one of its own.
    parts : bool, default False
        Whether it makes lanes differ by itself.
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
        """Return a view of it, as one of each array that it is computed from."""
        return replace(self, given=tuple(map(view, self.given)))

    def in_shape(self, shape: Sequence[int]) -> "Deferred | None":
        """Return the same numbers in another shape, None where no strides tell it of some array."""
        result = [in_shape(array, shape) for array in self.given]
        whole = tuple(array for array in result if array is not None)
        return replace(self, given=whole) if len(whole) == len(result) else None


def as_read(array: Stored) -> Deferred:
    """Return an array as one whose numbers are read where they are used."""
    return Deferred((array,), array.kind, lambda values: values[0])


InMemory = Stored | Deferred
Array = Values | InMemory


def contiguous(region: Region, shape: Sequence[int], first: int | Value = 0) -> Stored:
    """Return an array whose numbers lie one after another, the last axis fastest."""
    ends = np.cumprod([1, *shape[:0:-1]]) if len(shape) else []
    return Stored(region, tuple(shape), tuple(int(x) for x in ends[::-1]), first)


def further(code: Code, first: int | Value, steps: int | Value, stride: int) -> int | Value:
    """Return a place so many strides further."""
    if not isinstance(steps, Value) and not isinstance(first, Value):
        return first + int(steps) * stride
    more = code.arithmetic("mul", _whole(code, steps), code.constant(stride, "l"))
    return _plain(code.arithmetic("add", _whole(code, first), more))


def _whole(code: Code, number: int | Value) -> Value:
    return code.converted(number, "l") if isinstance(number, Value) else code.constant(number, "l")


def _plain(value: Value) -> int | Value:
    return value if value.constant is None else int(value.constant)


def views_of(code: Code, array: Stored, views: Callable[[np.ndarray], Sequence[np.ndarray]]) -> list[Stored]:
    """Return what a function of an array of NumPy, one byte a number, gives that returns views of it."""
    whole, begin = as_strided(ORIGIN, array.shape, array.strides), address_of(ORIGIN)
    return [
        Stored(array.region, view.shape, view.strides, further(code, array.first, address_of(view) - begin, 1))
        for view in views(whole)
    ]


def part_at(code: Code, array: Stored, index: int | Value) -> Stored:
    """Return the part of an array at an index of its first axis."""
    first = further(code, array.first, index, array.strides[0])
    return Stored(array.region, array.shape[1:], array.strides[1:], first)


def between(code: Code, array: Stored, axis: int, start: int | Value, size: int, step: int = 1) -> Stored:
    """Return so many numbers along an axis from an index on."""
    shape, strides = list(array.shape), list(array.strides)
    first = further(code, array.first, start, strides[axis])
    shape[axis], strides[axis] = size, strides[axis] * step
    return Stored(array.region, tuple(shape), tuple(strides), first)


def transposed(array: Stored, axes: Sequence[int]) -> Stored:
    """Return an array with its axes in another order."""
    return replace(array, shape=tuple(array.shape[k] for k in axes), strides=tuple(array.strides[k] for k in axes))


def spread(array: Stored, shape: Sequence[int], axes: Sequence[int]) -> Stored:
    """Return an array repeated along new axes and those of length one; `axes` are where its own belong."""
    strides = [0] * len(shape)
    for axis, size, stride in zip(axes, array.shape, array.strides, strict=True):
        strides[axis] = stride if size == shape[axis] else 0
    return replace(array, shape=tuple(shape), strides=tuple(strides))


def merged(shape: Sequence[int], strides: Sequence[Sequence[int]]) -> tuple[list[int], list[list[int]]]:
    """Return axes without those of length one, neighbors as one where the numbers of all arrays go on."""
    sizes: list[int] = []
    steps: list[list[int]] = [[] for _ in strides]
    for k, size in enumerate(shape):
        if size == 1:
            continue
        own = [s[k] for s in strides]
        if sizes and all(step[-1] == size * stride for step, stride in zip(steps, own, strict=True)):
            sizes[-1] *= size
            for step, stride in zip(steps, own, strict=True):
                step[-1] = stride
            continue
        sizes.append(size)
        for step, stride in zip(steps, own, strict=True):
            step.append(stride)
    return sizes, steps


def divided(sizes: Sequence[int], strides: Sequence[Sequence[int]], shape: Sequence[int]) -> tuple[int, ...] | None:
    """Return the strides of axes of other lengths, None where there are none: of axes as `merged` returns them."""
    result, waiting, left, stride = [], list(zip(sizes, strides[0], strict=True)), 1, 0
    for size in reversed(shape):
        if size == 1:
            result.append(0)
            continue
        if left == 1:
            left, stride = waiting.pop()
        if left % size:
            return None
        result.append(stride)
        left, stride = left // size, stride * size
    return tuple(reversed(result))


def in_shape(array: Stored, shape: Sequence[int]) -> Stored | None:
    """Return the same numbers in another shape, None where no strides tell it."""
    strides = divided(*merged(array.shape, [array.strides]), shape) if array.size else None
    return None if strides is None else replace(array, shape=tuple(shape), strides=strides)
