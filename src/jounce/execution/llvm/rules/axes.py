"""Operations along axes of arrays: sums, products, extremes, and products of matrices."""

import itertools
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import numpy as np

from jounce.execution.llvm.text.arrays import Rule, Values, each
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.values import DTYPES, UnsupportedOperationError, Value, kind_of

MOST_SORTED = 16  # numbers
REDUCED = {"sum": "add", "prod": "mul", "max": "max", "min": "min", "and": "and", "or": "or"}
"""Operations on all numbers along axes, by JAX's names of the reductions."""


def nothing(operation: str, kind: str) -> Any:
    """Return the result of an operation on no numbers."""
    if operation in ("add", "mul"):
        return operation == "mul"
    if operation in ("and", "or"):
        return 0 if operation == "or" else True if kind == "b" else -1
    if kind == "b":
        return operation == "min"
    limits = (-np.inf, np.inf) if kind == "f" else (np.iinfo(DTYPES[kind]).min, np.iinfo(DTYPES[kind]).max)
    return limits[operation == "min"]


def combination(code: Code, operation: str) -> Callable[[Value, Value], Value]:
    """Return the function that combines two numbers to their sum, product, or the like."""
    return partial(code.logic if operation in ("and", "or") else code.arithmetic, operation)


def _combined(code: Code, operation: str, values: Sequence[Value], kind: str) -> Value:
    """Return the sum, product, or the like of numbers of one kind."""
    if not values:
        return code.constant(nothing(operation, kind), kind)
    combined = combination(code, operation)
    while operation in ("max", "min") and len(values) > 2:  # a tree, of independent halves: the order does not matter
        values = [*map(combined, values[::2], values[1::2]), *values[len(values) & ~1 :]]
    return reduce(combined, values)


def reduction(operation: str) -> Rule:
    """Return the rule for an operation on all numbers along some axes."""

    def rule(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
        axes, array = equation.params["axes"], given[0]
        remaining = [axis for axis in range(array.ndim) if axis not in axes]
        count = int(np.prod([array.shape[axis] for axis in axes]))
        rows = array.transpose(*remaining, *axes).reshape(*(array.shape[axis] for axis in remaining), count)
        result, kind = np.empty(rows.shape[:-1], object), kind_of(equation.outvars[0].aval.dtype)
        for index in np.ndindex(result.shape):
            result[index] = _combined(code, operation, flat(rows[index]), kind)
        return [result]

    return rule


def extreme(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return the index of the largest or smallest number along an axis, the first of equal ones; NaN before all."""
    (axis,) = equation.params["axes"]
    kind, rows = kind_of(equation.params["index_dtype"]), np.moveaxis(given[0], axis, -1)
    result = np.empty(rows.shape[:-1], object)
    for index in np.ndindex(result.shape):
        best, position = rows[index][0], code.constant(0, kind)
        for k, value in enumerate(flat(rows[index])[1:], 1):
            better = is_better(code, equation.primitive.name, value, best)
            best = code.select(better, value, best)
            position = code.select(better, code.constant(k, kind), position)
        result[index] = position
    return [result]


def is_better(code: Code, operation: str, value: Value, best: Value) -> Value:
    """Return whether a number is better than the best so far for `argmax` or `argmin`; NaN is better than all."""
    better = code.compare("gt" if operation == "argmax" else "lt", value, best)
    if value.kind != "f":
        return better
    nan, is_number = code.compare("ne", value, value), code.compare("eq", best, best)
    return code.logic("or", better, code.logic("and", nan, is_number))


def cumulative(operation: str) -> Rule:
    """Return the rule for an operation on each number along an axis and all before it."""

    def rule(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
        axis, backward = equation.params["axis"], equation.params["reverse"]
        rows = np.moveaxis(given[0], axis, 0)
        rows = rows[::-1] if backward else rows
        parts = itertools.accumulate(
            (rows[k, ...] for k in range(len(rows))),
            lambda a, b: each(lambda p, q: code.arithmetic(operation, p, q), a, b),
        )
        result = np.empty(rows.shape, object)
        for k, part in enumerate(parts):
            result[k, ...] = part
        return [np.moveaxis(result[::-1] if backward else result, 0, axis)]

    return rule


def sorting(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Sort arrays by the first of them, NaN last, by odd-even transposition."""
    arrays = [np.moveaxis(array, equation.params["dimension"], -1).copy() for array in given]
    size = arrays[0].shape[-1]
    if equation.params["num_keys"] != 1 or size > MOST_SORTED:
        raise UnsupportedOperationError(f"sorting {size} numbers by {equation.params['num_keys']} keys")
    for index in np.ndindex(arrays[0].shape[:-1]):
        rows = [array[index] for array in arrays]
        for turn in range(size):
            for k in range(turn % 2, size - 1, 2):
                change = _beyond(code, *rows[0][k : k + 2].tolist())
                for row in rows:
                    x, y = row[k : k + 2].tolist()
                    row[k], row[k + 1] = code.select(change, y, x), code.select(change, x, y)
    return [np.moveaxis(array, -1, equation.params["dimension"]) for array in arrays]


def _beyond(code: Code, a: Value, b: Value) -> Value:
    """Return whether the first of two numbers belongs behind the second."""
    larger = code.compare("lt", b, a)
    if a.kind != "f":
        return larger
    return code.logic("or", larger, code.logic("and", code.compare("ne", a, a), code.compare("eq", b, b)))


def dot(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return products of matrices: sums over contracted axes, for each index of batch axes."""
    (left_sum, right_sum), (left_batch, right_batch) = equation.params["dimension_numbers"]
    kind = kind_of(equation.outvars[0].aval.dtype)
    left, right = (each(lambda value: code.converted(value, kind), array) for array in given)

    def ordered(array: Values, batch: Sequence[int], summed: Sequence[int]) -> Values:
        free = [axis for axis in range(array.ndim) if axis not in (*batch, *summed)]
        sizes = [int(np.prod([array.shape[axis] for axis in part])) for part in (batch, free, summed)]
        return array.transpose(*batch, *free, *summed).reshape(sizes)

    a, b = ordered(left, left_batch, left_sum), ordered(right, right_batch, right_sum)
    result = np.empty((len(a), a.shape[1], b.shape[1]), object)
    for k, i, j in np.ndindex(result.shape):
        products = [code.arithmetic("mul", p, q) for p, q in zip(flat(a[k, i]), flat(b[k, j]), strict=True)]
        result[k, i, j] = _combined(code, "add", products, kind)
    return [result.reshape(equation.outvars[0].aval.shape)]
