"""Functions of machine code for parts of a program that are called often, emitted once.

Their arguments and results are in memory, as are those of loops and conditionals anyway. Constants of a call are
compiled into the function, so that a matrix with other structural zeros has another function.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from jounce.execution.llvm.text.arrays import Values, filled
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.values import Region, UnsupportedOperationError, Value, kind_of, literal

Write = Callable[[Code, Any, Sequence[Values]], list[Any]]  # a closed program for given arrays; its results


@dataclass(frozen=True)
class Subroutine:
    """An emitted function."""

    name: str
    text: str
    is_read: list[bool]  # for each argument
    results: list[tuple[tuple[int, ...], list[Any]]]  # shapes, and numbers, None if not constant


def call_subroutine(code: Code, equation: Any, given: Sequence[Values], write: Write) -> list[Values]:
    """Emit the call of a program, and the program itself if it does not exist yet for such arguments."""
    program, values = equation.params["jaxpr"], [flat(array) for array in given]
    if any(kind_of(variable.aval.dtype) != "f" for variable in (*equation.invars, *equation.outvars)):
        return write(code, program, given)
    key = program.jaxpr, tuple([None if v.constant is None else literal(v) for part in values for v in part])
    if (subroutine := code.subroutines.get(key)) is None:
        subroutine = code.subroutines[key] = _written(code, program, given, write)
    pointers = [_pointer_to(code, part) for part, is_read in zip(values, subroutine.is_read, strict=True) if is_read]
    regions = [code.room(len(part), "f", lanes=True) if None in part else None for _, part in subroutine.results]
    pointers += [region.pointer for region in regions if region is not None]
    if any(regions):
        code.lines.append(f"call void {subroutine.name}({', '.join(f'ptr {pointer}' for pointer in pointers)})")
    return [
        filled(shape, [code.load(region, k) if region and value is None else value for k, value in enumerate(part)])
        for region, (shape, part) in zip(regions, subroutine.results, strict=True)
    ]


def _pointer_to(code: Code, values: Sequence[Value]) -> str:
    """Return the address of an array in memory; store its variable numbers unless all are in memory already."""
    varying = [(k, value) for k, value in enumerate(values) if value.constant is None]
    region, _ = varying[0][1].home or (None, 0)
    is_there = region is not None and all(value.home == (region, k) for k, value in varying)
    if region is not None and is_there and region.lanes and not region.given:  # lanes of a number are contiguous
        return region.pointer
    region = code.room(len(values), "f", lanes=True)
    for k, value in varying:
        code.store(region, k, value)
    return region.pointer


def _written(code: Code, program: Any, given: Sequence[Values], write: Write) -> Subroutine:
    inner = Code(code.width, code.most, functions=code.functions, intrinsics=code.intrinsics, plans=code.plans)
    inner.subroutines = code.subroutines
    read = {id(variable) for equation in program.jaxpr.eqns for variable in equation.invars}
    read |= {id(variable) for variable in program.jaxpr.outvars}
    arguments, parameters, is_read = [], [], []
    for number, (variable, array) in enumerate(zip(program.jaxpr.invars, given, strict=True)):
        region, values = Region(f"%a{number}", "f", True), flat(array)
        is_read.append(id(variable) in read and any(value.constant is None for value in values))
        if is_read[-1]:
            parameters.append(f"ptr noalias readonly {region.pointer}")
            values = [inner.load(region, k) if value.constant is None else value for k, value in enumerate(values)]
        arguments.append(filled(array.shape, values))
    results: list[tuple[tuple[int, ...], list[Any]]] = []
    for number, array in enumerate(write(inner, program, arguments)):
        values, region = flat(array), Region(f"%r{number}", "f", True)
        results.append((array.shape, [None if value.constant is None else value for value in values]))
        if None in results[-1][1]:
            parameters.append(f"ptr noalias {region.pointer}")
        for k, value in enumerate(values):
            if value.constant is None:
                inner.store(region, k, value)
    if inner.heap:
        raise UnsupportedOperationError(f"a subroutine with {inner.heap:,} bytes of memory of its own")
    code.memory += inner.memory
    name = f"@part{len(code.subroutines)}"
    head = f"define internal void {name}({', '.join(parameters)}) noinline #1 {{"
    return Subroutine(name, "\n".join([head, "begin:", *inner.entry, *inner.lines, "ret void", "}"]), is_read, results)
