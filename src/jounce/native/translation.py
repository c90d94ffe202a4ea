"""A program of JAX for one instant as code for a vector of lanes, each with a way of its own through it.

Where lanes part, all ways that some lane takes are run, and each keeps what its own one gives; a loop runs until the
last lane has left it. So the results of a lane depend on no other.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jax.extend.core import Literal, jaxprs_in_params

from jounce.native.code import DTYPES, Code, Region, UnsupportedOperationError, Value, flat
from jounce.native.operations import RULES, Values, constants, kind_of, loaded

MOST_UNROLLED = 4_000
MOST_LINES = 120_000  # of text: LLVM makes some 20,000 of them into machine code in a second


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
            return constants(code, np.asarray(variable.val, variable.aval.dtype))
        return known[variable]

    for equation in program.eqns:
        inputs = [read(variable) for variable in equation.invars]
        name = equation.primitive.name
        if (rule := _CONTROL.get(name) or RULES.get(name)) is None:
            raise UnsupportedOperationError(name)
        for variable, values in zip(equation.outvars, rule(code, equation, inputs), strict=True):
            known[variable] = _as_array(values, variable.aval.shape)
        if len(code.lines) > code.most:
            raise UnsupportedOperationError(f"more than {code.most} lines")
    return [read(variable) for variable in program.outvars]


def _as_array(values: Any, shape: tuple[int, ...]) -> Values:
    """Return values as an array: NumPy makes a lone object of one without axes."""
    array = values if isinstance(values, np.ndarray) else np.full((), values, object)
    if array.shape != shape:
        raise AssertionError(f"an array of shape {array.shape} where one of {shape} belongs")
    return array


def _called(code: Code, equation: Any, given: Sequence[Values]) -> list[Values]:
    """A program within the program."""
    closed = equation.params.get("jaxpr") or equation.params.get("call_jaxpr") or equation.params["fun_jaxpr"]
    program = getattr(closed, "jaxpr", closed)
    return translate(code, program, [constants(code, number) for number in getattr(closed, "consts", ())], given)


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
        return [_from(self.code, region, shape) for region, shape in zip(self.regions, self.shapes, strict=True)]

    def store(self, arrays: Sequence[Values]) -> None:
        """Change the arrays."""
        for region, array in zip(self.regions, arrays, strict=True):
            for k, value in enumerate(flat(array)):
                if value.home is None or value.home[0] is not region or value.home[1] != k:
                    self.code.store(region, k, value)


def _from(code: Code, region: Region, shape: tuple[int, ...]) -> Values:
    found = np.empty(shape, object)
    found.ravel()[:] = [code.load(region, k) for k in range(found.size)]
    return found


def _in_lanes(arrays: Sequence[Values]) -> list[bool]:
    """Tell which arrays have numbers that differ from lane to lane."""
    return [any(value.lanes for value in flat(array)) for array in arrays]


def _likely_in_lanes(arrays: Sequence[Values]) -> list[bool]:
    """Tell which arrays that a loop changes are taken to differ from lane to lane: all but counts that do not yet."""
    return [lanes or any(value.kind == "f" for value in flat(array)) for lanes, array in zip(_in_lanes(arrays), arrays, strict=True)]


def _closed(code: Code, closed: Any, *given: Sequence[Values]) -> list[Values]:
    numbers = [constants(code, number) for number in closed.consts]
    return translate(code, closed.jaxpr, numbers, [array for part in given for array in part])


def _while(code: Code, equation: Any, given: Sequence[Values]) -> list[Values]:
    """A loop that each lane leaves when its condition no longer holds."""
    p = equation.params
    split = p["cond_nconsts"], p["cond_nconsts"] + p["body_nconsts"]
    asked, needed, start = given[: split[0]], given[split[0] : split[1]], given[split[1] :]
    avals, lanes = [variable.aval for variable in equation.outvars], _likely_in_lanes(start)
    while True:  # until no array is found to differ from lane to lane that was thought not to
        mark = code.mark()
        carried = _Carried(code, avals, lanes)
        carried.store(start)
        head, body, end = code.label(), code.label(), code.label()
        code.jump(head)
        code.begin(head)
        with code.scope():
            before = carried.load()
            goes = _closed(code, p["cond_jaxpr"], asked, before)[0].item()
            code.branch(code.anywhere(goes), body, end)
            code.begin(body)
            found = [True] * len(lanes)
            if not goes.lanes or found == lanes:  # where lanes leave at different turns, all that they keep differs
                after = _closed(code, p["body_jaxpr"], needed, before)
                if goes.lanes:
                    after = [_chosen(code, goes, new, old) for new, old in zip(after, before, strict=True)]
                found = [a or b for a, b in zip(lanes, _in_lanes(after), strict=True)]
                carried.store(after)
            code.jump(head)
        if found == lanes:
            code.begin(end)
            return carried.load()
        code.back_to(mark)
        lanes = found


def _chosen(code: Code, choice: Value, new: Values, old: Values) -> Values:
    found = np.empty(new.shape, object)
    found.ravel()[:] = [code.select(choice, a, b) for a, b in zip(flat(new), flat(old), strict=True)]
    return found


def _scan(code: Code, equation: Any, given: Sequence[Values]) -> list[Values]:
    """A loop of known length over the first axis of arrays."""
    p = equation.params
    split = p["num_consts"], p["num_consts"] + p["num_carry"]
    needed, start, rows = given[: split[0]], given[split[0] : split[1]], given[split[1] :]
    avals, length, closed = [variable.aval for variable in equation.outvars], p["length"], p["jaxpr"]
    carries = p["num_carry"]
    if length == 0:
        return [*start, *(np.empty(aval.shape, object) for aval in avals[carries:])]
    if length == 1:
        results = _closed(code, closed, needed, start, [row[0, ...] for row in rows])
        return [*results[:carries], *(_as_array(row, aval.shape[1:])[None] for row, aval in zip(results[carries:], avals[carries:], strict=True))]
    most = code.most if _needs_known_places(closed.jaxpr) else MOST_UNROLLED
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
        equation.primitive.name in ("scatter", "scatter-add") or any(map(_needs_known_places, jaxprs_in_params(equation.params)))
        for equation in program.eqns
    )


def _rolled(
    code: Code, equation: Any, needed: Sequence[Values], start: Sequence[Values], rows: Sequence[Values]
) -> list[Values]:
    """Return the results of a loop that is one in the code, too."""
    p, avals = equation.params, [variable.aval for variable in equation.outvars]
    carries, length, closed = p["num_carry"], p["length"], p["jaxpr"]
    lanes = [*_likely_in_lanes(start), *(kind_of(aval.dtype) == "f" for aval in avals[carries:])]
    one, last = code.constant(np.int64(1)), code.constant(np.int64(length - 1))
    while True:
        mark = code.mark()
        carried, written = _Carried(code, avals[:carries], lanes[:carries]), _Carried(code, avals[carries:], lanes[carries:])
        counter = code.room(1, "l", lanes=False)
        carried.store(start)
        code.store(counter, 0, code.constant(np.int64(0)))
        kept = [(_kept(code, row), row) for row in rows]
        body, end = code.label(), code.label()
        code.jump(body)
        code.begin(body)
        with code.scope():
            count = code.load(counter, 0)
            at = code.arithmetic("sub", last, count) if p["reverse"] else count
            results = _closed(code, closed, needed, carried.load(), [loaded(code, row, at) for row, _ in kept])
            results = [_as_array(x, aval.shape[k >= carries :]) for k, (x, aval) in enumerate(zip(results, avals, strict=True))]
            found = [a or b for a, b in zip(lanes, _in_lanes(results), strict=True)]
            carried.store(results[:carries])
            for region, row in zip(written.regions, results[carries:], strict=True):
                first = code.arithmetic("mul", at, code.constant(np.int64(row.size)))
                for k, value in enumerate(flat(row)):
                    code.store(region, code.arithmetic("add", first, code.constant(np.int64(k))), value)
            code.store(counter, 0, code.arithmetic("add", count, one))
            code.branch(code.operand(code.compare("lt", count, last), lanes=False), body, end)
        if found == lanes:
            code.begin(end)
            return [*carried.load(), *written.load()]
        code.back_to(mark)
        lanes = found


def _unrolled(
    code: Code, equation: Any, needed: Sequence[Values], start: Sequence[Values], rows: Sequence[Values], most: int
) -> list[Values] | None:
    """Return the results of a loop turn after turn; None where that takes more lines than `most`."""
    p, mark, begin = equation.params, code.mark(), len(code.lines)
    carries, found = p["num_carry"], {}
    for k in reversed(range(p["length"])) if p["reverse"] else range(p["length"]):
        results = _closed(code, p["jaxpr"], needed, start, [row[k, ...] for row in rows])
        start, found[k] = results[:carries], results[carries:]
        if (len(code.lines) - begin) * p["length"] / len(found) > most:
            code.back_to(mark)
            return None
    made = [[found[k][place] for k in range(p["length"])] for place in range(len(equation.outvars) - carries)]
    return [*start, *(np.stack(parts) for parts in made)]


def _kept(code: Code, rows: Values) -> Values:
    """Return rows of numbers that lie in memory before a loop takes them from there one after another."""
    values = flat(rows)
    homes = [value.home for value in values]
    if homes and homes[0] is not None and all(
        home is not None and home[0] is homes[0][0] and home[1] == homes[0][1] + k for k, home in enumerate(homes)
    ):
        return rows
    if not values:
        return rows
    region = code.room(len(values), values[0].kind, lanes=any(value.lanes for value in values))
    found = np.empty(rows.shape, object)
    for k, value in enumerate(values):
        code.store(region, k, value)
    found.ravel()[:] = [Value(value.name, value.kind, region.lanes, None, (region, k)) for k, value in enumerate(values)]
    return found


def _cond(code: Code, equation: Any, given: Sequence[Values]) -> list[Values]:
    """Ways of which each lane takes one: all that some lane takes are run."""
    ways, which, inputs = equation.params["branches"], given[0].item(), given[1:]
    if which.constant is not None:
        return _closed(code, ways[min(max(int(which.constant), 0), len(ways) - 1)], inputs)
    avals = [variable.aval for variable in equation.outvars]
    if which.kind == "b":
        raise UnsupportedOperationError("a choice by a truth value")
    lanes = [which.lanes or kind_of(aval.dtype) == "f" for aval in avals]
    while True:
        mark = code.mark()
        results, found = _Carried(code, avals, lanes), list(lanes)
        for k, way in enumerate(ways):
            number = code.constant(np.asarray(k, DTYPES[which.kind]))
            word = "le" if k == 0 else "ge" if k == len(ways) - 1 else "eq"
            here = code.compare(word, which, number)
            begin, end = code.label(), code.label()
            code.branch(code.anywhere(here), begin, end)
            code.begin(begin)
            with code.scope():
                made = _closed(code, way, inputs)
                found = [a or b for a, b in zip(found, _in_lanes(made), strict=True)]
                if which.lanes and k > 0:
                    made = [_chosen(code, here, new, old) for new, old in zip(made, results.load(), strict=True)]
                results.store(made)
            code.jump(end)
            code.begin(end)
        if found == lanes:
            return results.load()
        code.back_to(mark)
        lanes = found


_CONTROL = {
    **dict.fromkeys(("jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "checkpoint", "remat2"), _called),
    "while": _while,
    "scan": _scan,
    "cond": _cond,
}
