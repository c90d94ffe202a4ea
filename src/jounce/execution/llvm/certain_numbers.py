"""Constant propagation: the numbers that a traced program computes for any values of its unknown inputs."""

import math
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jax.core import Tracer

from jounce.execution.llvm.text.arrays import constants, filled
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.scalars import MOST_LINES
from jounce.execution.llvm.text.values import Value, kind_of
from jounce.execution.llvm.translation import translate


def certain_numbers(program: Any, given: Sequence[Any]) -> list[np.ndarray]:
    """Return the constant results of a program.

    The program is translated and its text discarded: a number that the translator folds to a constant is certain.

    Parameters
    ----------
    program : ClosedJaxpr
    given : sequence of array
        Arguments; NaN marks an unknown number, and a shape an array of unknown numbers.

    Returns
    -------
    list of array
        Results, NaN where a number is not certain.

    Raises
    ------
    UnsupportedOperationError
        If the translator has no code for an operation.
    """
    code = Code(1, MOST_LINES, single=True)

    def values(array: Any) -> np.ndarray:
        if isinstance(array, Tracer | jax.ShapeDtypeStruct):
            unknown = [Value(code.fresh("u"), kind_of(array.dtype), False) for _ in range(math.prod(array.shape))]
            return filled(array.shape, unknown)
        array = np.asarray(array)
        if array.dtype != float:
            return constants(array)
        return filled(array.shape, [_value(code, number) for number in array.ravel()])

    results: Any = translate(code, program.jaxpr, list(map(values, program.consts)), list(map(values, given)))
    return [np.array([_number(x) for x in flat(array)]).reshape(array.shape) for array in results]


def _value(code: Code, number: np.float64) -> Value:
    return Value(code.fresh("u"), "f", False) if np.isnan(number) else code.constant(number)


def _number(value: Value) -> float:
    return np.nan if value.constant is None else float(value.constant)
