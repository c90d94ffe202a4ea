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
from jax.extend.core import JaxprEqn

from jounce.jet.algebra import Jet, bilinear
from jounce.jet.elementary import FUNCTIONS, erf, tanh
from jounce.jet.operations import COMPOSED, REARRANGING, STEPWISE
from jounce.jet.programs import ProgramReader, inner_program


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
    ruled = all(map(_has_rule, _operations(program.jaxpr)))

    def one(*coefficients):
        x = Jet(coefficients)
        (result,) = _OnJets().read(program.jaxpr, program.consts, [x]) if ruled else [_nested(function, x)]
        if not isinstance(result, Jet):
            result = Jet.constant(jnp.asarray(result, dtype=example.dtype), x.order)
        return result.coefficients

    flat = [None if c is None else jnp.asarray(c, dtype=example.dtype).reshape(-1) for c in x.coefficients]
    return Jet(jax.vmap(one)(*flat)).map(lambda c: jnp.reshape(c, x.shape))


def _nested(function: Callable[[Any], Any], x: Jet) -> Jet:
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


class _OnJets(ProgramReader):
    """Runs programs on jets, and on arrays for what does not depend on time."""

    moving = Jet

    def value(self, x: Any) -> Any:
        return _value(x)

    def applied(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        primitive, parameters, name = equation.primitive, equation.params, equation.primitive.name
        if name in _RULES:
            return [_RULES[name](*operands, **parameters)]
        if name in REARRANGING:
            return [_along_coefficients(primitive, parameters, operands)]
        if name in _BILINEAR:
            return [bilinear(lambda a, b: primitive.bind(a, b, **parameters), *operands)]
        if name in COMPOSED:
            return [self.composed(lambda *xs: COMPOSED[name](*xs, **parameters), operands)]
        return [primitive.bind(*map(_value, operands), **parameters)]  # piecewise constant in time


LONGEST_UNROLLED = 100


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


def _operations(jaxpr: Any) -> Any:
    """Yield the names of all operations, those inside calls, branches and short loops too."""
    for equation in jaxpr.eqns:
        name, parameters = equation.primitive.name, equation.params
        if name == "cond":
            for branch in parameters["branches"]:
                yield from _operations(branch.jaxpr)
        elif hasattr(inner := inner_program(parameters), "jaxpr") and (
            name != "scan" or parameters["length"] <= LONGEST_UNROLLED
        ):
            yield from _operations(inner.jaxpr)
        else:
            yield name
