"""Which entries of the arrays of a differential equation do not change in time, whatever its unknown numbers are.

Where all joints of a robot are parallel, say, their axes keep their direction, and spins have one component. Products
of what does not change have no sum over the orders, and no series needs them.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jounce.jet.programs.series import Recursion


class ConstantEntries(NamedTuple):
    """What does not change in time.

    Attributes
    ----------
    given : tuple of array of bool
        Entries of the arguments of a function.
    factors : tuple of array of bool
        Entries of what it multiplies.
    form : tuple
        Of the `Recursion` for which they are.
    """

    given: tuple[np.ndarray, ...]
    factors: tuple[np.ndarray, ...]
    form: tuple[Any, ...]


def still_entries(
    function: Callable[..., Any], parameters: Any, values: Sequence[np.ndarray], rates: Sequence[int]
) -> ConstantEntries:
    """Return what does not change in a differential equation.

    It stays so by induction over the orders: what has no coefficients up to one order has none of the next.

    Parameters
    ----------
    function : callable
        Of a pytree of numbers that do not change in time, and of arrays, as for `Recursion`.
    parameters : pytree of array
        NaN where a number is not known beforehand.
    values : sequence of array
        Coefficients of order zero of the other arguments, NaN where they are not known.
    rates : sequence of int
        Which of the results is the rate of an argument; -1 where that is not known.
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


def _no_change(results: Sequence[np.ndarray], rate: int, like: np.ndarray) -> np.ndarray:
    return np.zeros(np.shape(like), bool) if rate < 0 else results[rate] == 0


def _unknown_but(still: np.ndarray) -> np.ndarray:
    return np.where(still, 0.0, np.nan)
