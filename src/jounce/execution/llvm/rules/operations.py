"""Rules of JAX operations in terms of scalar operations: the elementwise ones, and the table of all."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax
import numpy as np

from jounce.execution.llvm.rules import axes, indexing
from jounce.execution.llvm.text.arrays import Rule, Values, each
from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.values import UnsupportedOperationError, Value, kind_of

FUNCTIONS = {  # of the C library, which JAX calls by the same names
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh",
    "exp", "exp2", "expm1", "log", "log1p", "cbrt", "erf", "erfc",
}  # fmt: skip


def _written_by(method: Callable[..., Value], operation: str) -> Rule:
    return lambda code, _, given: [each(partial(method, code, operation), *given)]


def _compare_in_total_order(operation: str) -> Rule:
    return lambda code, _, given: [
        each(lambda a, b: code.compare(operation, _position(code, a), _position(code, b)), *given)
    ]


def _position(code: Code, a: Value) -> Value:
    """Return the position of a double in the total order of IEEE 754 as an integer; other numbers unchanged."""
    if a.kind != "f":
        return a
    digits = code.digits(a)
    below = code.compare("lt", digits, code.constant(0, "l"))
    return code.select(below, code.logic("xor", digits, code.constant(2**63 - 1, "l")), digits)


def _unary(function: Callable[[Code, Value], Value]) -> Rule:
    return lambda code, _, given: [each(partial(function, code), given[0])]


def _absolute(code: Code, a: Value) -> Value:
    return code.intrinsic("fabs", a) if a.kind == "f" else code.arithmetic("max", a, code.negated(a))


def _sign(code: Code, a: Value) -> Value:
    zero = code.constant(0, a.kind)
    below = code.select(code.compare("lt", a, zero), code.constant(-1, a.kind), a)  # NaN and signed zeros stay
    return code.select(code.compare("gt", a, zero), code.constant(1, a.kind), below)


def _square(code: Code, a: Value) -> Value:
    return code.arithmetic("mul", a, a)


def _reciprocal_root(code: Code, a: Value) -> Value:
    return code.arithmetic("div", code.constant(1.0), code.intrinsic("sqrt", a))


def _logistic(code: Code, a: Value) -> Value:
    one = code.constant(1.0)
    return code.arithmetic("div", one, code.arithmetic("add", one, code.call("exp", code.negated(a))))


def _finite(code: Code, a: Value) -> Value:
    return code.compare("lt", code.intrinsic("fabs", a), code.constant(np.inf))


def _integer_power(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    exponent = equation.params["y"]

    def power(a: Value) -> Value:
        squared, result = a, code.constant(1, a.kind)
        for index, digit in enumerate(reversed(f"{abs(exponent):b}")):
            squared = squared if index == 0 else _square(code, squared)
            result = code.arithmetic("mul", result, squared) if digit == "1" else result
        return result if exponent >= 0 else code.arithmetic("div", code.constant(1, a.kind), result)

    return [each(power, given[0])]


def _power(code: Code, _: Any, given: Sequence[Values]) -> Sequence[Values]:
    def power(a: Value, b: Value) -> Value:
        if a.kind != "f":
            raise UnsupportedOperationError("whole numbers to a power that is not known")
        return code.call("pow", a, code.converted(b, "f"))

    return [each(power, *given)]


def _round(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    from_zero = equation.params["rounding_method"] == jax.lax.RoundingMethod.AWAY_FROM_ZERO
    return [each(lambda a: code.intrinsic("round" if from_zero else "roundeven", a), given[0])]


def _convert(code: Code, equation: Any, given: Sequence[Values]) -> Sequence[Values]:
    kind = kind_of(equation.params["new_dtype"])
    return [each(lambda a: code.converted(a, kind), given[0])]


def _select(code: Code, _: Any, given: Sequence[Values]) -> Sequence[Values]:
    def choose(choice: Value, *cases: Value) -> Value:
        if choice.kind == "b":
            return code.select(choice, cases[-1], cases[0])
        result = cases[-1]
        for k in reversed(range(len(cases) - 1)):
            result = code.select(code.compare("le", choice, code.constant(k, choice.kind)), cases[k], result)
        return result

    return [each(choose, *given)]


def _clamp(code: Code, _: Any, given: Sequence[Values]) -> Sequence[Values]:
    def clamp(low: Value, value: Value, high: Value) -> Value:
        return code.arithmetic("min", code.arithmetic("max", low, value), high)

    return [each(clamp, *given)]


def _same(_: Code, __: Any, given: Sequence[Values]) -> Sequence[Values]:
    return given


ELEMENTWISE: Mapping[str, Rule] = {
    **{name: _written_by(Code.arithmetic, name) for name in ("add", "sub", "mul", "div", "max", "min", "rem")},
    **{name: _written_by(Code.compare, name) for name in ("eq", "ne", "lt", "le", "gt", "ge")},
    **{f"{name}_to": _compare_in_total_order(name) for name in ("eq", "lt", "le")},
    **{name: _written_by(Code.logic, name) for name in ("and", "or", "xor")},
    **{name: _written_by(Code.intrinsic, name) for name in ("sqrt", "floor", "ceil")},
    **{name: _written_by(Code.call, name) for name in FUNCTIONS},
    "add_any": _written_by(Code.arithmetic, "add"),
    "neg": _unary(Code.negated),
    "not": _unary(Code.inverted),
    "abs": _unary(_absolute),
    "sign": _unary(_sign),
    "square": _unary(_square),
    "is_finite": _unary(_finite),
    "logistic": _unary(_logistic),
    "rsqrt": _unary(_reciprocal_root),
    "integer_pow": _integer_power,
    "pow": _power,
    "round": _round,
    "convert_element_type": _convert,
    "select_n": _select,
    "clamp": _clamp,
}
"""Rules of elementwise operations."""

RULES: Mapping[str, Rule] = {
    **ELEMENTWISE,
    **dict.fromkeys(("copy", "stop_gradient", "optimization_barrier"), _same),
    **{f"reduce_{name}": axes.reduction(operation) for name, operation in axes.REDUCED.items()},
    **{f"cum{name}": axes.cumulative(axes.REDUCED[name]) for name in ("sum", "prod", "max", "min")},
    **dict.fromkeys(("argmax", "argmin"), axes.extreme),
    "sort": axes.sorting,
    "dot_general": axes.dot,
    "slice": indexing.part,
    "broadcast_in_dim": indexing.broadcast,
    "tile": indexing.tile,
    **dict.fromkeys(("reshape", "squeeze", "expand_dims"), indexing.reshape),
    "concatenate": indexing.concatenate,
    "stack": indexing.stack,
    "unstack": indexing.unstack,
    "transpose": indexing.transpose,
    "rev": indexing.reverse,
    "pad": indexing.pad,
    "iota": indexing.iota,
    "split": indexing.split,
    "dynamic_slice": indexing.dynamic_slice,
    "dynamic_update_slice": indexing.dynamic_update_slice,
    "gather": indexing.gather,
    **dict.fromkeys(("scatter", "scatter-add"), indexing.scatter),
}
