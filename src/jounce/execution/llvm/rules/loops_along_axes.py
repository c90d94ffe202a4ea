"""Loops along axes of arrays in memory: sums, products, extremes, and matrix products."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from jounce.execution.llvm.rules.axes import REDUCED, combination, is_better, nothing
from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.stored import counted, fill, nest, new_storage, put, result_storage, stored
from jounce.execution.llvm.text.values import Value
from jounce.execution.llvm.text.views import Array, Deferred, Stored, as_read, between, part_at, spread, transposed

ORDERLESS = ("max", "min", "and", "or")  # operations with the same result in any order
StoredRule = Callable[[Code, Any, Sequence[Array]], Sequence[Array]]


def reduction(operation: str) -> StoredRule:
    """Return the rule for sums, products and the like along some axes."""

    def rule(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
        array, axes = given[0], equation.params["axes"]
        if not isinstance(array, Deferred):
            array = as_read(stored(code, array))
        remaining = [axis for axis in range(array.ndim) if axis not in axes]
        result = result_storage(code, equation, [array])
        fill(code, result, code.constant(nothing(operation, result.kind), result.kind))
        if code.single and operation in ORDERLESS and result.size == 1:
            for part in _in_vectors(code, operation, array):
                _gathered(code, operation, spread(replace(result, shape=(), strides=()), part.shape, ()), part)
            return [result]
        _gathered(code, operation, spread(result, array.shape, remaining), array)
        return [result]

    return rule


def _gathered(code: Code, operation: str, total: Stored, array: Deferred) -> None:
    """Emit a loop that combines each number of an array with the running total."""
    combine = combination(code, operation)

    def body(values: Sequence[Value]) -> Sequence[Value]:
        return [combine(values[0], array.body(values[1:]))]

    nest(code, [total, *array.given], [total], body, adds=True)


def _in_vectors(code: Code, operation: str, array: Deferred) -> list[Deferred]:
    """Return a vector that combines the whole vectors of an array, and the remaining numbers.

    If the order does not matter, this is faster than to combine single numbers.
    """
    row = array.in_shape((array.size,))
    if row is None or row.size < 2 * code.width:
        return [array]
    remainder = row.size % code.width
    shape = (row.size // code.width, code.width)
    rows = row.viewed(lambda x: between(code, x, 0, 0, row.size - remainder)).in_shape(shape)
    tail = row.viewed(lambda x: between(code, x, 0, row.size - remainder, remainder))
    if rows is None:
        return [array]
    accumulator = new_storage(code, (code.width,), row.kind, lanes=False)
    fill(code, accumulator, code.constant(nothing(operation, row.kind), row.kind))
    _gathered(code, operation, spread(accumulator, shape, (1,)), rows)
    return [as_read(accumulator), tail]


REDUCTIONS = {f"reduce_{name}": reduction(operation) for name, operation in REDUCED.items()}


def extreme(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Return the index of the largest or smallest number along an axis, the first of equal ones; NaN before all."""
    array, result, word = stored(code, given[0]), result_storage(code, equation, given), equation.primitive.name
    (axis,) = map(int, equation.params["axes"])
    rows = transposed(array, [axis, *(k for k in range(array.ndim) if k != axis)])
    best = new_storage(code, result.shape, array.kind, lanes=array.lanes)
    put(code, best, part_at(code, rows, 0))
    fill(code, result, code.constant(0, result.kind))

    def look(k: int | Value) -> None:
        index = code.converted(k, result.kind) if isinstance(k, Value) else code.constant(k, result.kind)

        def body(values: Sequence[Value]) -> Sequence[Value]:
            value, largest, position = values
            better = is_better(code, word, value, largest)
            return code.select(better, value, largest), code.select(better, index, position)

        nest(code, [part_at(code, rows, k), best, result], [best, result], body, adds=True)

    counted(code, rows.shape[0], look)
    return [result]


def dot(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Return products of matrices: sums of products over contracted axes, for each index of batch axes."""
    (left_sum, right_sum), (left_batch, right_batch) = equation.params["dimension_numbers"]
    result = result_storage(code, equation, given)
    fill(code, result, code.constant(0, result.kind))
    left, right = (stored(code, array) for array in given)
    left_free, right_free = (
        [axis for axis in range(x.ndim) if axis not in (*batch, *summed)]
        for x, batch, summed in ((left, left_batch, left_sum), (right, right_batch, right_sum))
    )
    left = transposed(left, (*left_batch, *left_free, *left_sum))
    right = transposed(right, (*right_batch, *right_free, *right_sum))
    batch, summed = len(left_batch), len(left_sum)
    shape = (*result.shape, *left.shape[left.ndim - summed :])
    after, end = batch + len(left_free), len(shape) - summed
    a = spread(left, shape, [*range(after), *range(end, len(shape))])
    b = spread(right, shape, [*range(batch), *range(after, len(shape))])
    total = spread(result, shape, range(end))

    def body(values: Sequence[Value]) -> Sequence[Value]:
        accumulated, p, q = (code.converted(value, result.kind) for value in values)
        return [code.arithmetic("add", accumulated, code.arithmetic("mul", p, q))]

    nest(code, [total, a, b], [total], body, adds=True)
    return [result]
