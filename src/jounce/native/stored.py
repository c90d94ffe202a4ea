"""Arrays that stay in memory, where they are too large to be single values, and loops over them.

Parts, transposes and repetitions of such an array are views, as in NumPy: where numbers begin, and how far apart they
lie. A loop takes a number of each array, or as many as a vector has where they lie one after another.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jounce.native.arrays import Values, filled, in_memory
from jounce.native.code import Code, flat
from jounce.native.values import Region, Value, kind_of


@dataclass(frozen=True, eq=False)
class Stored:
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
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of numbers."""
        return math.prod(self.shape)

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


Array = Values | Stored


def contiguous(region: Region, shape: Sequence[int], first: int | Value = 0) -> Stored:
    """Return an array whose numbers lie one after another, the last axis fastest."""
    ends = np.cumprod([1, *shape[:0:-1]]) if len(shape) else []
    return Stored(region, tuple(shape), tuple(int(x) for x in ends[::-1]), first)


def room_for(code: Code, shape: Sequence[int], kind: str, *, lanes: bool) -> Stored:
    """Return an array of which nothing is known yet."""
    return contiguous(code.taken_room(math.prod(shape), kind, lanes=lanes), shape)


def is_own(code: Code, array: Stored) -> bool:
    """Tell whether an array may be changed in its place: it is all that is there, and nobody else reads it."""
    return (
        array.region in code.changeable
        and array.is_same(contiguous(array.region, array.shape))
        and code.is_unshared(array.region)
    )


def is_large(code: Code, array: Any) -> bool:
    """Tell whether an array belongs in memory."""
    return code.large is not None and math.prod(array.shape) > code.large


def any_lanes(arrays: Sequence[Array]) -> bool:
    """Tell whether numbers of some array differ from lane to lane."""
    return any(x.lanes if isinstance(x, Stored) else any(v.lanes for v in flat(x)) for x in arrays)


def room_of(code: Code, equation: Any, given: Sequence[Array]) -> Stored:
    """Return room for the result of an operation."""
    aval = equation.outvars[0].aval
    return room_for(code, aval.shape, kind_of(aval.dtype), lanes=any_lanes(given))


# -- views ------------------------------------------------------------------------------------------------------------


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


def between(code: Code, array: Stored, axis: int, start: int | Value, size: int, step: int = 1) -> Stored:
    """Return so many numbers along an axis from an index on."""
    shape, strides = list(array.shape), list(array.strides)
    first = further(code, array.first, start, strides[axis])
    shape[axis], strides[axis] = size, strides[axis] * step
    return Stored(array.region, tuple(shape), tuple(strides), first)


def row(code: Code, array: Array, index: int | Value) -> Array:
    """Return the part of an array at an index of its first axis: an index that is not known wants a stored one."""
    if not isinstance(array, Stored):
        assert isinstance(index, int)
        return array[index, ...]
    part = between(code, array, 0, index, 1)
    return settled(code, replace(part, shape=part.shape[1:], strides=part.strides[1:]))


def transposed(array: Stored, axes: Sequence[int]) -> Stored:
    """Return an array with its axes in another order."""
    return replace(array, shape=tuple(array.shape[k] for k in axes), strides=tuple(array.strides[k] for k in axes))


def spread(array: Stored, shape: Sequence[int], axes: Sequence[int]) -> Stored:
    """Return an array repeated along new axes and those of length one; `axes` are where its own belong."""
    strides = [0] * len(shape)
    for axis, size, stride in zip(axes, array.shape, array.strides, strict=True):
        strides[axis] = stride if size == shape[axis] else 0
    return replace(array, shape=tuple(shape), strides=tuple(strides))


def reshaped(code: Code, array: Stored, shape: Sequence[int]) -> Stored:
    """Return the same numbers in another shape, copied where no strides tell it."""
    strides = _split(*_merged(array.shape, [array.strides]), shape) if array.size else None
    if strides is None:
        return contiguous(copied(code, array).region, shape)
    return replace(array, shape=tuple(shape), strides=strides)


def _split(sizes: Sequence[int], strides: Sequence[Sequence[int]], shape: Sequence[int]) -> tuple[int, ...] | None:
    """Return the strides of axes of other lengths, None where there are none: of axes as `_merged` returns them."""
    found, waiting, left, stride = [], list(zip(sizes, strides[0], strict=True)), 1, 0
    for size in reversed(shape):
        if size == 1:
            found.append(0)
            continue
        if left == 1:
            left, stride = waiting.pop()
        if left % size:
            return None
        found.append(stride)
        left, stride = left // size, stride * size
    return tuple(reversed(found))


# -- numbers and memory -----------------------------------------------------------------------------------------------


def values_of(code: Code, array: Array) -> Values:
    """Return an array as single values."""
    if not isinstance(array, Stored):
        return array
    places = [
        further(code, array.first, int(np.dot(index, array.strides)), 1) if array.ndim else array.first
        for index in np.ndindex(*array.shape)
    ]
    return filled(array.shape, [without_home(code.load(array.region, place)) for place in places])


def without_home(value: Value) -> Value:
    """Return a value that is not taken to be where it came from: that may change."""
    value.home = None
    return value


def stored(code: Code, array: Array) -> Stored:
    """Return an array in memory, put there if it is not yet; what is repeated is put there once."""
    if isinstance(array, Stored):
        return array
    if not array.size:
        return contiguous(Region("null", "f", False), array.shape)
    repeated = [size > 1 and stride == 0 for size, stride in zip(array.shape, array.strides, strict=True)]
    part = array[(*(slice(0, 1) if r else slice(None) for r in repeated), ...)]
    values = flat(part)
    if all(value.constant is not None for value in values):
        table = np.array([value.constant for value in values])
        if len(values) > 1 and len({number.tobytes() for number in table}) == 1:
            one = contiguous(code.constants_region([table[0]], values[0].kind), ())
            return spread(one, array.shape, ())
        region, first = code.constants_region([v.constant for v in values], values[0].kind), 0
    else:
        region, first = in_memory(code, values)
    return spread(contiguous(region, part.shape, first), array.shape, range(array.ndim))


def settled(code: Code, array: Stored) -> Array:
    """Return an array as single values where it is small."""
    return array if is_large(code, array) else values_of(code, array)


def copied(code: Code, array: Array) -> Stored:
    """Return an array with a place of its own, its numbers one after another."""
    if isinstance(array, Stored):
        found = room_for(code, array.shape, array.kind, lanes=array.lanes)
    else:
        values = flat(array)
        found = room_for(code, array.shape, values[0].kind, lanes=any(value.lanes for value in values))
    put(code, found, array)
    return found


def put(code: Code, target: Stored, array: Array) -> None:
    """Write an array where another one is, which it does not overlap."""
    if not target.size:
        return
    if not isinstance(array, Stored) and is_large(code, array):
        array = stored(code, array)
    if isinstance(array, Stored):
        nest(code, [array], [target], lambda values: values)
        return
    for index, value in zip(np.ndindex(*target.shape), flat(array), strict=True):
        place = further(code, target.first, int(np.dot(index, target.strides)), 1) if target.ndim else target.first
        code.store(target.region, place, value)


# -- loops ------------------------------------------------------------------------------------------------------------

Body = Callable[[list[Value]], Sequence[Value]]
Visit = Callable[[int | Value], None]  # of the number from which on something is done


def counted(code: Code, count: int, body: Callable[[int | Value], None]) -> None:
    """Write a loop that runs so many times."""
    if count <= 1:
        if count:
            body(0)
        return
    before, head, latch, end = (code.label() for _ in range(4))
    index, following = code.fresh("i"), code.fresh("i")
    code.jump(before)
    code.begin(before)
    code.jump(head)
    code.begin(head)
    code.lines.append(f"{index} = phi i64 [0, %{before}], [{following}, %{latch}]")
    with code.scope():
        body(Value(index, "l", False))
    code.jump(latch)
    code.begin(latch)
    over = code.fresh()
    code.lines.append(f"{following} = add nuw nsw i64 {index}, 1")
    code.lines.append(f"{over} = icmp eq i64 {following}, {count}")
    code.branch(over, end, head)
    code.begin(end)


def nest(code: Code, given: Sequence[Stored], found: Sequence[Stored], body: Body, *, adds: bool = False) -> None:
    """Write loops over arrays of one shape.

    Parameters
    ----------
    code : Code
    given, found : sequence of Stored
        What is read and written.
    body : callable
        Maps numbers of the arrays read to those written.
    adds : bool, default False
        Whether what is written depends on what was there, so that no place may be visited twice.
    """
    arrays = [*given, *found]
    shape, strides = _merged(arrays[0].shape, [array.strides for array in arrays])
    if 0 in shape:
        return

    def run(axes: Sequence[int], places: Sequence[int | Value]) -> None:
        if not axes:
            _visit(code, given, found, body, places)
            return
        axis, *rest = axes
        size, steps = shape[axis], [s[axis] for s in strides]

        def moved(k: int | Value) -> list[int | Value]:
            return [further(code, place, k, step) for place, step in zip(places, steps, strict=True)]

        if rest or not code.alone or size < code.width or not _is_along(steps, len(given)):
            counted(code, size, lambda k: run(rest, moved(k)))
            return
        along = [step == 1 for step in steps]
        single = (lambda k: _visit(code, given, found, body, moved(k))) if adds else None
        _in_vectors(code, size, lambda k: _visit(code, given, found, body, moved(k), along), single)

    run(_order(shape, strides, len(given)), [array.first for array in arrays])


def _visit(
    code: Code,
    given: Sequence[Stored],
    found: Sequence[Stored],
    body: Body,
    places: Sequence[int | Value],
    along: Sequence[bool] | None = None,
) -> None:
    """Write what is done at one place of each array, or for a vector of numbers from there on of some."""
    along = [False] * len(places) if along is None else along
    read = [
        code.load_along(array.region, place) if vector else without_home(code.load(array.region, place))
        for array, place, vector in zip(given, places, along, strict=False)
    ]
    first = len(given)
    for array, place, vector, value in zip(found, places[first:], along[first:], body(read), strict=True):
        (code.store_along if vector else code.store)(array.region, place, value)


def _in_vectors(code: Code, size: int, vector: Visit, single: Visit | None) -> None:
    """Write a loop of vectors over at least as many numbers as one has.

    Parameters
    ----------
    code : Code
    size : int
        Of the numbers.
    vector : callable
        Writes what is done for a vector of numbers, from one on.
    single : callable or None
        Writes what is done for each number that is left after whole vectors; None if the last vector may have some in
        common with the one before.
    """
    whole, left = divmod(size, code.width)
    if left and single is None:

        def last(k: int | Value) -> None:
            start, most = further(code, 0, k, code.width), size - code.width
            if isinstance(start, Value):
                vector(code.arithmetic("min", start, code.constant(most, "l")))
            else:
                vector(min(start, most))

        counted(code, whole + 1, last)
        return
    counted(code, whole, lambda k: vector(further(code, 0, k, code.width)))
    if single is not None:
        counted(code, left, lambda k: single(further(code, whole * code.width, k, 1)))


def _merged(shape: Sequence[int], strides: Sequence[Sequence[int]]) -> tuple[list[int], list[list[int]]]:
    """Return axes without those of length one, neighbours as one where the numbers of all arrays go on."""
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


def _is_along(steps: Sequence[int], given: int) -> bool:
    """Tell whether the numbers along an axis, or one of an array that is only read, make a vector."""
    return set(steps) <= {0, 1} and 0 not in steps[given:]


def _order(shape: Sequence[int], strides: Sequence[Sequence[int]], given: int) -> list[int]:
    """Return the axes, the one of the innermost loop last: where numbers make vectors, and what is written moves on."""
    if not shape:
        return []

    def rank(axis: int) -> tuple[bool, bool, int]:
        steps = [s[axis] for s in strides]
        return _is_along(steps, given), 0 not in steps[given:], axis

    inner = max(range(len(shape)), key=rank)
    return [*(axis for axis in range(len(shape)) if axis != inner), inner]
