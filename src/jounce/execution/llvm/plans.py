"""The order in which a JAX program is emitted: calls are inlined, and numbers used once are computed late.

If arrays may be in memory, repeated operations are emitted once, and unused operations not at all, since no later stage
removes them. For unrolled code, the text and LLVM do this, without keeping repeated operations.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jax.extend.core import Literal

from jounce.base.jax_internals import is_by_certain_entries, is_subroutine

CALLS = ("jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "checkpoint", "remat2")
"""Operations that call a program, which is inlined unless it is a subroutine."""

VIEWS = ("broadcast_in_dim", "reshape", "squeeze", "expand_dims", "transpose")
"""Operations that are repeated if the program repeats them: they are free, and operands used once need no memory."""


@dataclass(eq=False, slots=True)  # not frozen, as values are not: there are many
class Variable:
    """The result of an operation, or a constant of a program."""

    aval: Any  # its shape and type


@dataclass(eq=False, slots=True)
class Operation:
    """An operation, with the attribute names of an equation of JAX."""

    primitive: Any
    params: Mapping[str, Any]
    invars: Sequence[Any]
    outvars: Sequence[Any]
    sparse: bool  # whether a constant zero is a structural zero


@dataclass(frozen=True, eq=False)
class Plan:
    """A program with calls inlined, and the lifetimes of its variables.

    Attributes
    ----------
    operations : sequence of Operation
        Operations in their order.
    results : sequence of Variable or Literal
        Results of the program.
    constants : mapping
        Values of the constants of inlined programs, by variable.
    delayed : mapping
        Operations whose numbers are computed where they are used: for each index, that of the only reading operation,
        with results read after all operations.
    last : mapping
        For each variable, the index of the last operation that reads it; results are read after all operations. Without
        delayed operations, no array is in memory, and neither `last` nor `ends` is needed.
    ends : mapping
        For each operation, the variables that no later operation reads.
    """

    operations: Sequence[Operation]
    results: Sequence[Any]
    constants: Mapping[Any, Any]
    delayed: Mapping[int, int]
    last: Mapping[Any, int]
    ends: Mapping[int, Sequence[Any]]


def plan_of(program: Any, deferred: Collection[str], reading: Collection[str]) -> Plan:
    """Return the plan of a program.

    Parameters
    ----------
    program : Jaxpr
    deferred : collection of str
        Operations whose numbers may be computed where they are used.
    reading : collection of str
        Other operations that read each number once.
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
    earlier: dict[Any, list[Any]] | None,
    equals: dict[Any, Any],
    *,
    whole: bool,
    sparse: bool = False,
) -> list[Any]:
    """Append the operations of a program, with those of called programs, and return its results.

    Parameters
    ----------
    program : Jaxpr
    names : dict
        New names of its variables; others keep their names. A program that is called twice has new names each time.
    earlier : dict or None
        Results of earlier operations by key, so that repeated operations are emitted once; None to repeat them.
    equals : dict
        The first equal result of each result.
    whole : bool
        Whether the program is not called by another one.
    sparse : bool, default False
        Whether the program is marked by `by_certain_entries`.
    """

    def name(variable: Any) -> Any:
        return variable if isinstance(variable, Literal) else names.get(variable, variable)

    stack, marked = None, False
    for equation in program.eqns:
        given, result = [name(variable) for variable in equation.invars], list(equation.outvars)
        if not sparse and equation.source_info.name_stack is not stack:  # one for many operations
            stack, marked = equation.source_info.name_stack, is_by_certain_entries(equation)
        is_sparse = sparse or marked
        if equation.primitive.name in CALLS and not is_subroutine(equation):
            called, values = _called(equation)
            inner = dict(zip(called.invars, given, strict=True))
            for variable, value in zip(called.constvars, values, strict=True):
                inner[variable] = Variable(variable.aval)
                constants[inner[variable]] = value
            results = _written(called, inner, operations, constants, earlier, equals, whole=False, sparse=is_sparse)
            names |= zip(result, results, strict=True)
            continue
        key = None if earlier is None else _key(equation, given, equals, is_sparse)
        before = None if earlier is None or key is None else earlier.get(key)
        if before is not None and equation.primitive.name not in VIEWS:
            names |= zip(result, before, strict=True)
            continue
        if not whole:
            result = [Variable(variable.aval) for variable in result]
            names |= zip(equation.outvars, result, strict=True)
        if earlier is not None and key is not None:
            equals |= zip(result, before or result, strict=True)
            earlier.setdefault(key, result)
        operations.append(Operation(equation.primitive, equation.params, given, result, is_sparse))
    return [name(variable) for variable in program.outvars]


def _key(equation: Any, given: Sequence[Any], equals: Mapping[Any, Any], sparse: bool) -> Any:
    """Return the key that identifies an operation; None if there is none."""

    def number(x: Any) -> Any:
        if isinstance(x, Literal):
            aval: Any = x.aval
            return aval.shape, aval.dtype, np.asarray(x.val).tobytes()
        return equals.get(x, x)

    p = equation.params
    key = equation.primitive.name, sparse, *(sorted(p.items()) if len(p) > 1 else p.items()), *map(number, given)
    try:
        hash(key)
    except TypeError:
        return None
    return key


def _needed(operations: Sequence[Operation], results: Sequence[Any]) -> list[Operation]:
    """Return the operations on which results depend, and those with side effects."""
    read, needed = {x for x in results if not isinstance(x, Literal)}, []
    for operation in reversed(operations):
        acts = not operation.outvars or "call" in operation.primitive.name  # prints, or calls opaque code
        if acts or not read.isdisjoint(operation.outvars):
            read |= {x for x in operation.invars if not isinstance(x, Literal)}
            needed.append(operation)
    return needed[::-1]


def _called(equation: Any) -> tuple[Any, Sequence[Any]]:
    """Return the called program, and the values of its constants."""
    p = equation.params
    called = next(p[name] for name in ("jaxpr", "call_jaxpr", "fun_jaxpr") if name in p)
    return (called.jaxpr, called.consts) if hasattr(called, "jaxpr") else (called, ())


def _readers(operations: Sequence[Operation], results: Sequence[Any]) -> dict[Any, list[int]]:
    """Return the indices of the operations that read each variable, in order; results are read after all operations."""
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
        reader, *others = readers.get(operation.outvars[0], [-1])
        if others or reader < 0:
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
