"""Composition of a jet with any JAX-traceable function: its program is read off once and run on jets.

Elementary, linear and bilinear operations of the program have exact rules, O(K^2) at order K; branches are all run
and selected from, short loops of known length are unrolled. A program with any other operation (a loop until a
condition, a special function) is differentiated by nested forward mode instead: exact as well, but its cost doubles
with each order.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import Literal

from jounce.jet.algebra import Jet, bilinear
from jounce.jet.elementary import FUNCTIONS, erf, tanh
from jounce.jet.operations import COMPOSED, REARRANGING, STEPWISE
from jounce.jet.vectors import stack


def compose(function: Callable[[Any], Any], x: Jet) -> Jet:
    """Return the jet of ``function(x)``, exact to rounding at every order.

    Parameters
    ----------
    function : callable
        Any JAX-traceable function of one scalar that returns a scalar.
    x : Jet
        Its argument, with batch axes of any shape.

    Returns
    -------
    Jet
        Of the order and shape of `x`.

    Raises
    ------
    TypeError
        If the function does not return one scalar for a scalar.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> import jounce as jn
    >>> t = jn.Jet.variable(0.0, order=3)
    >>> [round(float(x), 12) for x in jn.compose(lambda t: jnp.exp(-2 * t), t).derivatives()]
    [1.0, -2.0, 4.0, -8.0]
    """
    example = jax.ShapeDtypeStruct((), jnp.result_type(x.coefficients[0], float))
    program, result = jax.make_jaxpr(function, return_shape=True)(example)
    if getattr(result, "shape", None) != ():
        raise TypeError(f"a function of time must return one scalar for a scalar, got {result}")
    run = _run if all(map(_has_rule, _operations(program.jaxpr))) else _nested

    def one(*coefficients):
        result = run(program, function, Jet(coefficients))
        if not isinstance(result, Jet):
            result = Jet.constant(jnp.asarray(result, dtype=example.dtype), x.order)
        return result.coefficients

    flat = [None if c is None else jnp.asarray(c, dtype=example.dtype).reshape(-1) for c in x.coefficients]
    return Jet(jax.vmap(one)(*flat)).map(lambda c: jnp.reshape(c, x.shape))


def _nested(_, function: Callable[[Any], Any], x: Jet) -> Jet:
    """Differentiate ``function`` along the polynomial of `x`, by forward mode within forward mode."""

    def along(step):
        return function(x.evaluate(step))

    derivatives, derivative = [], along
    for _order in range(x.order + 1):
        derivatives.append(derivative(jnp.zeros_like(x.coefficients[0])))
        derivative = _slope(derivative)
    return Jet.from_derivatives(derivatives)


def _slope(f: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda step: jax.jvp(f, (step,), (jnp.ones_like(step),))[1]


def _run(program: Any, _, *arguments: Any) -> Any:
    """Run a JAX program on jets (and on arrays, for what does not depend on time)."""
    values = dict(zip(program.jaxpr.constvars, program.consts, strict=True))
    values.update(zip(program.jaxpr.invars, arguments, strict=True))

    def read(variable):
        return variable.val if isinstance(variable, Literal) else values[variable]

    for equation in program.jaxpr.eqns:
        operands = [read(v) for v in equation.invars]
        name, parameters = equation.primitive.name, equation.params
        if not any(isinstance(x, Jet) for x in operands):
            results = equation.primitive.bind(*operands, **parameters)
            results = results if equation.primitive.multiple_results else [results]
        elif name in _CONTROL:
            results = _CONTROL[name](*operands, **parameters)
        elif inner := _inner_program(parameters):
            results = _run_all(inner, operands)
        else:
            results = [_apply(equation.primitive, parameters, operands)]
        values.update(zip(equation.outvars, results, strict=True))
    outputs = [read(v) for v in program.jaxpr.outvars]
    return outputs[0] if len(outputs) == 1 else outputs


def _run_all(program: Any, operands: list[Any]) -> list[Any]:
    results = _run(program, None, *operands)
    return results if isinstance(results, list) else [results]


def _branches(which: Any, *operands: Any, branches: Any, **_) -> list[Any]:
    """Run every branch of a condition and select from the results."""
    outcomes = zip(*(_run_all(branch, list(operands)) for branch in branches), strict=True)
    which = jnp.clip(_value(which), 0, len(branches) - 1)
    return [_pick(which, outcome) for outcome in outcomes]


def _pick(which: Any, cases: tuple[Any, ...]) -> Any:
    chosen = cases[0]
    for k, case in enumerate(cases[1:], 1):
        chosen = _select(jnp.broadcast_to(which == k, jnp.shape(_value(case))), chosen, case)
    return chosen


def _unrolled(
    *operands: Any, jaxpr: Any, length: int, num_consts: int, num_carry: int, reverse: bool, **_
) -> list[Any]:
    """Run a loop of known length step by step."""
    constants, carry = list(operands[:num_consts]), list(operands[num_consts : num_consts + num_carry])
    sequences, collected = operands[num_consts + num_carry :], []
    for step in reversed(range(length)) if reverse else range(length):
        results = _run_all(jaxpr, [*constants, *carry, *(x[step] for x in sequences)])
        carry = results[:num_carry]
        collected.append(results[num_carry:])
    if reverse:
        collected.reverse()
    return [*carry, *(stack(steps) for steps in zip(*collected, strict=True))]


_CONTROL: dict[str, Callable[..., list[Any]]] = {"cond": _branches, "scan": _unrolled}
LONGEST_UNROLLED = 100


def _apply(primitive: Any, parameters: dict, operands: list[Any]) -> Any:
    name = primitive.name
    if name in _RULES:
        return _RULES[name](*operands, **parameters)
    if name in REARRANGING:
        return _along_coefficients(primitive, parameters, operands)
    if name in _BILINEAR:
        return bilinear(lambda a, b: primitive.bind(a, b, **parameters), *operands)
    if name in COMPOSED:
        program = jax.make_jaxpr(lambda *xs: COMPOSED[name](*xs, **parameters))(*map(_value, operands))
        return _run(program, None, *operands)
    return primitive.bind(*map(_value, operands), **parameters)  # piecewise constant in time


def _along_coefficients(primitive: Any, parameters: dict, operands: list[Any]) -> Jet:
    """Apply an operation that is linear in its jets, coefficient by coefficient."""
    order = min(x.order for x in operands if isinstance(x, Jet))
    index_only = primitive.name in ("gather", "dynamic_slice")

    def pick(x: Any, k: int) -> Any:
        if isinstance(x, Jet):
            return x.dense().coefficients[k]
        return x if k == 0 or index_only else jnp.zeros_like(x)

    return Jet(primitive.bind(*(pick(x, k) for x in operands), **parameters) for k in range(order + 1))


def _value(x: Any) -> Any:
    return x.coefficients[0] if isinstance(x, Jet) else x


def _select(which: Any, *cases: Any, **_) -> Any:
    jets = [x for x in cases if isinstance(x, Jet)]
    if not jets:
        return jax.lax.select_n(_value(which), *cases)
    order = min(x.order for x in jets)
    whole = [x if isinstance(x, Jet) else Jet.constant(x, order) for x in cases]
    columns = zip(*(x.dense().coefficients for x in whole), strict=False)
    return Jet(jax.lax.select_n(_value(which), *column) for column in columns)


def _without_parameters(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *operands, **_: function(*operands)


_RULES: dict[str, Callable[..., Any]] = {name: _without_parameters(f) for name, f in FUNCTIONS.items()} | {
    "add": lambda a, b, **_: a + b,
    "add_any": lambda a, b, **_: a + b,
    "sub": lambda a, b, **_: a - b,
    "mul": lambda a, b, **_: a * b,
    "div": lambda a, b, **_: a / b,
    "neg": lambda a, **_: -a,
    "erfc": lambda a, **_: 1.0 - erf(a),
    "logistic": lambda a, **_: 0.5 * (1.0 + tanh(0.5 * a)),
    "select_n": _select,
}
_BILINEAR = frozenset(("dot_general",))
_WITHOUT_RATES = STEPWISE | frozenset("and eq ge gt iota is_finite le lt ne not or xor".split())


def _has_rule(name: str) -> bool:
    return any(name in known for known in (_RULES, COMPOSED, REARRANGING, _BILINEAR, _WITHOUT_RATES))


def _inner_program(parameters: dict) -> Any:
    """Return the program inside a call (jit, custom derivative), or None for a plain operation."""
    inner = parameters.get("jaxpr", parameters.get("call_jaxpr"))
    return inner if hasattr(inner, "jaxpr") else None


def _operations(jaxpr: Any) -> Any:
    """Yield the names of all operations, those inside calls, branches and short loops too."""
    for equation in jaxpr.eqns:
        name, parameters = equation.primitive.name, equation.params
        if name == "cond":
            for branch in parameters["branches"]:
                yield from _operations(branch.jaxpr)
        elif (inner := _inner_program(parameters)) and (name != "scan" or parameters["length"] <= LONGEST_UNROLLED):
            yield from _operations(inner.jaxpr)
        else:
            yield name
