"""Loads and stores of arrays in memory, and loops over such arrays.

A loop handles one number of each array, or a vector of contiguous numbers.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from jounce.execution.llvm.text.arrays import Values, filled, in_memory
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.values import Region, Value, kind_of
from jounce.execution.llvm.text.views import (
    Array,
    Deferred,
    InMemory,
    Stored,
    as_read,
    contiguous,
    further,
    in_shape,
    merged,
    part_at,
    spread,
)


def new_storage(code: Code, shape: Sequence[int], kind: str, *, lanes: bool) -> Stored:
    """Return a new uninitialized array in memory."""
    return contiguous(code.taken_room(math.prod(shape), kind, lanes=lanes), shape)


def is_own(code: Code, array: Stored) -> bool:
    """Return whether an array may be changed in place: it is the only array in its memory, and nothing reads it."""
    return (
        array.region in code.changeable
        and array.is_same(contiguous(array.region, array.shape))
        and code.is_unshared(array.region)
    )


def is_large(code: Code, array: Any) -> bool:
    """Return whether an array is large enough to stay in memory."""
    return code.large is not None and math.prod(array.shape) > code.large


def any_lanes(arrays: Sequence[Array]) -> bool:
    """Return whether the numbers of any array differ from lane to lane."""
    return any(x.lanes if isinstance(x, InMemory) else any(v.lanes for v in flat(x)) for x in arrays)


def kind_in(array: Array) -> str:
    """Return the kind of the numbers of a nonempty array."""
    return array.kind if isinstance(array, InMemory) else flat(array)[0].kind


def result_storage(code: Code, equation: Any, given: Sequence[Array]) -> Stored:
    """Return memory for the result of an operation."""
    aval = equation.outvars[0].aval
    return new_storage(code, aval.shape, kind_of(aval.dtype), lanes=any_lanes(given))


# -- views ------------------------------------------------------------------------------------------------------------


def row(code: Code, array: Array, index: int | Value) -> Array:
    """Return the part of an array at an index of its first axis; a computed index needs an array in memory."""
    if isinstance(array, np.ndarray):
        assert isinstance(index, int)
        return array[index, ...]
    return settled(code, part_at(code, stored(code, array), index))


def reshaped(code: Code, array: Stored, shape: Sequence[int]) -> Stored:
    """Return the same numbers in another shape, copied if there are no strides for it."""
    result = in_shape(array, shape)
    return contiguous(copied(code, array).region, shape) if result is None else result


# -- numbers and memory -----------------------------------------------------------------------------------------------


def values_of(code: Code, array: Array) -> Values:
    """Return an array as single values."""
    if isinstance(array, Deferred):
        parts = [flat(values_of(code, part)) for part in array.given]
        return filled(array.shape, [array.body(numbers) for numbers in zip(*parts, strict=True)])
    if not isinstance(array, Stored):
        return array
    indices = [
        further(code, array.first, int(np.dot(index, array.strides)), 1) if array.ndim else array.first
        for index in np.ndindex(*array.shape)
    ]
    return filled(array.shape, [without_home(code.load(array.region, position)) for position in indices])


def without_home(value: Value) -> Value:
    """Return a value detached from its memory, which may change."""
    value.home = None
    return value


def stored(code: Code, array: Array) -> Stored:
    """Return an array in memory; store it if it is not there yet, with repeated parts stored once."""
    if isinstance(array, Stored):
        return array
    if isinstance(array, Deferred):
        return copied(code, array)
    if not array.size:
        return contiguous(Region("null", "f", False), array.shape)
    repeated = [size > 1 and stride == 0 for size, stride in zip(array.shape, array.strides, strict=True)]
    part = array[(*(slice(0, 1) if r else slice(None) for r in repeated), ...)]
    values = flat(part)
    if all(value.constant is not None for value in values):
        table = np.array([value.constant for value in values])
        if len(values) > 1 and len({number.tobytes() for number in table}) == 1:
            element = contiguous(code.constants_region([table[0]], values[0].kind), ())
            return spread(element, array.shape, ())
        region, first = code.constants_region([v.constant for v in values], values[0].kind), 0
    else:
        region, first = in_memory(code, values)
    return spread(contiguous(region, part.shape, first), array.shape, range(array.ndim))


def settled(code: Code, array: Array) -> Array:
    """Return a small array as single values, and a large one unchanged."""
    return array if is_large(code, array) else values_of(code, array)


def copied(code: Code, array: Array) -> Stored:
    """Return a contiguous copy of an array in its own memory."""
    result = new_storage(code, array.shape, kind_in(array), lanes=any_lanes([array]))
    put(code, result, array)
    return result


def put(code: Code, target: Stored, array: Array) -> None:
    """Emit the store of an array into another one; it may read from that only the numbers that it replaces."""
    if not target.size:
        return
    if not isinstance(array, InMemory) and is_large(code, array):
        array = stored(code, array)
    if isinstance(array, InMemory):
        read = array if isinstance(array, Deferred) else as_read(array)
        in_place = any(part.region == target.region for part in read.given)  # then visit each number once
        nest(code, read.given, [target], lambda values: [read.body(values)], adds=in_place)
        return
    for index, value in zip(np.ndindex(*target.shape), flat(array), strict=True):
        position = further(code, target.first, int(np.dot(index, target.strides)), 1) if target.ndim else target.first
        code.store(target.region, position, value)


def fill(code: Code, target: Stored, number: Value) -> None:
    """Emit the store of one number into all elements of an array."""
    put(code, target, spread(stored(code, filled((), [number])), target.shape, ()))


# -- loops ------------------------------------------------------------------------------------------------------------

Body = Callable[[list[Value]], Sequence[Value]]
Visit = Callable[[int | Value], None]  # emits code from an index on


def counted(code: Code, count: int, body: Callable[[int | Value], None]) -> None:
    """Emit a loop with `count` iterations."""
    if count <= 1:
        if count:
            body(0)
        return
    before, head, latch, end = (code.label() for _ in range(4))
    index, next_index = code.fresh("i"), code.fresh("i")
    code.jump(before)
    code.begin(before)
    code.jump(head)
    code.begin(head)
    code.lines.append(f"{index} = phi i64 [0, %{before}], [{next_index}, %{latch}]")
    with code.scope():
        body(Value(index, "l", False))
    code.jump(latch)
    code.begin(latch)
    is_last = code.fresh()
    code.lines.append(f"{next_index} = add nuw nsw i64 {index}, 1")
    code.lines.append(f"{is_last} = icmp eq i64 {next_index}, {count}")
    code.branch(is_last, end, head)
    code.begin(end)


def nest(code: Code, given: Sequence[Stored], result: Sequence[Stored], body: Body, *, adds: bool = False) -> None:
    """Emit loops over arrays of one shape.

    Parameters
    ----------
    code : Code
    given, result : sequence of Stored
        Arrays that are read and written.
    body : callable
        Function from the numbers read to those written.
    adds : bool, default False
        Whether written numbers depend on previous ones, so that no element may be visited twice.
    """
    arrays = [*given, *result]
    shape, strides = merged(arrays[0].shape, [array.strides for array in arrays])
    if 0 in shape:
        return

    def run(axes: Sequence[int], indices: Sequence[int | Value]) -> None:
        if not axes:
            _visit(code, given, result, body, indices)
            return
        axis, *inner_axes = axes
        size, steps = shape[axis], [s[axis] for s in strides]

        def moved(k: int | Value) -> list[int | Value]:
            return [further(code, index, k, step) for index, step in zip(indices, steps, strict=True)]

        if inner_axes or not code.single or size < code.width or not _is_along(steps, len(given)):
            counted(code, size, lambda k: run(inner_axes, moved(k)))
            return
        unit_strides = [step == 1 for step in steps]
        single = (lambda k: _visit(code, given, result, body, moved(k))) if adds else None
        _in_vectors(code, size, lambda k: _visit(code, given, result, body, moved(k), unit_strides), single)

    run(_order(shape, strides, len(given)), [array.first for array in arrays])


def _visit(
    code: Code,
    given: Sequence[Stored],
    result: Sequence[Stored],
    body: Body,
    indices: Sequence[int | Value],
    unit_strides: Sequence[bool] | None = None,
) -> None:
    """Emit the body at one index of each array, or for a vector of numbers from the index on in some arrays."""
    unit_strides = [False] * len(indices) if unit_strides is None else unit_strides
    read = [
        code.load_along(array.region, index) if vector else without_home(code.load(array.region, index))
        for array, index, vector in zip(given, indices, unit_strides, strict=False)
    ]
    count = len(given)
    for array, index, vector, value in zip(result, indices[count:], unit_strides[count:], body(read), strict=True):
        (code.store_along if vector else code.store)(array.region, index, value)


def _in_vectors(code: Code, size: int, vector: Visit, single: Visit | None) -> None:
    """Emit a loop of vectors over at least one vector of numbers.

    Parameters
    ----------
    code : Code
    size : int
        Count of the numbers.
    vector : callable
        Emits the code for a vector of numbers from an index on.
    single : callable or None
        Emits the code for each remaining number; None if the last vector may overlap the one before.
    """
    count, remainder = divmod(size, code.width)
    if remainder and single is None:

        def last(k: int | Value) -> None:
            start, last_start = further(code, 0, k, code.width), size - code.width
            if isinstance(start, Value):
                vector(code.arithmetic("min", start, code.constant(last_start, "l")))
            else:
                vector(min(start, last_start))

        counted(code, count + 1, last)
        return
    counted(code, count, lambda k: vector(further(code, 0, k, code.width)))
    if single is not None:
        counted(code, remainder, lambda k: single(further(code, count * code.width, k, 1)))


def _is_along(steps: Sequence[int], given: int) -> bool:
    """Return whether the numbers along an axis are contiguous, or repeated in an array that is only read."""
    return set(steps) <= {0, 1} and 0 not in steps[given:]


def _order(shape: Sequence[int], strides: Sequence[Sequence[int]], given: int) -> list[int]:
    """Return the axes with that of the innermost loop last: contiguous numbers, with writes to different elements."""
    if not shape:
        return []

    def rank(axis: int) -> tuple[bool, bool, int]:
        steps = [s[axis] for s in strides]
        return _is_along(steps, given), 0 not in steps[given:], axis

    inner = max(range(len(shape)), key=rank)
    return [*(axis for axis in range(len(shape)) if axis != inner), inner]
