"""A program of JAX for one instant as code for a vector of lanes, each with a way of its own through it.

Where lanes part, all ways that some lane takes are run, and each keeps what its own one gives; a loop runs until the
last lane that is in it has left. So the results of a lane depend on no other.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jax.extend.core import Literal, jaxprs_in_params

from jounce.native.arrays import Values, constants, each, filled, in_memory, row
from jounce.native.code import Code, flat
from jounce.native.operations import RULES
from jounce.native.values import Region, UnsupportedOperationError, Value, kind_of

MOST_UNROLLED = 4_000  # lines of a loop of known length that is written turn after turn
HOPE = 8  # times as many lines as in a later turn may be in one of the first, which later ones have in common with it


def translate(code: Code, program: Any, constants_: Sequence[Values], given: Sequence[Values]) -> list[Values]:
    """Write the operations of a program, and return its results.

    Parameters
    ----------
    code : Code
        What is written to.
    program : Jaxpr
    constants_, given : sequence of arrays of Value
        Its constants and arguments.

    Raises
    ------
    UnsupportedOperationError
        Where there is no code for an operation.
    """
    known: dict[Any, Values] = dict(zip(program.constvars, constants_, strict=True))
    known |= zip(program.invars, given, strict=True)

    def read(variable: Any) -> Values:
        if isinstance(variable, Literal):
            aval: Any = variable.aval
            return constants(code, np.asarray(variable.val, aval.dtype))
        return known[variable]

    for equation in program.eqns:
        inputs = [read(variable) for variable in equation.invars]
        name = equation.primitive.name
        if (rule := _CONTROL.get(name) or RULES.get(name)) is None:
            raise UnsupportedOperationError(name)
        for variable, values in zip(equation.outvars, rule(code, equation, inputs), strict=True):
            known[variable] = _checked(values, variable.aval)
    return [read(variable) for variable in program.outvars]


def _checked(values: Any, aval: Any) -> Values:
    """Return values as an array, as NumPy does not for a lone one: of the shape and the kind that JAX has for it."""
    array = values if isinstance(values, np.ndarray) else filled((), [values])
    if array.shape != aval.shape:
        raise AssertionError(f"an array of shape {array.shape} where one of {aval.shape} belongs")
    kind = kind_of(aval.dtype)
    if array.size and array.item(0).kind != kind:
        raise UnsupportedOperationError(f"an array of {array.item(0).kind} where one of {kind} belongs")
    return array


def _called(code: Code, equation: Any, given: Sequence[Values]) -> list[Values]:
    """Write a program within the program."""
    p = equation.params
    closed = next(p[name] for name in ("jaxpr", "call_jaxpr", "fun_jaxpr") if name in p)
    return _closed(code, closed, given) if hasattr(closed, "jaxpr") else translate(code, closed, (), given)


def _closed(code: Code, closed: Any, *given: Sequence[Values]) -> list[Values]:
    numbers = [constants(code, number) for number in closed.consts]
    return translate(code, closed.jaxpr, numbers, [array for some in given for array in some])


class _Carried:
    """Arrays that a loop or a branch changes, in memory."""

    def __init__(self, code: Code, avals: Sequence[Any], lanes: Sequence[bool]):
        self.code, self.shapes = code, [aval.shape for aval in avals]
        self.regions = [
            code.room(int(np.prod(aval.shape)), kind_of(aval.dtype), lanes=vector)
            for aval, vector in zip(avals, lanes, strict=True)
        ]

    def load(self) -> list[Values]:
        """Return the arrays as they are."""
        return [
            filled(shape, [self.code.load(region, k) for k in range(int(np.prod(shape)))])
            for region, shape in zip(self.regions, self.shapes, strict=True)
        ]

    def store(self, arrays: Sequence[Values]) -> None:
        """Change the arrays: where a number is what was there when it was loaded, there is nothing to do."""
        for region, array in zip(self.regions, arrays, strict=True):
            for k, value in enumerate(flat(array)):
                if value.home != (region, k):
                    self.code.store(region, k, value)


def _until_settled(code: Code, lanes: list[bool], attempt: Callable[[list[bool]], tuple[list[bool], Any]]) -> Any:
    """Return what an attempt gives that knows of each array whether its numbers differ from lane to lane.

    Parameters
    ----------
    lanes : list of bool
        What is known of the arrays before.
    attempt : callable
        Writes code, and returns which arrays differ, more than it was told if it has found so, and its results.
    """
    while True:
        mark = code.mark()
        found, results = attempt(lanes)
        if found == lanes:
            return results
        code.back_to(mark)
        lanes = found


def _in_lanes(arrays: Sequence[Values], already: Sequence[bool] | None = None) -> list[bool]:
    """Tell which arrays have numbers that differ from lane to lane, or did already."""
    already = [False] * len(arrays) if already is None else already
    return [before or any(v.lanes for v in flat(array)) for before, array in zip(already, arrays, strict=True)]


def _likely(arrays: Sequence[Values]) -> list[bool]:
    """Tell which arrays that a loop changes are taken to differ from lane to lane: all but counts that do not yet."""
    return [
        lanes or any(v.kind == "f" for v in flat(array)) for lanes, array in zip(_in_lanes(arrays), arrays, strict=True)
    ]


def _likely_made(avals: Sequence[Any]) -> list[bool]:
    """Tell which arrays that are made are taken to differ from lane to lane."""
    return [kind_of(aval.dtype) == "f" for aval in avals]


def _chosen(code: Code, choice: Value, new: Sequence[Values], old: Sequence[Values]) -> list[Values]:
    return [each(lambda a, b: code.select(choice, a, b), x, y) for x, y in zip(new, old, strict=True)]


def _while(code: Code, equation: Any, given: Sequence[Values]) -> list[Values]:
    """Write a loop that each lane leaves when its condition no longer holds."""
    p = equation.params
    split = p["cond_nconsts"], p["cond_nconsts"] + p["body_nconsts"]
    asked, needed, start = given[: split[0]], given[split[0] : split[1]], given[split[1] :]

    def attempt(lanes: list[bool]) -> tuple[list[bool], list[Values]]:
        carried = _Carried(code, [variable.aval for variable in equation.outvars], lanes)
        carried.store(start)
        head, body, end = code.label(), code.label(), code.label()
        code.jump(head)
        code.begin(head)
        with code.scope():
            before = carried.load()
            goes = code.among_here(_closed(code, p["cond_jaxpr"], asked, before)[0].item())
            if goes.lanes and not all(lanes):  # what a lane keeps that has left differs
                return [True] * len(lanes), []
            code.branch(code.anywhere(goes), body, end)
            code.begin(body)
            with code.scope(goes if goes.lanes else None):
                after = _closed(code, p["body_jaxpr"], needed, before)
                if goes.lanes:
                    after = _chosen(code, goes, after, before)
                carried.store(after)
            code.jump(head)
        code.begin(end)
        return _in_lanes(after, lanes), carried.load()

    return _until_settled(code, _likely(start), attempt)


def _scan(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Write a loop of known length over the first axis of arrays."""
    p = equation.params
    split = p["num_consts"], p["num_consts"] + p["num_carry"]
    needed, start, rows = given[: split[0]], given[split[0] : split[1]], given[split[1] :]
    made = [variable.aval for variable in equation.outvars[len(start) :]]
    if p["length"] == 0:
        return [*start, *(np.empty(aval.shape, object) for aval in made)]
    most = code.most if _needs_known_places(p["jaxpr"].jaxpr) else MOST_UNROLLED
    if (unrolled := _unrolled(code, equation, needed, start, rows, most)) is not None:
        return unrolled
    mark = code.mark()
    try:
        return _rolled(code, equation, needed, start, rows)
    except UnsupportedOperationError:  # of places that change from turn to turn
        code.back_to(mark)
        if (unrolled := _unrolled(code, equation, needed, start, rows, code.most)) is None:
            raise
        return unrolled


def _needs_known_places(program: Any) -> bool:
    """Tell whether a program has operations for which there is code only where their indices are known."""
    return any(
        equation.primitive.name.startswith("scatter")
        or any(map(_needs_known_places, jaxprs_in_params(equation.params)))
        for equation in program.eqns
    )


def _rolled(
    code: Code, equation: Any, needed: Sequence[Values], start: Sequence[Values], rows: Sequence[Values]
) -> list[Values]:
    """Write a loop of known length as one."""
    p, size = equation.params, len(start)
    made = [variable.aval for variable in equation.outvars[size:]]
    last = code.constant(p["length"] - 1, "l")

    def attempt(lanes: list[bool]) -> tuple[list[bool], list[Values]]:
        carried = _Carried(code, [variable.aval for variable in equation.outvars[:size]], lanes[:size])
        written, counter = _Carried(code, made, lanes[size:]), code.room(1, "l", lanes=False)
        carried.store(start)
        code.store(counter, 0, code.constant(0, "l"))
        homes = [in_memory(code, flat(array)) if array.size else None for array in rows]
        body, end = code.label(), code.label()
        code.jump(body)
        code.begin(body)
        with code.scope():
            count = code.load(counter, 0)
            at = code.arithmetic("sub", last, count) if p["reverse"] else count
            taken = [_row(code, home, array, at) for home, array in zip(homes, rows, strict=True)]
            results = _closed(code, p["jaxpr"], needed, carried.load(), taken)
            carried.store(results[:size])
            for region, array in zip(written.regions, results[size:], strict=True):
                _put(code, region, at, array)
            code.store(counter, 0, code.arithmetic("add", count, code.constant(1, "l")))
            code.branch(code.operand(code.compare("lt", count, last), lanes=False), body, end)
        code.begin(end)
        return _in_lanes(results, lanes), [*carried.load(), *written.load()]

    return _until_settled(code, [*_likely(start), *_likely_made(made)], attempt)


def _row(code: Code, home: tuple[Region, int] | None, array: Values, index: Value) -> Values:
    return np.empty(array.shape[1:], object) if home is None else row(code, home, index, array.shape[1:])


def _put(code: Code, region: Region, index: Value, array: Values) -> None:
    """Put a row of numbers at an index."""
    first = code.arithmetic("mul", index, code.constant(array.size, "l"))
    for k, value in enumerate(flat(array)):
        code.store(region, code.arithmetic("add", first, code.constant(k, "l")), value)


def _unrolled(
    code: Code, equation: Any, needed: Sequence[Values], start: Sequence[Values], rows: Sequence[Values], most: int
) -> list[Values] | None:
    """Return the results of a loop turn after turn; None where that takes more lines than `most`.

    It is given up early where the turns so far, of which the first are longer than the others, leave no hope.
    """
    p, mark, before = equation.params, code.mark(), len(code.lines)
    size, found = len(start), {}
    for k in reversed(range(p["length"])) if p["reverse"] else range(p["length"]):
        results = _closed(code, p["jaxpr"], needed, start, [array[k, ...] for array in rows])
        start, found[k] = results[:size], results[size:]
        lines, left = len(code.lines) - before, p["length"] - len(found)
        if p["length"] > 1 and lines + lines / len(found) / HOPE * left > most:
            code.back_to(mark)
            return None
    made = [[found[k][place] for k in range(p["length"])] for place in range(len(equation.outvars) - size)]
    return [*start, *(np.stack(parts) for parts in made)]


def _cond(code: Code, equation: Any, given: Sequence[Values]) -> list[Values]:
    """Write ways of which each lane takes one: all that some lane takes are run."""
    ways, which, inputs = equation.params["branches"], given[0].item(), given[1:]
    which = code.converted(which, "i") if which.kind == "b" else which
    if len(ways) == 1 or which.constant is not None:
        return _closed(code, ways[min(max(int(which.constant or 0), 0), len(ways) - 1)], inputs)

    def attempt(lanes: list[bool]) -> tuple[list[bool], list[Values]]:
        results, found = _Carried(code, [variable.aval for variable in equation.outvars], lanes), lanes
        for k, way in enumerate(ways):
            word = "le" if k == 0 else "ge" if k == len(ways) - 1 else "eq"
            here = code.among_here(code.compare(word, which, code.constant(k, which.kind)))
            begin, end = code.label(), code.label()
            code.branch(code.anywhere(here), begin, end)
            code.begin(begin)
            with code.scope(here if here.lanes else None):
                made = _closed(code, way, inputs)
                found = _in_lanes(made, found)
                if which.lanes and k > 0:
                    made = _chosen(code, here, made, results.load())
                results.store(made)
            code.jump(end)
            code.begin(end)
        return found, results.load()

    avals = [variable.aval for variable in equation.outvars]
    return _until_settled(code, [which.lanes or likely for likely in _likely_made(avals)], attempt)


_CALLS = ("jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "checkpoint", "remat2")
_CONTROL = dict.fromkeys(_CALLS, _called) | {"while": _while, "scan": _scan, "cond": _cond}
