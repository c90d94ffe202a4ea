"""What each of JAX's operations on arrays is in scalar operations: arrays are NumPy arrays of values."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jax.lax import GatherScatterMode

from jounce.native.code import DTYPES, KINDS, Code, UnsupportedOperationError, Value, flat

Values = np.ndarray  # of objects, each a Value
Rule = Callable[[Code, Any, Sequence[Values]], Sequence[Values]]
MOST_SORTED = 16  # numbers
MOST_CANDIDATES = 64  # places of an array among which a number is picked by comparing

FUNCTIONS = {  # of C's library, by the names that JAX has for them
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh", "asinh": "asinh", "acosh": "acosh", "atanh": "atanh",
    "exp": "exp", "exp2": "exp2", "expm1": "expm1", "log": "log", "log1p": "log1p", "cbrt": "cbrt",
    "erf": "erf", "erfc": "erfc", "atan2": "atan2", "pow": "pow",
}  # fmt: skip


def constants(code: Code, array: Any) -> Values:
    """Return an array of constants."""
    array = np.asarray(array)
    values = np.empty(array.shape, object)
    values.ravel()[:] = [code.constant(number) for number in array.ravel()]
    return values


def each(function: Callable[..., Value], *arrays: Values) -> Values:
    """Return what a function gives for each element of arrays, which are spread to one shape."""
    spread = np.broadcast_arrays(*arrays)
    found = np.empty(spread[0].shape, object)
    found.ravel()[:] = list(map(function, *(part.ravel() for part in spread)))
    return found


def sum_of(code: Code, values: Sequence[Value], kind: str) -> Value:
    """Return the sum of numbers."""
    total = code.constant(np.zeros((), DTYPES[kind]))
    for value in values:
        total = code.arithmetic("add", total, value)
    return total


# -- of each element ------------------------------------------------------------------------------------------------


def _arithmetic(operation: str) -> Rule:
    def rule(code: Code, _: Any, given: Sequence[Values]) -> Sequence[Values]:
        if given[0].size and flat(given[0])[0].kind == "b":
            logic = {"add": "or", "max": "or", "mul": "and", "min": "and"}[operation]
            return [each(lambda a, b: code.logic(logic, a, b), *given)]
        return [each(lambda a, b: code.arithmetic(operation, a, b), *given)]

    return rule


def _compare(operation: str) -> Rule:
    return lambda code, _, given: [each(lambda a, b: code.compare(operation, a, b), *given)]


def _logic(operation: str) -> Rule:
    return lambda code, _, given: [each(lambda a, b: code.logic(operation, a, b), *given)]


def _intrinsic(operation: str) -> Rule:
    return lambda code, _, given: [each(lambda a: code.intrinsic(operation, a), given[0])]


def _function(name: str) -> Rule:
    return lambda code, _, given: [each(lambda *a: code.call(name, *(code.converted(x, "f") for x in a)), *given)]


def _unary(function: Callable[[Code, Value], Value]) -> Rule:
    return lambda code, _, given: [each(lambda a: function(code, a), given[0])]


def _number(code: Code, number: float | int, like: Value) -> Value:
    return code.constant(np.asarray(number, DTYPES[like.kind]))


def _absolute(code: Code, a: Value) -> Value:
    return code.intrinsic("fabs", a) if a.kind == "f" else code.arithmetic("max", a, code.negated(a))


def _sign(code: Code, a: Value) -> Value:
    zero = _number(code, 0, a)
    below = code.select(code.compare("lt", a, zero), _number(code, -1, a), a)  # NaN and signed zeros stay
    return code.select(code.compare("gt", a, zero), _number(code, 1, a), below)


def _finite(code: Code, a: Value) -> Value:
    return code.compare("lt", code.intrinsic("fabs", a), code.constant(np.inf))


def _power(code: Code, exponent: int, a: Value) -> Value:
    power, result = a, None
    for digit in reversed(f"{abs(exponent):b}"):
        if digit == "1":
            result = power if result is None else code.arithmetic("mul", result, power)
        power = code.arithmetic("mul", power, power)
    result = _number(code, 1, a) if result is None else result
    return result if exponent >= 0 else code.arithmetic("div", _number(code, 1, a), result)


def _integer_power(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    return [each(lambda a: _power(code, equation.params["y"], a), given[0])]


def _round(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    away = equation.params["rounding_method"] == jax.lax.RoundingMethod.AWAY_FROM_ZERO
    return [each(lambda a: code.intrinsic("round" if away else "roundeven", a), given[0])]


def _convert(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    kind = kind_of(equation.params["new_dtype"])
    return [each(lambda a: code.converted(a, kind), given[0])]


def _select(code: Code, _: Any, given: Sequence[Values]) -> Sequence[Values]:
    which, *cases = given

    def choose(which: Value, *cases: Value) -> Value:
        if which.kind == "b":
            return code.select(which, cases[1], cases[0])
        found = cases[-1]
        for k, case in reversed(list(enumerate(cases[:-1]))):
            found = code.select(code.compare("le", which, _number(code, k, which)), case, found)
        return found

    return [each(choose, which, *cases)]


def _clamp(code: Code, _: Any, given: Sequence[Values]) -> Sequence[Values]:
    least, value, most = given
    above = each(lambda a, b: code.arithmetic("max", a, b), least, value)
    return [each(lambda a, b: code.arithmetic("min", a, b), above, most)]


# -- of axes --------------------------------------------------------------------------------------------------------


def _reduce(combine: Callable[[Code, Value, Value], Value], start: Callable[[Any], Any]) -> Rule:
    def rule(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
        axes, array = equation.params["axes"], given[0]
        kept = [axis for axis in range(array.ndim) if axis not in axes]
        together = int(np.prod([array.shape[axis] for axis in axes]))
        rows = array.transpose(*kept, *axes).reshape(*(array.shape[axis] for axis in kept), together)
        found = np.empty(rows.shape[:-1], object)
        for place in np.ndindex(found.shape):
            values = flat(rows[place])
            found[place] = values[0] if values else code.constant(start(equation.outvars[0].aval.dtype))
            for value in values[1:]:
                found[place] = combine(code, found[place], value)
        return [found]

    return rule


def _extreme(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return where the largest or smallest number along an axis is, the first of equals; NaN before all."""
    (axis,), word = equation.params["axes"], "gt" if equation.primitive.name == "argmax" else "lt"
    kind, rows = kind_of(equation.params["index_dtype"]), np.moveaxis(given[0], axis, -1)
    found = np.empty(rows.shape[:-1], object)
    for place in np.ndindex(found.shape):
        best, at = rows[place][0], code.constant(np.zeros((), DTYPES[kind]))
        for k, value in enumerate(flat(rows[place])[1:], 1):
            better = code.compare(word, value, best)
            if value.kind == "f":
                nan, known = code.compare("ne", value, value), code.compare("eq", best, best)
                better = code.logic("or", better, code.logic("and", nan, known))
            best, at = code.select(better, value, best), code.select(better, code.constant(np.asarray(k, DTYPES[kind])), at)
        found[place] = at
    return [found]


def _sort(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Sort arrays by the first of them, NaN last: neighbours change places until all are in order."""
    if equation.params["num_keys"] != 1:
        raise UnsupportedOperationError("sorting by several keys")
    arrays = [np.moveaxis(array, equation.params["dimension"], -1).copy() for array in given]
    size = arrays[0].shape[-1]
    if size > MOST_SORTED:
        raise UnsupportedOperationError(f"sorting {size} numbers")
    for place in np.ndindex(arrays[0].shape[:-1]):
        rows = [array[place] for array in arrays]
        for turn in range(size):
            for k in range(turn % 2, size - 1, 2):
                a, b = rows[0][k : k + 2].tolist()
                change = code.compare("lt", b, a)
                if a.kind == "f":
                    change = code.logic("or", change, code.logic("and", code.compare("ne", a, a), code.compare("eq", b, b)))
                for row in rows:
                    x, y = row[k : k + 2].tolist()
                    row[k], row[k + 1] = code.select(change, y, x), code.select(change, x, y)
    return [np.moveaxis(array, -1, equation.params["dimension"]) for array in arrays]


def _cumulative(operation: str) -> Rule:
    def rule(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
        axis, backward = equation.params["axis"], equation.params["reverse"]
        rows = np.moveaxis(given[0], axis, 0)
        rows = list(rows[::-1] if backward else rows)
        found = list(itertools.accumulate(rows, lambda a, b: each(lambda p, q: code.arithmetic(operation, p, q), a, b)))
        return [np.moveaxis(np.stack(found[::-1] if backward else found), 0, axis)]

    return rule


def _dot(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    (left_sum, right_sum), (left_batch, right_batch) = equation.params["dimension_numbers"]
    left, right = given

    def ordered(array: Values, batch: Sequence[int], summed: Sequence[int]) -> tuple[Values, list[int]]:
        free = [axis for axis in range(array.ndim) if axis not in (*batch, *summed)]
        shape = [array.shape[axis] for axis in free]
        sizes = [int(np.prod([array.shape[axis] for axis in part])) for part in (batch, free, summed)]
        return array.transpose(*batch, *free, *summed).reshape(sizes), shape

    a, first = ordered(left, left_batch, left_sum)
    b, second = ordered(right, right_batch, right_sum)
    kind = kind_of(equation.outvars[0].aval.dtype)
    found = np.empty((len(a), a.shape[1], b.shape[1]), object)
    for k, i, j in np.ndindex(found.shape):
        products = [code.arithmetic("mul", p, q) for p, q in zip(flat(a[k, i]), flat(b[k, j]), strict=True)]
        found[k, i, j] = sum_of(code, products, kind)
    return [found.reshape(*(left.shape[axis] for axis in left_batch), *first, *second)]


# -- of places ------------------------------------------------------------------------------------------------------


def _slice(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    p = equation.params
    strides = p["strides"] or (1,) * given[0].ndim
    return [given[0][tuple(map(slice, p["start_indices"], p["limit_indices"], strides))]]


def _broadcast(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    shape, axes = equation.params["shape"], equation.params["broadcast_dimensions"]
    placed = [1] * len(shape)
    for axis, size in zip(axes, given[0].shape, strict=True):
        placed[axis] = size
    return [np.broadcast_to(given[0].reshape(placed), shape)]


def _reshape(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    return [given[0].reshape(equation.outvars[0].aval.shape)]


def _pad(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    array, filler = given
    found = np.full(equation.outvars[0].aval.shape, filler.item(), object)
    places, taken = [], []
    for size, whole, (low, _high, between) in zip(array.shape, found.shape, equation.params["padding_config"], strict=True):
        at = low + np.arange(size) * (between + 1)
        inside = np.flatnonzero((at >= 0) & (at < whole))
        places.append(at[inside])
        taken.append(inside)
    found[np.ix_(*places)] = array[np.ix_(*taken)]
    return [found]


def _iota(code: Code, equation: Any, _: Sequence[Values]) -> Sequence[Values]:
    p = equation.params
    numbers = np.arange(p["shape"][p["dimension"]]).astype(p["dtype"])
    row = numbers.reshape([-1 if axis == p["dimension"] else 1 for axis in range(len(p["shape"]))])
    return [np.broadcast_to(constants(code, row), p["shape"])]


def _split(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    return np.split(given[0], np.cumsum(equation.params["sizes"])[:-1], axis=equation.params["axis"])


def _unstack(_: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    parts = np.moveaxis(given[0], equation.params.get("axis", 0), 0)
    return [parts[k, ...] for k in range(len(parts))]


def element(code: Code, values: Sequence[Value], index: Value, least: int = 0) -> Value:
    """Return the number at an index among some: from memory, or picked by comparing; the last beyond them.

    Parameters
    ----------
    values : sequence of Value
        Those at `least` and on.
    index : Value
        Not below `least`.
    """
    if index.constant is not None:
        return values[min(max(int(index.constant) - least, 0), len(values) - 1)]
    if not index.lanes and len(values) > 2:
        region, first = _in_memory(code, values)
        place = code.arithmetic("add", code.converted(index, "l"), code.constant(np.int64(first - least)))
        return code.load(region, place)
    if len(values) > MOST_CANDIDATES:
        raise UnsupportedOperationError(f"picking one of {len(values)} numbers")
    found = values[-1]
    for k, value in reversed(list(enumerate(values[:-1], least))):
        found = code.select(code.compare("eq", index, _number(code, k, index)), value, found)
    return found


def _start(code: Code, index: Value, most: int) -> Value:
    """Return an index within its bounds, as JAX has it where a part would not lie within an array."""
    if most <= 0:
        return _number(code, 0, index)
    return code.arithmetic("max", code.arithmetic("min", index, _number(code, most, index)), _number(code, 0, index))


def _in_memory(code: Code, values: Sequence[Value]) -> tuple[Any, int]:
    """Return where numbers are one after another in memory, and the first place: put there unless they are already."""
    homes = [value.home for value in values]
    if homes[0] is not None:
        region, first = homes[0]
        if all(home is not None and home[0] is region and home[1] == first + k for k, home in enumerate(homes)):
            return region, first
    region = code.room(len(values), values[0].kind, lanes=any(value.lanes for value in values))
    for k, value in enumerate(values):
        code.store(region, k, value)
    return region, 0


def loaded(code: Code, array: Values, index: Value) -> Values:
    """Return a row of an array in memory, whose index is the same in all lanes."""
    size = array[0, ...].size
    region, first = _in_memory(code, flat(array))
    start = code.arithmetic("mul", code.converted(index, "l"), code.constant(np.int64(size)))
    found = np.empty(array.shape[1:], object)
    places = (code.arithmetic("add", start, code.constant(np.int64(first + k))) for k in range(size))
    found.ravel()[:] = [code.load(region, place) for place in places]
    return found


def _dynamic_slice(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    array, *starts = given
    for axis, (start, size) in enumerate(zip(starts, equation.params["slice_sizes"], strict=True)):
        index = _start(code, start.item(), array.shape[axis] - size)
        rows = np.moveaxis(array, axis, 0)
        if index.constant is not None:
            found = rows[int(index.constant) :][:size]
        elif not index.lanes and rows.size:
            windows = [rows[k : len(rows) - size + 1 + k] for k in range(size)]
            found = np.stack([loaded(code, window, index) for window in windows])
        else:
            windows = [rows[k : len(rows) - size + 1 + k] for k in range(size)]
            found = np.stack([each(lambda *values, i=index: element(code, values, i), *window) for window in windows])
        array = np.moveaxis(found, 0, axis)
    return [array]


def _dynamic_update_slice(code: Code, _: Any, given: Sequence[Values]) -> Sequence[Values]:
    array, part, *starts = given
    indices = [_start(code, start.item(), n - m) for start, n, m in zip(starts, array.shape, part.shape, strict=True)]
    found = array.copy()
    moving = [axis for axis, index in enumerate(indices) if index.constant is None]
    fixed = [0 if index.constant is None else int(index.constant) for index in indices]
    if not moving:
        found[tuple(slice(k, k + m) for k, m in zip(fixed, part.shape, strict=True))] = part
        return [found]
    ranges = [range(n - m + 1) if axis in moving else (k,) for axis, (k, n, m) in enumerate(zip(fixed, array.shape, part.shape, strict=True))]
    for first in itertools.product(*ranges):
        here = code.constant(np.True_)
        for axis in moving:
            here = code.logic("and", here, code.compare("eq", indices[axis], _number(code, first[axis], indices[axis])))
        for offset in np.ndindex(part.shape):
            place = tuple(np.add(first, offset))
            found[place] = code.select(here, part[offset], found[place])
    return [found]


def _gather(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Return a part of an array at indices: which element an index tells is asked of JAX, with places for numbers."""
    array, indices = given
    p, places = equation.params, np.arange(array.size).reshape(array.shape)
    known = np.vectorize(lambda value: 0 if value.constant is None else int(value.constant), otypes=[np.int64])(indices)
    moving = [k for k in range(indices.shape[-1]) if any(value.constant is None for value in flat(indices[..., k]))]
    if len(moving) > 1:
        raise UnsupportedOperationError("indices of which more than one are not known")

    def at(table: np.ndarray) -> np.ndarray:
        options = {"dimension_numbers": p["dimension_numbers"], "slice_sizes": p["slice_sizes"], "mode": p["mode"]}
        with jax.ensure_compile_time_eval():
            return np.asarray(jax.lax.gather(places, table, fill_value=-1, **options))

    beyond = code.constant(np.asarray(_filler(p, equation.outvars[0].aval.dtype), equation.outvars[0].aval.dtype))
    numbers = [*flat(array), beyond]
    if not moving:
        return [np.array(numbers, object)[at(known)]]
    (axis,) = moving
    size = array.shape[p["dimension_numbers"].start_index_map[axis]]
    tables = []
    for k in range(-1, size + 1):  # one beyond each end, too
        known[..., axis] = k
        tables.append(at(known))
    found = np.empty(tables[0].shape, object)
    which = [k for k in range(found.ndim) if k not in p["dimension_numbers"].offset_dims]
    limit, start = (code.constant(np.asarray(k, DTYPES[flat(indices)[0].kind])) for k in (size, -1))
    for place in np.ndindex(found.shape):
        index = indices[(*(place[k] for k in which), axis)]
        index = code.arithmetic("max", code.arithmetic("min", index, limit), start)
        found[place] = element(code, [numbers[table[place]] for table in tables], index, -1)
    return [found]


def _scatter(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    """Put numbers at indices, or add them to what is there: which place an index tells is asked of JAX."""
    array, indices, updates = given
    if any(value.constant is None for value in flat(indices)):
        raise UnsupportedOperationError("changing an array at indices that are not known")
    p, add = equation.params, equation.primitive.name == "scatter-add"
    table = np.vectorize(lambda value: int(value.constant), otypes=[np.int64])(indices)
    units = np.eye(updates.size).reshape(-1, *updates.shape)
    with jax.ensure_compile_time_eval():
        put = jax.vmap(
            lambda unit: jax.lax.scatter_add(
                np.zeros(array.shape), table, unit, dimension_numbers=p["dimension_numbers"], mode=p["mode"]
            )
        )
        hits = np.asarray(put(units)).reshape(updates.size, array.size)
    found = array.copy().ravel()
    for k, place in zip(*np.nonzero(hits), strict=True):
        value = updates.ravel()[k]
        found[place] = code.arithmetic("add", found[place], value) if add else value
    return [found.reshape(array.shape)]


def _filler(params: Mapping[str, Any], dtype: Any) -> Any:
    """Return what stands where an index points beyond an array."""
    if params["mode"] != GatherScatterMode.FILL_OR_DROP:
        return 0
    if params["fill_value"] is not None:
        return params["fill_value"]
    if np.issubdtype(dtype, np.floating):
        return np.nan
    return True if dtype == bool else np.iinfo(dtype).min


def kind_of(dtype: Any) -> str:
    """Return the kind of numbers of a type."""
    if (dtype := np.dtype(dtype)) not in KINDS:
        raise UnsupportedOperationError(f"numbers of type {dtype}")
    return KINDS[dtype]


def _same(_: Code, __: Any, given: Sequence[Values]) -> Sequence[Values]:
    return given


RULES: Mapping[str, Rule] = {
    **{name: _arithmetic(name) for name in ("add", "sub", "mul", "div", "max", "min", "rem")},
    **{name: _compare(name) for name in ("eq", "ne", "lt", "le", "gt", "ge")},
    **{name: _logic(name) for name in ("and", "or", "xor")},
    **{name: _intrinsic(name) for name in ("sqrt", "floor", "ceil")},
    **{name: _function(function) for name, function in FUNCTIONS.items()},
    **{name: _same for name in ("copy", "stop_gradient", "optimization_barrier")},
    "add_any": _arithmetic("add"),
    "neg": _unary(lambda code, a: code.negated(a)),
    "not": _unary(lambda code, a: code.negated(a)),
    "abs": _unary(_absolute),
    "sign": _unary(_sign),
    "square": _unary(lambda code, a: code.arithmetic("mul", a, a)),
    "is_finite": _unary(_finite),
    "integer_pow": _integer_power,
    "round": _round,
    "convert_element_type": _convert,
    "select_n": _select,
    "clamp": _clamp,
    "reduce_sum": _reduce(lambda code, a, b: code.arithmetic("add", a, b), lambda dtype: np.zeros((), dtype)),
    "reduce_prod": _reduce(lambda code, a, b: code.arithmetic("mul", a, b), lambda dtype: np.ones((), dtype)),
    "reduce_max": _reduce(lambda code, a, b: code.arithmetic("max", a, b), lambda _: np.asarray(-np.inf)),
    "reduce_min": _reduce(lambda code, a, b: code.arithmetic("min", a, b), lambda _: np.asarray(np.inf)),
    "reduce_and": _reduce(lambda code, a, b: code.logic("and", a, b), lambda _: np.True_),
    "reduce_or": _reduce(lambda code, a, b: code.logic("or", a, b), lambda _: np.False_),
    "argmax": _extreme,
    "argmin": _extreme,
    "sort": _sort,
    "cumsum": _cumulative("add"),
    "cumprod": _cumulative("mul"),
    "cummax": _cumulative("max"),
    "cummin": _cumulative("min"),
    "dot_general": _dot,
    "slice": _slice,
    "broadcast_in_dim": _broadcast,
    "reshape": _reshape,
    "squeeze": _reshape,
    "expand_dims": _reshape,
    "concatenate": lambda _, equation, given: [np.concatenate(given, equation.params["dimension"])],
    "stack": lambda _, equation, given: [np.stack(given, equation.params.get("axis", 0))],
    "unstack": _unstack,
    "transpose": lambda _, equation, given: [given[0].transpose(equation.params["permutation"])],
    "rev": lambda _, equation, given: [np.flip(given[0], equation.params["dimensions"])],
    "pad": _pad,
    "iota": _iota,
    "split": _split,
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
    "scatter": _scatter,
    "scatter-add": _scatter,
}
