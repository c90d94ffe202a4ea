"""Calls of machine code from machine code: a program for many instants within one for a single instant."""

import math
from collections.abc import Sequence
from typing import Any

from jounce.execution.llvm.machine import is_published
from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.stored import copied, new_storage, stored
from jounce.execution.llvm.text.values import UnsupportedOperationError, kind_of
from jounce.execution.llvm.text.views import Array, Stored, contiguous


def call(code: Code, equation: Any, given: Sequence[Array]) -> list[Array]:
    """Emit a call of a published program for JAX's foreign function call; its lanes are the last axes of arrays.

    Raises
    ------
    UnsupportedOperationError
        If another function is called, or the calling program has several lanes.
    """
    name, result = equation.params["target_name"], [variable.aval for variable in equation.outvars]
    if not (code.single and is_published(name)):
        raise UnsupportedOperationError(f"a call of {name}")
    results: list[Array] = [new_storage(code, aval.shape, kind_of(aval.dtype), lanes=False) for aval in result]
    arrays = [*(_in_one_piece(code, array) for array in given), *results]
    addresses = code.fresh("m")
    code.entry.append(f"{addresses} = alloca ptr, i64 {len(arrays)}, align 8")
    code.memory += 8 * len(arrays)
    for k, array in enumerate(arrays):
        index = code.fresh()
        code.lines.append(f"{index} = getelementptr ptr, ptr {addresses}, i64 {k}")
        code.lines.append(f"store ptr {array.region.pointer}, ptr {index}, align 8")
    code.intrinsics.add(f"declare void @{name}(ptr, i64)")
    code.lines.append(f"call void @{name}(ptr {addresses}, i64 {result[0].shape[-1]})")
    return results


def _in_one_piece(code: Code, array: Array) -> Stored:
    """Return a contiguous array at the beginning of its memory."""
    result = stored(code, array)
    is_contiguous = result.is_same(contiguous(result.region, result.shape)) or not math.prod(result.shape)
    return result if is_contiguous else copied(code, result)
