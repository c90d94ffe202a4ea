"""Programs that a Taylor series cannot overlook: sums, products, sines and cosines, of low degree.

The first Taylor coefficients determine a polynomial of low degree anywhere, and the waves of a sine. Those of a bell, a
step or a table say nothing about its values elsewhere.
"""

from collections.abc import Sequence
from typing import Any

from jax.extend.core import ClosedJaxpr, Literal

from jounce.jet.programs.operations import ADDITIVE, REARRANGING
from jounce.jet.programs.reader import inner_program

MAX_DEGREE = 8  # in the arguments: a power such as x**40 is flat, and then a wall
SUMS = (ADDITIVE | REARRANGING | frozenset(["neg", "optimization_barrier"])) - {"select_n", "gather", "dynamic_slice"}
WAVES = frozenset(["sin", "cos"])
PRODUCTS = frozenset(["mul", "dot_general"])


def is_plain(program: ClosedJaxpr) -> bool:
    """Return whether a program consists of sums, products, sines and cosines of its arguments, of low degree.

    Examples
    --------
    >>> import jax
    >>> is_plain(jax.make_jaxpr(lambda x, y: x * x * y - jax.numpy.cos(3.0 * x) / 7.0)(1.0, 2.0))
    True
    >>> is_plain(jax.make_jaxpr(lambda x: x - jax.numpy.exp(-x * x))(1.0))
    False
    """
    degrees = _degrees(program.jaxpr, [1] * len(program.jaxpr.invars))
    return degrees is not None and max(degrees, default=0) <= MAX_DEGREE


def uses(program: ClosedJaxpr) -> bool:
    """Return whether the results of a program depend on its arguments.

    Examples
    --------
    >>> import jax
    >>> uses(jax.make_jaxpr(lambda t: 3.0 + 0.0)(1.0)), uses(jax.make_jaxpr(lambda t: jax.numpy.exp(t))(1.0))
    (False, True)
    """
    degrees = _degrees(program.jaxpr, [1] * len(program.jaxpr.invars))
    return degrees is None or any(degrees)


def _degrees(jaxpr: Any, arguments: Sequence[int]) -> list[int] | None:
    """Return the degrees of the results in the arguments, zero for constants; None if there is no degree."""
    degree_of: dict[Any, int] = dict.fromkeys(jaxpr.constvars, 0) | dict(zip(jaxpr.invars, arguments, strict=True))

    def of(variable: Any) -> int:
        return 0 if isinstance(variable, Literal) else degree_of[variable]

    for equation in jaxpr.eqns:
        degrees = [of(x) for x in equation.invars]
        degrees_out = [0] * len(equation.outvars) if not any(degrees) else _made(equation, degrees)
        if degrees_out is None:
            return None
        degree_of.update(zip(equation.outvars, degrees_out, strict=True))
    return [of(x) for x in jaxpr.outvars]


def _made(equation: Any, degrees: list[int]) -> list[int] | None:
    """Return the degrees of the results of an operation, or None if there is no degree."""
    name, inner = equation.primitive.name, inner_program(equation.params)
    if name in SUMS:
        return [max(degrees)] * len(equation.outvars)
    if name in PRODUCTS:
        return [sum(degrees)]
    if name in WAVES:
        return degrees
    if name == "square":
        return [2 * degrees[0]]
    if name == "integer_pow" and equation.params["y"] > 0:
        return [equation.params["y"] * degrees[0]]
    if name == "div" and not degrees[1]:
        return degrees[:1]
    if inner is not None and name not in ("while", "scan", "cond"):
        return _degrees(getattr(inner, "jaxpr", inner), degrees)
    return None
