"""Entries of the arrays of a differential equation that are constant in time, whatever its unknown numbers.

If all joints of a robot are parallel, for example, their axes keep their directions, and angular velocities have one
component. Products of constants need no sum over the orders, and constants need no series.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jounce.jet.programs.series import Recursion


class ConstantEntries(NamedTuple):
    """Constant entries of a differential equation.

    Attributes
    ----------
    given : tuple of array of bool
        Constant entries of the arguments of the function.
    factors : tuple of array of bool
        Constant entries of the factors of its products.
    form : tuple
        `form` of the `Recursion` for which they were found.
    """

    given: tuple[np.ndarray, ...]
    factors: tuple[np.ndarray, ...]
    form: tuple[Any, ...]


def still_entries(
    function: Callable[..., Any], parameters: Any, values: Sequence[np.ndarray], rates: Sequence[int]
) -> ConstantEntries:
    """Return the constant entries of a differential equation.

    By induction over the orders: entries without coefficients up to one order have none at the next.

    Parameters
    ----------
    function : callable
        Function of a pytree of numbers that are constant in time, and of arrays, as for `Recursion`.
    parameters : pytree of array
        Constants; NaN for unknown numbers.
    values : sequence of array
        Coefficients of order zero of the other arguments; NaN for unknown numbers.
    rates : sequence of int
        For each argument, the index of the result that is its rate; -1 if unknown.
    """
    from jounce.execution.llvm.certain_numbers import certain_numbers

    def read(parameters: Any, values: Any) -> Recursion:
        return Recursion(lambda *arguments: function(parameters, *arguments), values, 1)

    forms: list[Any] = []

    def start(parameters: Any, values: Any) -> Any:
        recursion = read(parameters, values)
        forms[:] = [recursion.form]
        return jax.tree.leaves(recursion.outputs)

    def following(parameters: Any, values: Any, coefficients: Any, sums: Any) -> Any:
        outputs, factors = read(parameters, values).swept(coefficients, sums)
        return jax.tree.leaves(outputs), factors

    known = jax.tree.leaves((parameters, values))
    first = certain_numbers(jax.make_jaxpr(start)(parameters, values), known)
    _, shapes, pairs = forms[0]
    given = [_no_change(first, rate, value) for rate, value in zip(rates, values, strict=True)]
    factors = [np.ones(shape, bool) for shape in shapes]
    program = jax.make_jaxpr(following)(parameters, values, values, [np.zeros(shapes[a]) for a, _, _ in pairs])
    while True:
        sums = [_unknown_but(factors[a] | factors[b]) for a, b, _ in pairs]
        results = certain_numbers(program, [*known, *map(_unknown_but, given), *sums])
        count = len(results) - len(factors)
        new = [still & _no_change(results, rate, still) for rate, still in zip(rates, given, strict=True)]
        remaining = [still & (number == 0) for still, number in zip(factors, results[count:], strict=True)]
        if all(map(np.array_equal, [*new, *remaining], [*given, *factors])):
            return ConstantEntries(tuple(given), tuple(factors), forms[0])
        given, factors = new, remaining


def _no_change(results: Sequence[np.ndarray], rate: int, pattern: np.ndarray) -> np.ndarray:
    return np.zeros(np.shape(pattern), bool) if rate < 0 else results[rate] == 0


def _unknown_but(still: np.ndarray) -> np.ndarray:
    return np.where(still, 0.0, np.nan)
