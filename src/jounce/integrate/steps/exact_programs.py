"""Programs that a Taylor series cannot overlook: sums, products, sines and cosines, of low degree.

The first Taylor coefficients determine a polynomial of low degree anywhere, and the waves of a sine. Those of a bell, a
step or a table say nothing about its values elsewhere. Roots and quotients, as in the force of a spring, are determined
as long as radicands and denominators stay away from zero (`radicands_and_denominators`).
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
from jax.extend.core import ClosedJaxpr, JaxprEqn, Literal

from jounce.jet.programs.operations import ADDITIVE, REARRANGING
from jounce.jet.programs.reader import ProgramReader, inner_program

MAX_DEGREE = 8  # in the arguments: a power such as x**40 is flat, and then a wall
MAX_DEGREE_OF_FORCES = 2 * MAX_DEGREE  # springs in space have 9; forces are compared at points, too
SELECTORS = {"select_n": slice(1), "gather": slice(1, None), "dynamic_slice": slice(1, None)}  # with what selects
SUMS = (ADDITIVE | REARRANGING | frozenset(["neg", "optimization_barrier"])) - SELECTORS.keys()
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
    if name in SUMS or (name in SELECTORS and not any(degrees[SELECTORS[name]])):
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


def radicands_and_denominators(function: Callable[..., Any], *arguments: Any) -> list[Any] | None:
    """Return the radicands and denominators in a function that is otherwise as of `is_plain`, or None.

    Where these stay away from zero, the results are analytic functions, which leave no pulse between few points.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> [float(x) for x in radicands_and_denominators(lambda x: x / jnp.sqrt(x * x), jnp.array(2.0))]
    [4.0, 2.0]
    >>> radicands_and_denominators(lambda x: jnp.exp(-x * x), jnp.array(2.0)) is None
    True
    """
    program, reader = jax.make_jaxpr(function)(*arguments), _DegreeReader([])
    leaves = [_Graded(leaf, 1) for leaf in jax.tree.leaves(arguments)]
    try:
        reader.read(program.jaxpr, program.consts, leaves)
    except _NoDegreeError:
        return None
    return reader.divisors


class _Graded(NamedTuple):
    array: Any
    degree: int


class _NoDegreeError(Exception):
    """An operation has no degree in its operands, or one that is too high."""


class _DegreeReader(ProgramReader):
    """Interpreter of programs that carries degrees along and collects radicands and denominators."""

    moving = _Graded

    def __init__(self, divisors: list[Any]):
        self.divisors = divisors

    def value(self, x: Any) -> Any:
        return x.array if isinstance(x, _Graded) else x

    def applied(self, equation: JaxprEqn, operands: list[Any]) -> list[Any]:
        degrees = [x.degree if isinstance(x, _Graded) else 0 for x in operands]
        name, arrays = equation.primitive.name, [self.value(x) for x in operands]
        if name == "sqrt" or (name == "div" and degrees[1]):
            self.divisors.append(arrays[-1])
            degrees_out: list[int] | None = [sum(degrees)]
        else:
            degrees_out = _made(equation, degrees)
        if degrees_out is None or max(degrees_out) > MAX_DEGREE_OF_FORCES:
            raise _NoDegreeError
        results = equation.primitive.bind(*arrays, **equation.params)
        results = results if equation.primitive.multiple_results else [results]
        return [_Graded(array, degree) for array, degree in zip(results, degrees_out, strict=True)]
