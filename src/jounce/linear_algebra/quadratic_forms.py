"""Quadratic forms from their values in some directions."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float


def polarized(
    values: Callable[[Float[np.ndarray, "pair k"]], Float[np.ndarray, "form pair"]], count: int
) -> Float[np.ndarray, "form k k"]:
    """Return the symmetric matrices of quadratic forms, by polarization.

    Parameters
    ----------
    values : callable
        Values of the forms in directions: the unit vectors, and the sums of two of them.
    count : int
        How many variables the forms have.
    """
    first, second = np.triu_indices(count)
    unit = np.eye(count)
    evaluated = values(np.where((first == second)[:, None], unit[first], unit[first] + unit[second]))
    pure = evaluated[:, first == second]
    forms = np.zeros((len(evaluated), count, count))
    mixed = np.where(first == second, evaluated, 0.5 * (evaluated - pure[:, first] - pure[:, second]))
    forms[:, first, second] = forms[:, second, first] = mixed
    return forms
