"""In which order a program of JAX is written: calls within it are part of it, and numbers used once are written late.

Where arrays may be in memory, what repeats is written once, and what no result needs is not written: no one else would
find out. Of single values, the text and LLVM do, and those that repeat need not be kept.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jax.extend.core import Literal

from jounce.base.jax_internals import is_by_certain_entries, is_subroutine

CALLS = ("jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "checkpoint", "remat2")
"""Operations that call a program, which is written in their place unless it is a subroutine."""

VIEWS = ("broadcast_in_dim", "reshape", "squeeze", "expand_dims", "transpose")
"""Operations that repeat where they do: they are no work, and what is used once need not be in memory."""


@dataclass(eq=False, slots=True)  # not frozen, as values are not: there are many
class Variable:
    """What an operation has found, or a constant of a program."""

    aval: Any  # its shape and type


@dataclass(eq=False, slots=True)
class Operation:
    """An operation, with the names that an equation of JAX has for its parts."""

    primitive: Any
    params: Mapping[str, Any]
    invars: Sequence[Any]
    outvars: Sequence[Any]
    sparse: bool  # whether a constant zero is an entry that is not there


@dataclass(frozen=True, eq=False)
class Plan:
    """A program without calls, and when its variables are read.

    Attributes
    ----------
    operations : sequence of Operation
        In their order.
    results : sequence of Variable or Literal
        Of the program.
    constants : mapping
        Of variables to the values of the programs that are called.
    delayed : mapping
        Of operations, by number, to the one that wants their numbers, once; they may be computed there. Results are
        used after all of them.
    last : mapping
        Of variables to the number of the last operation that reads them; results are read after all of them. Where
        nothing is delayed, no array is in memory, and nobody asks for it, nor for `ends`.
    ends : mapping
        Of operations to the variables that are not read after them.
    """

    operations: Sequence[Operation]
    results: Sequence[Any]
    constants: Mapping[Any, Any]
    delayed: Mapping[int, int]
    last: Mapping[Any, int]
    ends: Mapping[int, Sequence[Any]]


def plan_of(program: Any, deferred: Collection[str], reading: Collection[str]) -> Plan:
    """Return how a program is written.

    Parameters
    ----------
    program : Jaxpr
    deferred : collection of str
        Operations whose numbers may be computed where they are used.
    reading : collection of str
        Others that read a number once.
    """
    operations: list[Operation] = []
    constants: dict[Any, Any] = {}
    results = _written(program, {}, operations, constants, {} if deferred else None, {}, whole=True)
    if not deferred:
        return Plan(operations, results, constants, {}, {}, {})
    operations = _needed(operations, results)
    readers = _readers(operations, results)
    delayed = _delayed(operations, readers, deferred, reading)
    last = {variable: max([delayed.get(n, n) for n in numbers]) for variable, numbers in readers.items()}
    return Plan(operations, results, constants, delayed, last, _ends(operations, last))


def _written(
    program: Any,
    names: dict[Any, Any],
    operations: list[Operation],
    constants: dict[Any, Any],
    known: dict[Any, list[Any]] | None,
    alike: dict[Any, Any],
    *,
    whole: bool,
    sparse: bool = False,
) -> list[Any]:
    """Add the operations of a program, those that it calls among them, and return its results.

    Parameters
    ----------
    program : Jaxpr
    names : dict
        Of its variables to those of the whole; what is not there has the same name. A program that is called twice has
        other names each time.
    known : dict or None
        Of what tells the operations so far from each other to their results: what repeats is there once. None where
        each is written.
    alike : dict
        Of results to the first ones that are the same.
    whole : bool
        Whether it is called by none.
    sparse : bool, default False
        Whether it is called by certain entries.
    """

    def name(variable: Any) -> Any:
        return variable if isinstance(variable, Literal) else names.get(variable, variable)

    stack, marked = None, False
    for equation in program.eqns:
        given, result = [name(variable) for variable in equation.invars], list(equation.outvars)
        if not sparse and equation.source_info.name_stack is not stack:  # one for many operations
            stack, marked = equation.source_info.name_stack, is_by_certain_entries(equation)
        here = sparse or marked
        if equation.primitive.name in CALLS and not is_subroutine(equation):
            called, values = _called(equation)
            inner = dict(zip(called.invars, given, strict=True))
            for variable, value in zip(called.constvars, values, strict=True):
                inner[variable] = Variable(variable.aval)
                constants[inner[variable]] = value
            written = _written(called, inner, operations, constants, known, alike, whole=False, sparse=here)
            names |= zip(result, written, strict=True)
            continue
        key = None if known is None else _key(equation, given, alike, here)
        before = None if known is None or key is None else known.get(key)
        if before is not None and equation.primitive.name not in VIEWS:
            names |= zip(result, before, strict=True)
            continue
        if not whole:
            result = [Variable(variable.aval) for variable in result]
            names |= zip(equation.outvars, result, strict=True)
        if known is not None and key is not None:
            alike |= zip(result, before or result, strict=True)
            known.setdefault(key, result)
        operations.append(Operation(equation.primitive, equation.params, given, result, here))
    return [name(variable) for variable in program.outvars]


def _key(equation: Any, given: Sequence[Any], alike: Mapping[Any, Any], sparse: bool) -> Any:
    """Return what distinguishes an operation from others, None where that is not known."""

    def number(x: Any) -> Any:
        if isinstance(x, Literal):
            aval: Any = x.aval
            return aval.shape, aval.dtype, np.asarray(x.val).tobytes()
        return alike.get(x, x)

    p = equation.params
    key = equation.primitive.name, sparse, *(sorted(p.items()) if len(p) > 1 else p.items()), *map(number, given)
    try:
        hash(key)
    except TypeError:
        return None
    return key


def _needed(operations: Sequence[Operation], results: Sequence[Any]) -> list[Operation]:
    """Return the operations on which results depend."""
    read, needed = {x for x in results if not isinstance(x, Literal)}, []
    for operation in reversed(operations):
        acts = not operation.outvars or "call" in operation.primitive.name  # prints, or runs what is not seen here
        if acts or not read.isdisjoint(operation.outvars):
            read |= {x for x in operation.invars if not isinstance(x, Literal)}
            needed.append(operation)
    return needed[::-1]


def _called(equation: Any) -> tuple[Any, Sequence[Any]]:
    """Return the program that is called, and the values of its constants."""
    p = equation.params
    called = next(p[name] for name in ("jaxpr", "call_jaxpr", "fun_jaxpr") if name in p)
    return (called.jaxpr, called.consts) if hasattr(called, "jaxpr") else (called, ())


def _readers(operations: Sequence[Operation], results: Sequence[Any]) -> dict[Any, list[int]]:
    """Return the numbers of the operations that read each variable, in their order; results are read after all."""
    readers: dict[Any, list[int]] = {}
    for number, read in enumerate([*(operation.invars for operation in operations), results]):
        for variable in read:
            if not isinstance(variable, Literal):
                readers.setdefault(variable, []).append(number)
    return readers


def _delayed(
    operations: Sequence[Operation],
    readers: Mapping[Any, Sequence[int]],
    deferred: Collection[str],
    reading: Collection[str],
) -> dict[int, int]:
    result: dict[int, int] = {}
    for number, operation in reversed([*enumerate(operations)]):
        if operation.primitive.name not in deferred or len(operation.outvars) != 1:
            continue
        reader, *more = readers.get(operation.outvars[0], [-1])
        if more or reader < 0:
            continue
        name = None if reader == len(operations) else operations[reader].primitive.name
        if name is None or name in deferred or name in reading:
            result[number] = result.get(reader, reader)
    return result


def _ends(operations: Sequence[Operation], last: Mapping[Any, int]) -> dict[int, list[Any]]:
    ends: dict[int, list[Any]] = {}
    for variable, number in last.items():
        ends.setdefault(number, []).append(variable)
    for number, operation in enumerate(operations):
        ends.setdefault(number, []).extend(x for x in operation.outvars if x not in last)
    return ends
