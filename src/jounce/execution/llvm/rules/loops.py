"""JAX's operations on arrays that stay in memory: views where numbers keep their places, and loops elsewhere."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from jax.lax import GatherScatterMode

from jounce.execution.llvm.rules.indexing import clamped_starts, filler, within
from jounce.execution.llvm.rules.loops_along_axes import REDUCTIONS, StoredRule, dot, extreme
from jounce.execution.llvm.rules.operations import ELEMENTWISE, RULES
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


MOST_READ = 16  # arrays, of which a number each is in registers at once


def _each(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Return the results of an operation on each number: its rule for single values, where they are used."""
    rule, aval = RULES[equation.primitive.name], equation.outvars[0].aval
    size = math.prod(aval.shape)  # an operand that is repeated is computed once
    operands = [x if isinstance(x, Deferred) and x.size == size else as_read(stored(code, x)) for x in given]
    while sum(len(operand.given) for operand in operands) > MOST_READ:
        longest = max(range(len(operands)), key=lambda k: len(operands[k].given))
        operands[longest] = as_read(stored(code, operands[longest]))
    read: list[Stored] = []
    indices = [[_index_among(read, part, aval.shape) for part in operand.given] for operand in operands]

    def body(values: Sequence[Value]) -> Value:
        numbers = [x.body([values[k] for k in its]) for x, its in zip(operands, indices, strict=True)]
        return rule(code, equation, [filled((), [number]) for number in numbers])[0].item()

    return [Deferred(tuple(read), kind_of(aval.dtype), body, any(operand.parts for operand in operands))]


def _index_among(arrays: list[Stored], array: Stored, shape: Sequence[int]) -> int:
    """Return the place of an array, in a shape, among some, to which it is added if it is none of them."""
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
    """Return the rule for an operation that gives views of an array, as that for single values gives them."""

    def moved(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
        def views(array: Stored) -> list[Stored]:
            return views_of(code, array, lambda whole: rule(code, equation, [whole]))

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
    """Return a part of an array, moved so that all of it is in bounds."""
    indices = clamped_starts(code, array.shape, sizes, [values_of(code, start) for start in starts])
    for axis, (index, size) in enumerate(zip(indices, sizes, strict=True)):
        array = between(code, array, axis, index if index.constant is None else int(index.constant), size)
    return array


# -- arrays made of others --------------------------------------------------------------------------------------------


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
    """Change a part of an array."""
    _, part, *starts = given
    result = _to_change(code, equation, given)
    target = _window(code, result, part.shape, starts)
    put(code, target, _disjoint(code, part, result) if isinstance(part, InMemory) else part)
    return [result]


def _to_change(code: Code, equation: Any, given: Sequence[Array]) -> Stored:
    """Return the first of some arrays, for the others to change it: in its place where nobody else reads it."""
    array, *others = given
    if isinstance(array, Stored) and is_own(code, array) and (array.lanes or not any_lanes(others)):
        return array
    result = result_storage(code, equation, given)
    put(code, result, array)
    return result


def _disjoint(code: Code, array: InMemory, changed: Stored) -> InMemory:
    """Return an array that stays as it is while another one is changed: copied if it may be a part of that."""
    read = array.given if isinstance(array, Deferred) else [array]
    return copied(code, array) if any(x.region is changed.region for x in read) else array


# -- at indices -------------------------------------------------------------------------------------------------------


def _placed(
    code: Code,
    p: Any,
    array: Stored,
    rows: Stored,
    numbers: Mapping[int, int],
    sizes: Sequence[int],
    batch: Sequence[int | Value],
) -> tuple[int | Value, Value]:
    """Return the place of the first number of a window, moved into the array, and whether it was there already.

    Parameters
    ----------
    rows : Stored
        Indices, of which the last axis are those of a window.
    numbers : mapping
        Of the axes of the array for which there are indices, to their places among them.
    sizes : sequence of int
        Of a window, for each axis of the array.
    batch : sequence
        Which window it is.
    """
    position, inside = array.first, code.constant(True)
    for axis, size in enumerate(array.shape):
        if axis not in numbers:
            continue
        where = _at(code, rows, range(rows.ndim), (*batch, numbers[axis]), rows.first)
        index = code.converted(without_home(code.load(rows.region, where)), "l")
        remaining = within(code, index, 0, size - sizes[axis])
        inside = code.logic("and", inside, code.compare("eq", remaining, index))
        position = further(code, position, remaining, array.strides[axis])
    return position, inside if p["mode"] == GatherScatterMode.FILL_OR_DROP else code.constant(True)


def _at(
    code: Code, array: Stored, axes: Sequence[int], which: Sequence[int | Value], first: int | Value
) -> int | Value:
    """Return the place from `first` on to the indices of some axes of an array."""
    for axis, index in zip(axes, which, strict=True):
        first = further(code, first, index, array.strides[axis])
    return first


def _windows(
    code: Code, shape: Sequence[int], body: Callable[[list[int | Value]], None], before: Sequence[int | Value] = ()
) -> None:
    """Write loops over the windows of an array."""
    if not shape:
        body(list(before))
        return
    counted(code, shape[0], lambda k: _windows(code, shape[1:], body, (*before, k)))


def _gather(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Return parts of an array at indices."""
    p, array, indices = equation.params, stored(code, given[0]), stored(code, given[1])
    numbers, aval = p["dimension_numbers"], equation.outvars[0].aval
    result = new_storage(code, aval.shape, kind_of(aval.dtype), lanes=array.lanes or indices.lanes)
    offsets = list(numbers.offset_dims)
    batch = [axis for axis in range(result.ndim) if axis not in offsets]
    left_out = *numbers.collapsed_slice_dims, *numbers.operand_batching_dims
    taken = [axis for axis in range(array.ndim) if axis not in left_out]
    sizes, named = p["slice_sizes"], {int(axis): k for k, axis in enumerate(numbers.start_index_map)}
    beyond = stored(code, filled((), [code.constant(filler(p, aval.dtype), result.kind)]))

    def window(which: list[int | Value]) -> None:
        first, inside = _placed(code, p, array, indices, named, sizes, which)
        batching = [which[k] for k in numbers.start_indices_batching_dims]
        first = _at(code, array, [*map(int, numbers.operand_batching_dims)], batching, first)
        source = Stored(array.region, tuple(sizes[a] for a in taken), tuple(array.strides[a] for a in taken), first)
        start = _at(code, result, batch, which, result.first)
        target = Stored(result.region, source.shape, tuple(result.strides[a] for a in offsets), start)
        if inside.constant is not None:
            put(code, target, source)
            return
        other = spread(beyond, source.shape, ())
        nest(code, [source, other], [target], lambda values: [code.select(inside, *values)])

    if array.size:
        _windows(code, [result.shape[axis] for axis in batch], window)
    else:
        put(code, result, spread(beyond, result.shape, ()))
    return [result]


def _scatter(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Put numbers at indices, or add them to what is there."""
    result = _to_change(code, equation, given)
    indices, updates = (stored(code, _disjoint(code, stored(code, array), result)) for array in given[1:])
    p, add = equation.params, equation.primitive.name == "scatter-add"
    numbers = p["dimension_numbers"]
    if not updates.size or not result.size:
        return [result]
    windows = list(numbers.update_window_dims)
    batch = [axis for axis in range(updates.ndim) if axis not in windows]
    left_out = *numbers.inserted_window_dims, *numbers.operand_batching_dims
    remaining = [axis for axis in range(result.ndim) if axis not in left_out]
    sizes = [1] * result.ndim
    for axis, of in zip(remaining, windows, strict=True):
        sizes[axis] = updates.shape[of]
    named = {int(axis): k for k, axis in enumerate(numbers.scatter_dims_to_operand_dims)}

    def window(which: list[int | Value]) -> None:
        first, inside = _placed(code, p, result, indices, named, sizes, which)
        batching = [which[k] for k in numbers.scatter_indices_batching_dims]
        first = _at(code, result, [*map(int, numbers.operand_batching_dims)], batching, first)
        shape, strides = (tuple(its[a] for a in remaining) for its in (sizes, result.strides))
        target = Stored(result.region, shape, strides, first)
        start = _at(code, updates, batch, which, updates.first)
        source = Stored(updates.region, target.shape, tuple(updates.strides[a] for a in windows), start)

        def body(values: Sequence[Value]) -> Sequence[Value]:
            old, value = values
            changed = code.arithmetic("add", old, value) if add else value
            return [code.select(inside, changed, old)]

        nest(code, [target, source], [target], body, adds=True)

    _windows(code, [updates.shape[axis] for axis in batch], window)
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
"""Rules for operations of which an array is large; of others, the numbers are taken out of memory."""

DEFERRED = frozenset((*ELEMENTWISE, "broadcast_in_dim", "reshape", "squeeze", "expand_dims", "transpose"))
"""Operations whose numbers may be computed where they are used."""

READING = frozenset(("concatenate", "stack", "dynamic_update_slice", *REDUCTIONS))
"""Others that read a number of an array once."""
