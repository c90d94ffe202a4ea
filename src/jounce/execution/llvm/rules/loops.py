"""Rules of JAX operations for arrays in memory: views if numbers keep their places, otherwise loops."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from jounce.execution.llvm.rules.indexing import clamped_starts, filler, within
from jounce.execution.llvm.rules.loops_along_axes import REDUCTIONS, StoredRule, dot, extreme
from jounce.execution.llvm.rules.operations import ELEMENTWISE, RULES
from jounce.execution.llvm.rules.windows import Windows, windows_of
from jounce.execution.llvm.text.arrays import Rule, filled
from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.stored import (
    any_lanes,
    copied,
    counted,
    fill,
    is_own,
    nest,
    new_storage,
    put,
    reshaped,
    result_storage,
    stored,
    values_of,
    without_home,
)
from jounce.execution.llvm.text.values import Value, kind_of
from jounce.execution.llvm.text.views import (
    Array,
    Deferred,
    InMemory,
    Stored,
    as_read,
    between,
    further,
    part_at,
    spread,
    transposed,
    views_of,
)

# -- number by number -------------------------------------------------------------------------------------------------


MOST_READ = 16  # arrays that a loop body reads, one number each


def _each(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Return the result of an elementwise operation, computed where it is used by the rule for single values."""
    rule, aval = RULES[equation.primitive.name], equation.outvars[0].aval
    size = math.prod(aval.shape)  # an operand that is repeated is computed once
    operands = [x if isinstance(x, Deferred) and x.size == size else as_read(stored(code, x)) for x in given]
    while sum(len(operand.given) for operand in operands) > MOST_READ:
        longest = max(range(len(operands)), key=lambda k: len(operands[k].given))
        operands[longest] = as_read(stored(code, operands[longest]))
    read: list[Stored] = []
    indices = [[_index_among(read, part, aval.shape) for part in operand.given] for operand in operands]

    def body(values: Sequence[Value]) -> Value:
        numbers = [x.body([values[k] for k in members]) for x, members in zip(operands, indices, strict=True)]
        return rule(code, equation, [filled((), [number]) for number in numbers])[0].item()

    return [Deferred(tuple(read), kind_of(aval.dtype), body, any(operand.parts for operand in operands))]


def _index_among(arrays: list[Stored], array: Stored, shape: Sequence[int]) -> int:
    """Return the index of an array, broadcast to a shape, in a list of arrays; append it if it is not in the list."""
    array = spread(array, shape, range(array.ndim) if array.ndim else ())
    for index, other in enumerate(arrays):
        if other.is_same(array):
            return index
    arrays.append(array)
    return len(arrays) - 1


def _same(_: Code, __: Any, given: Sequence[Array]) -> Sequence[Array]:
    return given


# -- views ------------------------------------------------------------------------------------------------------------


def _moved(rule: Rule) -> StoredRule:
    """Return the rule for an operation that returns views of an array, from its rule for single values."""

    def moved(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
        def views(array: Stored) -> list[Stored]:
            return views_of(code, array, lambda values: rule(code, equation, [values]))

        (array,) = given
        if isinstance(array, Deferred) and array.size == equation.outvars[0].aval.size:
            return [array.viewed(lambda x: views(x)[0])]
        return views(stored(code, array))

    return moved


def _reshape(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    array, shape = given[0], equation.outvars[0].aval.shape
    if isinstance(array, Deferred) and (result := array.in_shape(shape)) is not None:
        return [result]
    return [reshaped(code, stored(code, array), shape)]


def _dynamic_slice(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    array, *starts = given
    return [_window(code, stored(code, array), equation.params["slice_sizes"], starts)]


def _window(code: Code, array: Stored, sizes: Sequence[int], starts: Sequence[Array]) -> Stored:
    """Return a part of an array, clamped so that it is in bounds."""
    indices = clamped_starts(code, array.shape, sizes, [values_of(code, start) for start in starts])
    for axis, (index, size) in enumerate(zip(indices, sizes, strict=True)):
        array = between(code, array, axis, index if index.constant is None else int(index.constant), size)
    return array


# -- arrays combined from others --------------------------------------------------------------------------------------


def _concatenate(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    result, axis, start = result_storage(code, equation, given), int(equation.params["dimension"]), 0
    for array in given:
        put(code, between(code, result, axis, start, array.shape[axis]), array)
        start += array.shape[axis]
    return [result]


def _stack(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    result, axis = result_storage(code, equation, given), int(equation.params["axis"])
    rows = transposed(result, [axis, *(k for k in range(result.ndim) if k != axis)])
    for k, array in enumerate(given):
        put(code, part_at(code, rows, k), array)
    return [result]


def _tile(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    array, times = stored(code, given[0]), equation.params["reps"]
    shape = [n for pair in zip(times, array.shape, strict=True) for n in pair]
    repeated = spread(array, shape, range(1, len(shape), 2))
    return [reshaped(code, repeated, equation.outvars[0].aval.shape)]


def _pad(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    array, result = stored(code, given[0]), result_storage(code, equation, given)
    fill(code, result, values_of(code, given[1]).item())
    target = result
    for axis, (low, _, between_) in enumerate(tuple(map(int, sizes)) for sizes in equation.params["padding_config"]):
        step = between_ + 1
        before = max(0, -(low // step)) if low < 0 else 0  # of the array, beyond the beginning
        start = low + before * step
        size = max(0, min(array.shape[axis] - before, -(-(result.shape[axis] - start) // step)))
        array = between(code, array, axis, before, size)
        target = between(code, target, axis, start, size, step)
    put(code, target, array)
    return [result]


def _dynamic_update_slice(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Return an array with a part replaced."""
    _, part, *starts = given
    result = _to_change(code, equation, given)
    target = _window(code, result, part.shape, starts)
    put(code, target, _disjoint(code, part, result) if isinstance(part, InMemory) else part)
    return [result]


def _to_change(code: Code, equation: Any, given: Sequence[Array]) -> Stored:
    """Return the first array for changes by the others: in place if nothing else reads it, otherwise a copy."""
    array, *others = given
    if isinstance(array, Stored) and is_own(code, array) and (array.lanes or not any_lanes(others)):
        return array
    result = result_storage(code, equation, given)
    put(code, result, array)
    return result


def _disjoint(code: Code, array: InMemory, changed: Stored) -> InMemory:
    """Return an array that stays unchanged while another one is changed: a copy if it may overlap that."""
    read = array.given if isinstance(array, Deferred) else [array]
    return copied(code, array) if any(x.region is changed.region for x in read) else array


# -- at computed indices ----------------------------------------------------------------------------------------------


def _window_at(
    code: Code, windows: Windows, array: Stored, indices: Stored, window: Sequence[int | Value]
) -> tuple[Stored, Value]:
    """Return a window clamped into an array, and whether it was inside or is clamped by definition."""
    first, inside = array.first, code.constant(True)
    for k, axis in enumerate(windows.named):
        position = _at(code, indices, range(indices.ndim), (*window, k), indices.first)
        index = code.converted(without_home(code.load(indices.region, position)), "l")
        remaining = within(code, index, 0, array.shape[axis] - windows.sizes[axis])
        inside = code.logic("and", inside, code.compare("eq", remaining, index))
        first = further(code, first, remaining, array.strides[axis])
    first = _at(code, array, [*windows.batching], [window[k] for k in windows.batching.values()], first)
    shape, strides = (tuple(values[axis] for axis in windows.remaining) for values in (windows.sizes, array.strides))
    return Stored(array.region, shape, strides, first), inside if windows.drop else code.constant(True)


def _part_of(code: Code, windows: Windows, array: Stored, window: Sequence[int | Value]) -> Stored:
    """Return the part of the array of all windows that belongs to one window."""
    first = _at(code, array, windows.batch, window, array.first)
    shape, strides = (tuple(values[k] for k in windows.offsets) for values in (array.shape, array.strides))
    return Stored(array.region, shape, strides, first)


def _at(
    code: Code, array: Stored, axes: Sequence[int], indices: Sequence[int | Value], first: int | Value
) -> int | Value:
    """Return the position at indices along some axes of an array, from the position `first`."""
    for axis, index in zip(axes, indices, strict=True):
        first = further(code, first, index, array.strides[axis])
    return first


def _each_window(
    code: Code, shape: Sequence[int], body: Callable[[list[int | Value]], None], before: Sequence[int | Value] = ()
) -> None:
    """Emit loops over the windows of an array."""
    if not shape:
        body(list(before))
        return
    counted(code, shape[0], lambda k: _each_window(code, shape[1:], body, (*before, k)))


def _gather(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Return parts of an array at indices."""
    array, indices, windows = stored(code, given[0]), stored(code, given[1]), windows_of(equation)
    aval = equation.outvars[0].aval
    result = new_storage(code, aval.shape, kind_of(aval.dtype), lanes=array.lanes or indices.lanes)
    fill_value = stored(code, filled((), [code.constant(filler(equation.params, aval.dtype), result.kind)]))

    def window(index: list[int | Value]) -> None:
        source, inside = _window_at(code, windows, array, indices, index)
        target = _part_of(code, windows, result, index)
        if inside.constant is not None:
            put(code, target, source)
            return
        other = spread(fill_value, source.shape, ())
        nest(code, [source, other], [target], lambda values: [code.select(inside, *values)])

    if array.size:
        _each_window(code, [result.shape[axis] for axis in windows.batch], window)
    else:
        put(code, result, spread(fill_value, result.shape, ()))
    return [result]


def _scatter(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Return an array with numbers replaced at indices, or increased by the updates."""
    result = _to_change(code, equation, given)
    indices, updates = (stored(code, _disjoint(code, stored(code, array), result)) for array in given[1:])
    windows, add = windows_of(equation), equation.primitive.name == "scatter-add"
    if not updates.size or not result.size:
        return [result]

    def window(index: list[int | Value]) -> None:
        target, inside = _window_at(code, windows, result, indices, index)

        def body(values: Sequence[Value]) -> Sequence[Value]:
            old, value = values
            new = code.arithmetic("add", old, value) if add else value
            return [code.select(inside, new, old)]

        nest(code, [target, _part_of(code, windows, updates, index)], [target], body, adds=True)

    _each_window(code, [updates.shape[axis] for axis in windows.batch], window)
    return [result]


STORED: Mapping[str, StoredRule] = {
    **dict.fromkeys(ELEMENTWISE, _each),
    **dict.fromkeys(("copy", "stop_gradient", "optimization_barrier"), _same),
    **REDUCTIONS,
    **dict.fromkeys(("argmax", "argmin"), extreme),
    **dict.fromkeys(("reshape", "squeeze", "expand_dims"), _reshape),
    **dict.fromkeys(("scatter", "scatter-add"), _scatter),
    "dot_general": dot,
    **{name: _moved(RULES[name]) for name in ("slice", "broadcast_in_dim", "transpose", "rev", "split", "unstack")},
    "tile": _tile,
    "concatenate": _concatenate,
    "stack": _stack,
    "pad": _pad,
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
}
"""Rules for operations with large arrays; other operations load all numbers from memory."""

DEFERRED = frozenset((*ELEMENTWISE, "broadcast_in_dim", "reshape", "squeeze", "expand_dims", "transpose"))
"""Operations whose numbers may be computed where they are used."""

READING = frozenset(("concatenate", "stack", "dynamic_update_slice", *REDUCTIONS))
"""Other operations that read each number of an array once."""
