"""The LLVM module of a JAX function: its text, and its machine code."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from jounce.base.importing import without_garbage_collection
from jounce.base.jax_internals import in_plain_operations, is_tested_release
from jounce.execution.llvm import rows as rows_
from jounce.execution.llvm.machine import compiled, vector_width
from jounce.execution.llvm.rounds import rounds_text
from jounce.execution.llvm.text.arrays import constants
from jounce.execution.llvm.text.code import Code, flat
from jounce.execution.llvm.text.scalars import MOST_LINES, MOST_LINES_WITHOUT_LOOPS, TURNS
from jounce.execution.llvm.text.sine_cosine import sine_and_cosine
from jounce.execution.llvm.text.stored import is_large, put, values_of
from jounce.execution.llvm.text.values import Region, UnsupportedOperationError, kind_of
from jounce.execution.llvm.text.views import Array, Stored, contiguous
from jounce.execution.llvm.translation import translate

LARGE = 64  # size of arrays that stay in memory if fully unrolled code is too long
MOST_MEMORY = 2**20  # bytes on the stack: threads have little
MOST_HEAP = 2**30  # bytes on the heap
NAME = re.compile(r"%\w+")
ATTRIBUTES = """attributes #0 = { nounwind willreturn memory(none) }
attributes #2 = { nounwind willreturn memory(none) "min-legal-vector-width"="512" "prefer-vector-width"="512" }
attributes #1 = { nounwind "min-legal-vector-width"="512" "prefer-vector-width"="512" }
!0 = !{}"""


def object_file(
    function: Callable[..., Any],
    shared: Any,
    lanes: Any,
    leaf_values: Mapping[int, np.ndarray],
    *,
    rows: bool = False,
    large: int | None = None,
    single: bool = False,
    hasty: bool = False,
    brief: bool = False,
) -> tuple[bytes, Any]:
    """Return the machine code of a function of one instant, as an object file, and the shapes of its results.

    Parameters
    ----------
    function : callable
        Function of two pytrees of arrays: those that all instants share, and those of the instant, with a last axis of
        length one, as in all results.
    shared, lanes : pytree
        Arrays, or objects with their shapes and types.
    leaf_values : mapping
        Leaves of `shared`, by index, whose values are compiled in.
    rows : bool, default False
        Whether arrays of many instants, arguments and results, have the instants along their first axis.
    large : int, optional
        Size beyond which arrays stay in memory, with loops over them: shorter but slower code. By default none do or,
        if there is no unrolled code, those larger than `LARGE`.
    single : bool, default False
        Whether there is only one instant, with all arrays in `shared`.
    hasty, brief : bool, default False
        As for `compiled`.

    Raises
    ------
    UnsupportedOperationError
        If there is no code for the function, the code is too long, or an untested release of JAX traces it differently.
    """
    count = len(jax.tree.leaves(shared))
    with without_garbage_collection():
        traced, results = jax.make_jaxpr(function, return_shape=True)(shared, lanes)
        closed = in_plain_operations(traced)
        try:
            text = _written(closed, count, leaf_values, vector_width(), rows=rows, large=large, single=single)
        except (AttributeError, KeyError, TypeError) as failure:  # JAX describes an operation by other names
            if is_tested_release():
                raise
            raise UnsupportedOperationError(f"JAX {jax.__version__}, which was not tried: {failure!r}") from failure
    return compiled(text, hasty=hasty, brief=brief), results


def _written(*program: Any, large: int | None, **options: Any) -> str:
    """Return the text of a module; with large arrays in memory if unrolled code is too long or does not exist."""
    try:
        return _text(*program, large=large, **options)
    except UnsupportedOperationError:
        if large is not None:
            raise
    return _text(*program, large=LARGE, **options)


def _text(
    closed: Any,
    shared: int,
    leaf_values: Mapping[int, np.ndarray],
    width: int,
    *,
    rows: bool = False,
    large: int | None = None,
    single: bool = False,
) -> str:
    """Return the text of a module with a function `run` of the addresses of all arrays and the number of lanes."""
    line_limit = MOST_LINES_WITHOUT_LOOPS if large is None else MOST_LINES
    code, given = Code(width, line_limit, large=large, single=single), []
    for number, variable in enumerate(closed.jaxpr.invars):
        if number in leaf_values:
            given.append(constants(leaf_values[number]))
            continue
        region = _region(code, number, kind_of(variable.aval.dtype), lanes=number >= shared and not single)
        shape = variable.aval.shape
        if is_large(code, variable.aval) and not (rows and region.lanes):
            given.append(contiguous(region, shape))
            continue
        array = np.empty(shape, object)
        if rows and region.lanes:
            array.ravel()[:] = rows_.read(code, region.pointer, array.size, region.kind)
        else:
            array.ravel()[:] = [code.load(region, k) for k in range(array.size)]
        given.append(array)
    loads = len(code.lines)
    results = translate(code, closed.jaxpr, [constants(number) for number in closed.consts], given)
    for number, array in enumerate(results, len(given)):
        _write(code, number, array, rows=rows)
    code.lines[:loads] = _needed(code.lines[:loads], code.lines[loads:])
    if code.memory > MOST_MEMORY or code.heap > MOST_HEAP:
        raise UnsupportedOperationError(f"a program with {code.memory + code.heap:,} bytes of memory of its own")
    allocation, release = [], []
    if code.heap:
        allocation, release = (
            [
                f"%block = call noalias ptr @malloc(i64 {code.heap + 64})",
                "%address = ptrtoint ptr %block to i64",
                "%before = sub i64 0, %address",
                "%gap = and i64 %before, 63",
                "%heap = getelementptr i8, ptr %block, i64 %gap",
            ],
            ["call void @free(ptr %block)"],
        )
    loop = [
        f"%most = sub i64 %total, {width}",
        "br label %lanes",
        "lanes:",
        "%done = phi i64 [0, %begin], [%next, %more]",
        "%lane = call i64 @llvm.smin.i64(i64 %done, i64 %most)",  # the last vectors may share lanes
        *code.lines,
        "br label %more",
        "more:",
        f"%next = add i64 %done, {width}",
        "%over = icmp sge i64 %next, %total",
        "br i1 %over, label %end, label %lanes",
        "end:",
    ]
    routines = [sine_and_cosine(code)] if {(name, 1) for name in TURNS} <= code.functions else []
    lines = [
        *code.constants,
        *routines,
        *(subroutine.text for subroutine in code.subroutines.values()),
        "define void @run(ptr noalias %arguments, i64 %total) #1 {",
        "begin:",
        *allocation,
        *code.entry,
        *(code.lines if single else loop),
        *release,
        "ret void",
        "}",
        "declare noalias ptr @malloc(i64)",
        "declare void @free(ptr)",
        *sorted(code.intrinsics | {"declare i64 @llvm.smin.i64(i64, i64)"}),
    ]
    for name, count in sorted(code.functions):
        lines += [f"declare double @{name}({', '.join(['double'] * count)}) #0", _lane_by_lane(name, count, width)]
    if not single:
        lines.append(rounds_text(width))
    return "\n".join(filter(None, [*lines, ATTRIBUTES]))


def _needed(lines: Sequence[str], later: Sequence[str]) -> list[str]:
    """Return the lines whose values later lines need; LLVM takes minutes for the unread numbers of large tables."""
    used, result = set(NAME.findall("\n".join(later))), []
    for line in reversed(lines):
        name, _, operation = line.partition(" = ")
        if name in used:
            used.update(NAME.findall(operation))
            result.append(line)
    return result[::-1]


def _region(code: Code, number: int, kind: str, *, lanes: bool) -> Region:
    """Return the memory of an argument or a result."""
    code.entry.append(f"%q{number} = getelementptr ptr, ptr %arguments, i64 {number}")
    code.entry.append(f"%a{number} = load ptr, ptr %q{number}, align 8, !invariant.load !0")
    return Region(f"%a{number}", kind, lanes, given=True)


def _write(code: Code, number: int, array: Array, *, rows: bool) -> None:
    if not array.size:
        return
    if isinstance(array, Stored) and not rows:
        put(code, contiguous(_region(code, number, array.kind, lanes=not code.single), array.shape), array)
        return
    values = flat(values_of(code, array))
    region = _region(code, number, values[0].kind, lanes=not code.single)
    if rows:
        rows_.write(code, region.pointer, values)
        return
    for k, value in enumerate(values):
        code.store(region, k, value)


def _lane_by_lane(name: str, count: int, width: int) -> str:
    """Return the text of a vector function that calls a C library function for each lane."""
    vector, lines = f"<{width} x double>", []
    for lane in range(width):
        lines += [f"%e{lane}_{k} = extractelement {vector} %a{k}, i64 {lane}" for k in range(count)]
        arguments = ", ".join(f"double %e{lane}_{k}" for k in range(count))
        lines.append(f"%r{lane} = call double @{name}({arguments})")
        before = "poison" if lane == 0 else f"%s{lane - 1}"
        lines.append(f"%s{lane} = insertelement {vector} {before}, double %r{lane}, i64 {lane}")
    parameters = ", ".join(f"{vector} %a{k}" for k in range(count))
    body = "\n".join([*lines, f"ret {vector} %s{width - 1}"])
    return f"define internal {vector} @{name}_of_lanes({parameters}) noinline #2 {{\n{body}\n}}"
