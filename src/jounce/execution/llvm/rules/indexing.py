"""Operations that move elements of arrays, and those that read or write elements at computed indices."""

import itertools
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from jax.lax import GatherScatterMode

from jounce.execution.llvm.rules.windows import windows_of
from jounce.execution.llvm.text.arrays import Values, constants, each, filled, in_memory
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.values import DTYPES, UnsupportedOperationError, Value, kind_of

MOST_CANDIDATES = 64  # elements among which one is selected by comparisons, and not loaded from memory

# -- at constant indices ----------------------------------------------------------------------------------------------


def part(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return elements between bounds."""
    p = equation.params
    strides = p["strides"] or (1,) * given[0].ndim
    return [given[0][(*map(slice, p["start_indices"], p["limit_indices"], strides), ...)]]


def broadcast(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return an array repeated along new axes and those of length one."""
    shape, axes = equation.params["shape"], equation.params["broadcast_dimensions"]
    expanded_shape = [1] * len(shape)
    for axis, size in zip(axes, given[0].shape, strict=True):
        expanded_shape[axis] = size
    return [np.broadcast_to(given[0].reshape(expanded_shape), shape)]


def tile(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return an array repeated along its axes."""
    return [np.tile(given[0], equation.params["reps"])]


def reshape(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return the same elements in another shape."""
    return [given[0].reshape(equation.outvars[0].aval.shape)]


def concatenate(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return arrays one after another."""
    return [np.concatenate(given, equation.params["dimension"])]


def stack(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return arrays side by side along a new axis."""
    return [np.stack(given, equation.params["axis"])]


def unstack(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return the parts of an array along an axis, without it."""
    rows = np.moveaxis(given[0], equation.params["axis"], 0)
    return [rows[k, ...] for k in range(len(rows))]


def transpose(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return an array with its axes in another order."""
    return [given[0].transpose(equation.params["permutation"])]


def reverse(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return an array backwards along some axes."""
    return [np.flip(given[0], equation.params["dimensions"])]


def pad(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return an array padded before, after and between its elements; negative padding removes elements."""
    array, filler = given
    result = np.full(equation.outvars[0].aval.shape, filler.item(), object)
    indices, sources = [], []
    for size, length, (low, _high, gap) in zip(
        array.shape, result.shape, equation.params["padding_config"], strict=True
    ):
        positions = low + np.arange(size) * (gap + 1)
        inside = np.flatnonzero((positions >= 0) & (positions < length))
        indices.append(positions[inside])
        sources.append(inside)
    result[np.ix_(*indices)] = array[np.ix_(*sources)]
    return [result]


def iota(_: Code, equation: Any, __: Sequence[Values]) -> Sequence[Values]:
    """Return whole numbers that count along an axis."""
    p = equation.params
    numbers = np.arange(p["shape"][p["dimension"]]).astype(DTYPES[kind_of(p["dtype"])])
    line = numbers.reshape([-1 if axis == p["dimension"] else 1 for axis in range(len(p["shape"]))])
    return [np.broadcast_to(constants(line), p["shape"])]


def split(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return the parts of an array along an axis."""
    return np.split(given[0], np.cumsum(equation.params["sizes"])[:-1], axis=equation.params["axis"])


# -- at computed indices ----------------------------------------------------------------------------------------------


def _element(code: Code, index: Value, *values: Value) -> Value:
    """Return the number at an index in bounds, loaded from memory or selected by comparisons."""
    if index.constant is not None:
        return values[int(index.constant)]
    if len(values) > (MOST_CANDIDATES if index.lanes else 2):
        region, first = in_memory(code, values)
        position = code.arithmetic("add", code.converted(index, "l"), code.constant(first, "l"))
        return code.load(region, position)
    result = values[-1]
    for k in reversed(range(len(values) - 1)):
        result = code.select(code.compare("eq", index, code.constant(k, index.kind)), values[k], result)
    return result


def _rows(code: Code, array: Values, index: Value, shape: Sequence[int]) -> Values:
    """Return rows of an array from an index in bounds on, the same for all lanes, loaded from memory."""
    region, first = in_memory(code, flat(array))
    start = code.arithmetic("mul", code.converted(index, "l"), code.constant(int(np.prod(array.shape[1:])), "l"))
    offsets = (code.constant(first + k, "l") for k in range(int(np.prod(shape))))
    return filled(shape, [code.load(region, code.arithmetic("add", start, offset)) for offset in offsets])


def within(code: Code, index: Value, low: int, high: int) -> Value:
    """Return an index clamped to bounds."""
    bounded = code.arithmetic("min", index, code.constant(high, index.kind))
    return code.arithmetic("max", bounded, code.constant(low, index.kind))


def clamped_starts(code: Code, shape: Sequence[int], sizes: Sequence[int], starts: Sequence[Values]) -> list[Value]:
    """Return the start of a part of an array along each axis, clamped so that the part is in bounds."""
    return [
        within(code, start.item(), 0, length - size) for length, size, start in zip(shape, sizes, starts, strict=True)
    ]


def dynamic_slice(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return a part of an array from start indices on, clamped so that the part is in bounds."""
    array, *starts = given
    for axis, (start, size) in enumerate(zip(starts, equation.params["slice_sizes"], strict=True)):
        rows = np.moveaxis(array, axis, 0)
        index, shape = within(code, start.item(), 0, len(rows) - size), (size, *rows.shape[1:])
        if index.constant is not None:
            result = rows[int(index.constant) :][:size]
        elif not np.prod(shape):
            result = np.empty(shape, object)
        elif not index.lanes:
            result = _rows(code, rows, index, shape)
        else:
            pick = partial(_element, code, index)
            windows = [rows[k : len(rows) - size + 1 + k] for k in range(size)]
            result = np.stack([each(pick, *(window[k, ...] for k in range(len(window)))) for window in windows])
        array = np.moveaxis(result, 0, axis)
    return [array]


def dynamic_update_slice(code: Code, _: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return an array with a part replaced from start indices on, clamped so that the part is in bounds."""
    array, new, *starts = given
    largest_starts = [length - size for length, size in zip(array.shape, new.shape, strict=True)]
    indices = clamped_starts(code, array.shape, new.shape, starts)
    variable_axes = [axis for axis, index in enumerate(indices) if index.constant is None]
    start_ranges = [
        range(largest + 1) if index.constant is None else (int(index.constant),)
        for index, largest in zip(indices, largest_starts, strict=True)
    ]
    result = array.copy()
    for start in itertools.product(*start_ranges):
        is_target = code.constant(True)
        for axis in variable_axes:
            number = code.constant(start[axis], indices[axis].kind)
            is_target = code.logic("and", is_target, code.compare("eq", indices[axis], number))
        for offset in np.ndindex(new.shape):
            position = tuple(a + b for a, b in zip(start, offset, strict=True))
            result[position] = code.select(is_target, new.item(offset), result.item(position))
    return [result]


def _known(indices: Values) -> tuple[np.ndarray, int | None]:
    """Return indices as numbers, zero if not constant, and the column with indices that are not constant, if any."""
    numbers = np.vectorize(lambda value: 0 if value.constant is None else int(value.constant), otypes=[int])(indices)
    varying = [k for k in range(indices.shape[-1]) if any(value.constant is None for value in flat(indices[..., k]))]
    if len(varying) > 1:
        raise UnsupportedOperationError("indices of which more than one are not known")
    return numbers, varying[0] if varying else None


def _with_column(indices: np.ndarray, column: int, number: int) -> np.ndarray:
    """Return indices with one number in a column."""
    result = indices.copy()
    result[..., column] = number
    return result


def gather(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return parts of an array at indices."""
    array, indices = given
    windows, dtype = windows_of(equation), equation.outvars[0].aval.dtype
    numbers, axis = _known(indices)
    values = [*flat(array), code.constant(filler(equation.params, dtype), kind_of(dtype))]
    if axis is None:
        return [_taken(values, windows.positions(numbers, array.shape))]
    array_axis = windows.named[axis]
    size, width = array.shape[array_axis], windows.sizes[array_axis]
    # from one before to one beyond the ends; or only windows inside, so that numbers in memory need not be copied
    low, high = (-1, size) if windows.drop else (0, size - width)
    tables = [windows.positions(_with_column(numbers, axis, k), array.shape) for k in range(low, high + 1)]
    result = np.empty(tables[0].shape, object)
    for position in np.ndindex(result.shape):
        index = within(code, indices[(*(position[k] for k in windows.batch), axis)], low, high)
        index = code.arithmetic("add", index, code.constant(-low, index.kind))
        result[position] = _element(code, index, *(values[table[position]] for table in tables))
    return [result]


def _taken(values: Sequence[Value], table: np.ndarray) -> Values:
    return filled(table.shape, [values[index] for index in table.ravel()])


def filler(params: Mapping[str, Any], dtype: Any) -> Any:
    """Return the value for an index that points beyond an array."""
    if params["mode"] != GatherScatterMode.FILL_OR_DROP:
        return 0
    if params["fill_value"] is not None:
        return params["fill_value"]
    if np.issubdtype(dtype, np.floating):
        return np.nan
    return True if np.dtype(dtype).kind == "b" else np.iinfo(dtype).min


def scatter(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return an array with numbers replaced at indices, or increased by the updates."""
    array, indices, updates = given
    numbers, column = _known(indices)
    if not updates.size or not array.size:
        return [array]
    windows, add, result = windows_of(equation), equation.primitive.name == "scatter-add", flat(array)

    def put(index: int, value: Value, is_target: Value) -> None:
        if index >= 0:
            new = code.arithmetic("add", result[index], value) if add else value
            result[index] = code.select(is_target, new, result[index])

    if column is None:
        for index, value in zip(windows.positions(numbers, array.shape).ravel().tolist(), flat(updates), strict=True):
            put(index, value, code.constant(True))
        return [filled(array.shape, result)]
    array_axis = windows.named[column]
    starts = range(array.shape[array_axis] - windows.sizes[array_axis] + 1)
    tables = [windows.positions(_with_column(numbers, column, start), array.shape) for start in starts]
    for position in np.ndindex(updates.shape):
        index = indices[(*(position[k] for k in windows.batch), column)]
        index = index if windows.drop else within(code, index, starts[0], starts[-1])
        for start, table in zip(starts, tables, strict=True):
            is_target = code.compare("eq", index, code.constant(start, index.kind))
            put(int(table[position]), updates.item(position), is_target)
    return [filled(array.shape, result)]
