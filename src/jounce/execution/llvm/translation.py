"""Translation of a JAX program for one instant to code for a vector of lanes, each with its own control flow.

Where lanes diverge, all branches taken by any lane are run, and each lane keeps the results of its own; a loop runs
until the last lane has left it. So the results of a lane do not depend on other lanes.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jax.extend.core import Literal, jaxprs_in_params

from jounce.base.jax_internals import sizes_of_scan
from jounce.execution.llvm.calls import call
from jounce.execution.llvm.loop_variables import (
    Homes,
    LoopVariables,
    changed_in_place,
    chosen,
    invariants_of,
    still_invariant,
    unchanged,
)
from jounce.execution.llvm.plans import plan_of
from jounce.execution.llvm.rules.loops import DEFERRED, READING, STORED
from jounce.execution.llvm.rules.operations import RULES
from jounce.execution.llvm.subroutines import call_subroutine
from jounce.execution.llvm.text.arrays import constants, filled
from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.lent_memory import among, forget_variables, regions_of, release_all_but, release_arrays
from jounce.execution.llvm.text.stored import (
    any_lanes,
    is_large,
    kind_in,
    new_storage,
    put,
    row,
    settled,
    stored,
    values_of,
)
from jounce.execution.llvm.text.values import Region, UnsupportedOperationError, Value, kind_of
from jounce.execution.llvm.text.views import Array, Deferred, InMemory, contiguous, further

MOST_UNROLLED = 4_000  # lines of an unrolled loop of known length
MOST_UNROLLED_IN_MEMORY = 250  # the same if arrays may stay in memory
HOPE = 8  # largest expected ratio of the lines of an early iteration to a later one, which reuses its results


def translate(
    code: Code, program: Any, constants_: Sequence[Array], given: Sequence[Array], *, late: bool = False
) -> list[Array]:
    """Emit the operations of a program, and return its results.

    Parameters
    ----------
    code : Code
        Code to emit to.
    program : Jaxpr
    constants_, given : sequence of arrays of Value
        Its constants and arguments.
    late : bool, default False
        Whether numbers of the results may be computed where they are used.

    Raises
    ------
    UnsupportedOperationError
        If there is no code for an operation.
    """
    plan = code.plans.get(program)
    if plan is None:
        plan = code.plans[program] = plan_of(program, *((DEFERRED, READING) if code.large is not None else ((), ())))
    arrays: dict[Any, Array] = {}
    read_last: dict[Region, int] = {}  # the last operation that reads each memory
    position = 0

    def noted(variable: Any, array: Array) -> None:
        arrays[variable] = array
        for region in regions_of([array]) if isinstance(array, InMemory) else ():
            read_last[region] = max(read_last.get(region, -1), plan.last.get(variable, -1))

    def read(variable: Any) -> Array:
        if isinstance(variable, Literal):
            aval: Any = variable.aval
            return constants(np.asarray(variable.val, aval.dtype))
        return arrays[variable]

    for variable, array in zip((*program.constvars, *program.invars), (*constants_, *given), strict=True):
        noted(variable, array)
    for variable, value in plan.constants.items():
        noted(variable, constants(value))
    outer_sparse = code.sparse
    with np.errstate(all="ignore"), code.used(lambda region: read_last.get(region, -1) > position):
        for position, operation in enumerate(plan.operations):
            inputs = [read(variable) for variable in operation.invars]
            before, code.sparse = len(code.taken), outer_sparse or operation.sparse
            result = _results(code, operation, inputs, delayed=position in plan.delayed)
            for variable, values in zip(operation.outvars, result, strict=True):
                noted(variable, _checked(values, variable.aval))
            if code.large is not None:
                release_all_but(code, code.taken[before:], result)
                forget_variables(code, arrays, plan.ends.get(position, ()))
        code.sparse = outer_sparse
        results = [read(variable) for variable in plan.results]
        return results if late else [stored(code, x) if isinstance(x, Deferred) else x for x in results]


def _results(code: Code, equation: Any, given: Sequence[Array], *, delayed: bool) -> Sequence[Array]:
    """Return the results of an operation: by single values, or by loops over large arrays."""
    name = equation.primitive.name
    if name not in DEFERRED and name not in READING:
        given = [stored(code, array) if isinstance(array, Deferred) else array for array in given]
    if (control := _CONTROL.get(name)) is not None:
        return control(code, equation, given)
    has_large = code.large is not None and any(is_large(code, variable.aval) for variable in equation.outvars)
    in_memory = has_large or not all(isinstance(array, np.ndarray) for array in given)
    if in_memory and (rule := STORED.get(name)) is not None:
        result = [settled(code, array) for array in rule(code, equation, given)]
        return [stored(code, x) if isinstance(x, Deferred) and not delayed else x for x in result]
    if (rule := RULES.get(name)) is None:
        raise UnsupportedOperationError(f"the operation {name!r} of JAX")
    single: Any = [values_of(code, array) for array in given] if in_memory else given
    return rule(code, equation, single)


def _checked(values: Any, aval: Any) -> Array:
    """Return values as an array, also a single one, after a check of the shape and kind that JAX expects."""
    array = values if isinstance(values, np.ndarray | InMemory) else filled((), [values])
    if array.shape != aval.shape:
        raise AssertionError(f"an array of shape {array.shape} where one of {aval.shape} belongs")
    kind = kind_of(aval.dtype)
    if isinstance(array, InMemory):
        if array.kind != kind:
            raise UnsupportedOperationError(f"an array of {array.kind} where one of {kind} belongs")
        return array
    if array.size and array.item(0).kind != kind:
        raise UnsupportedOperationError(f"an array of {array.item(0).kind} where one of {kind} belongs")
    return array


def _linear_solve(code: Code, equation: Any, given: Sequence[Array]) -> list[Array]:
    """Emit the solver of linear equations with custom derivatives."""
    lengths = equation.params["const_lengths"]
    first = lengths.matvec + lengths.vecmat
    return _closed(code, equation.params["jaxprs"].solve, given[first : first + lengths.solve], given[sum(lengths) :])


def _number(code: Code, array: Array) -> Value:
    return values_of(code, array).item()


def _closed(code: Code, closed: Any, *given: Sequence[Array], late: bool = False) -> list[Array]:
    numbers = [constants(number) for number in closed.consts]
    return translate(code, closed.jaxpr, numbers, [array for group in given for array in group], late=late)


def _until_settled(code: Code, assumptions: Any, attempt: Callable[[Any], tuple[Any, Any]]) -> Any:
    """Return the results of an attempt to emit code whose assumptions hold, such as which arrays differ by lane.

    Parameters
    ----------
    assumptions : list of bool, or more
        Initial assumptions.
    attempt : callable
        Emits code under assumptions, and returns those that hold, possibly weaker ones, and its results.
    """
    while True:
        mark = code.mark()
        settled_as, results = attempt(assumptions)
        if settled_as == assumptions:
            return results
        code.back_to(mark)
        assumptions = settled_as


def _in_lanes(arrays: Sequence[Array], previous: Sequence[bool] | None = None) -> list[bool]:
    """Return which arrays have numbers that differ from lane to lane, or did so already."""
    previous = [False] * len(arrays) if previous is None else previous
    return [before or any_lanes([array]) for before, array in zip(previous, arrays, strict=True)]


def _likely(code: Code, arrays: Sequence[Array], avals: Sequence[Any]) -> list[bool]:
    """Return which arrays that a loop carries are assumed to differ by lane: all but integers that do not yet."""
    return [a or b for a, b in zip(_in_lanes(arrays), _likely_made(code, avals), strict=True)]


def _likely_made(code: Code, avals: Sequence[Any]) -> list[bool]:
    """Return which new arrays are assumed to differ from lane to lane."""
    return [kind_of(aval.dtype) == "f" and not code.single for aval in avals]


def _while(code: Code, equation: Any, given: Sequence[Array]) -> list[Array]:
    """Emit a loop that each lane leaves when its condition no longer holds."""
    p = equation.params
    split = p["cond_nconsts"], p["cond_nconsts"] + p["body_nconsts"]
    condition, captured, start = given[: split[0]], given[split[0] : split[1]], given[split[1] :]

    def attempt(assumptions: tuple[list[bool], list[dict[int, Value]]]) -> tuple[Any, list[Array]]:
        lanes, invariants = assumptions
        state = LoopVariables(code, avals, lanes, invariants)
        state.store(start)
        head, body, end = code.label(), code.label(), code.label()
        code.jump(head)
        code.begin(head)
        with code.scope(), state.held():
            before = state.load()
            with code.used(among([*condition, *captured, *before])):
                goes = code.among_active(_number(code, _closed(code, p["cond_jaxpr"], condition, before)[0]))
            if goes.lanes and not all(lanes):  # a lane that has left keeps its own values
                return ([True] * len(lanes), invariants), []
            code.branch(code.anywhere(goes), body, end)
            code.begin(body)
            live = [*condition, *captured, *(before if goes.lanes else ())]
            with code.scope(goes if goes.lanes else None), code.used(among(live)), code.changing(state.regions):
                after = _closed(code, p["body_jaxpr"], captured, before, late=True)
                if goes.lanes:
                    after = chosen(code, goes, after, state.load(new=after))
                state.store(after)
                release_arrays(code, after)
            code.jump(head)
        code.begin(end)
        return (_in_lanes(after, lanes), [*map(still_invariant, invariants, after)]), state.load()

    avals = [variable.aval for variable in equation.outvars]
    return _until_settled(code, (_likely(code, start, avals), [invariants_of(code, x) for x in start]), attempt)


def _scan(code: Code, equation: Any, given: Sequence[Array]) -> Sequence[Array]:
    """Emit a loop of known length over the first axis of arrays."""
    p = equation.params
    fixed, carry = sizes_of_scan(equation)
    captured, start, rows = given[:fixed], given[fixed : fixed + carry], given[fixed + carry :]
    types = [variable.aval for variable in equation.outvars[len(start) :]]
    if p["length"] == 0:
        return [*start, *(np.empty(aval.shape, object) for aval in types)]
    line_limit = MOST_UNROLLED if code.large is None else MOST_UNROLLED_IN_MEMORY
    if code.large is None and _needs_known_indices(p["jaxpr"].jaxpr):
        line_limit = code.most
    if (unrolled := _unrolled(code, equation, captured, start, rows, line_limit)) is not None:
        return unrolled
    mark = code.mark()
    try:
        return _rolled(code, equation, captured, start, rows)
    except UnsupportedOperationError:  # of indices that change from iteration to iteration
        code.back_to(mark)
        if (unrolled := _unrolled(code, equation, captured, start, rows, code.most)) is None:
            raise
        return unrolled


def _needs_known_indices(program: Any) -> bool:
    """Return whether a program has operations that need constant indices."""
    return any(
        equation.primitive.name.startswith("scatter")
        or any(map(_needs_known_indices, jaxprs_in_params(equation.params)))
        for equation in program.eqns
    )


def _rolled(
    code: Code, equation: Any, captured: Sequence[Array], start: Sequence[Array], rows: Sequence[Array]
) -> list[Array]:
    """Emit a loop of known length as a loop."""
    p, size = equation.params, len(start)
    made = [variable.aval for variable in equation.outvars[size:]]
    last = code.constant(p["length"] - 1, "l")

    def attempt(assumptions: tuple[list[bool], list[dict[int, Value]]]) -> tuple[Any, list[Array]]:
        lanes, invariants = assumptions
        state = LoopVariables(code, [variable.aval for variable in equation.outvars[:size]], lanes[:size], invariants)
        output_rows, counter = LoopVariables(code, made, lanes[size:]), code.room(1, "l", lanes=False)
        state.store(start)
        code.store(counter, 0, code.constant(0, "l"))
        homes = [stored(code, array) if array.size else array for array in rows]
        body, end = code.label(), code.label()
        code.jump(body)
        code.begin(body)
        with (
            code.scope(),
            code.used(among([*captured, *homes])),
            state.held(),
            output_rows.held(),
            code.changing(state.regions),
        ):
            count = code.load(counter, 0)
            index = code.arithmetic("sub", last, count) if p["reverse"] else count
            inputs = [row(code, array, index) if array.size else np.empty(array.shape[1:], object) for array in homes]
            results = _closed(code, p["jaxpr"], captured, state.load(), inputs, late=True)
            for region, array in zip(output_rows.regions, results[size:], strict=True):
                if array.size:
                    put(code, contiguous(region, array.shape, further(code, 0, index, array.size)), array)
            output_rows.note_rows(results[size:], p["length"])
            state.store(results[:size])  # last, since other results may be parts of the carried arrays
            release_arrays(code, results)
            code.store(counter, 0, code.arithmetic("add", count, code.constant(1, "l")))
            code.branch(code.operand(code.compare("lt", count, last), lanes=False), body, end)
        code.begin(end)
        still_constant = [*map(still_invariant, invariants, results[:size])]
        return (_in_lanes(results, lanes), still_constant), [*state.load(), *output_rows.load()]

    likely = [*_likely(code, start, [variable.aval for variable in equation.outvars[:size]]), *_likely_made(code, made)]
    return _until_settled(code, (likely, [invariants_of(code, x) for x in start]), attempt)


def _unrolled(
    code: Code, equation: Any, captured: Sequence[Array], start: Sequence[Array], rows: Sequence[Array], limit: int
) -> list[Array] | None:
    """Return the results of an unrolled loop; None if it takes more than `limit` lines.

    It is given up early if the iterations so far, of which the first are the longest, are too long.
    """
    p, mark, before = equation.params, code.mark(), len(code.lines)
    size, result, live = len(start), {}, regions_of([*captured, *rows])
    for k in reversed(range(p["length"])) if p["reverse"] else range(p["length"]):
        with code.used(live.__contains__):
            results = _closed(code, p["jaxpr"], captured, start, [row(code, array, k) for array in rows])
        start, result[k] = results[:size], results[size:]
        live |= regions_of(result[k])
        lines, remaining = len(code.lines) - before, p["length"] - len(result)
        if p["length"] > 1 and lines + lines / len(result) / HOPE * remaining > limit:
            code.back_to(mark)
            return None
    columns = [[result[k][index] for k in range(p["length"])] for index in range(len(equation.outvars) - size)]
    return [*start, *(_stacked(code, parts) for parts in columns)]


def _stacked(code: Code, parts: Sequence[Array]) -> Array:
    single = [part for part in parts if isinstance(part, np.ndarray)]
    if len(single) == len(parts) and (code.large is None or len(parts) * parts[0].size <= code.large):
        return np.stack(single)
    result = new_storage(code, (len(parts), *parts[0].shape), kind_in(parts[0]), lanes=any_lanes(parts))
    for k, part in enumerate(parts):
        put(code, contiguous(result.region, part.shape, k * part.size), part)
    return result


def _cond(code: Code, equation: Any, given: Sequence[Array]) -> list[Array]:
    """Emit the branches of a conditional, of which each lane takes one: all that any lane takes are run."""
    ways, branch, inputs = equation.params["branches"], _number(code, given[0]), given[1:]
    branch = code.converted(branch, "i") if branch.kind == "b" else branch
    if len(ways) == 1 or branch.constant is not None:
        return _closed(code, ways[min(max(int(branch.constant or 0), 0), len(ways) - 1)], inputs)
    passed_through = unchanged([way.jaxpr for way in ways], inputs)
    changed_indices = [k for k, array in enumerate(passed_through) if array is None]
    avals = [equation.outvars[k].aval for k in changed_indices]
    in_place = changed_in_place(code, branch, ways[0].jaxpr, inputs, changed_indices)
    homes = Homes(inputs)

    def attempt(lanes: list[bool]) -> tuple[list[bool], list[Array]]:
        results, differing = LoopVariables(code, avals, lanes, regions=in_place), lanes
        for k, way in enumerate(ways):
            homes.restore()
            word = "le" if k == 0 else "ge" if k == len(ways) - 1 else "eq"
            taken = code.among_active(code.compare(word, branch, code.constant(k, branch.kind)))
            start, end = code.label(), code.label()
            code.branch(code.anywhere(taken), start, end)
            code.begin(start)
            with (
                code.scope(taken if taken.lanes else None),
                code.used(among(inputs if k < len(ways) - 1 or taken.lanes else [])),
            ):
                results_of_branch = _closed(code, way, inputs)
                changed_results = [results_of_branch[k] for k in changed_indices]
                differing = _in_lanes(changed_results, differing)
                if branch.lanes and k > 0:
                    changed_results = chosen(code, taken, changed_results, results.load(k, changed_results))
                results.store(changed_results)
            code.jump(end)
            code.begin(end)
        results.note_invariants(len(ways))
        return differing, results.load()

    likely = [
        branch.lanes or likely or region is not None
        for likely, region in zip(_likely_made(code, avals), in_place, strict=True)
    ]
    changed = iter(_until_settled(code, likely, attempt))
    homes.forget(in_place)
    return [next(changed) if array is None else array for array in passed_through]


def _subroutine(code: Code, equation: Any, given: Sequence[Array]) -> list[Array]:
    """Emit a call of a subroutine, or inline its program if arrays may be in memory."""
    if code.large is not None:
        return _closed(code, equation.params["jaxpr"], given)
    return [*call_subroutine(code, equation, [values_of(code, array) for array in given], _closed)]


_CONTROL = {
    "while": _while,
    "scan": _scan,
    "cond": _cond,
    "custom_linear_solve": _linear_solve,
    "ffi_call": call,
    "jit": _subroutine,
    "pjit": _subroutine,
}
