"""Quadratic forms from their values in some directions, and where several of them vanish."""

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


def common_zeros(
    forms: Float[np.ndarray, "form k k"],
    starts: Float[np.ndarray, "start k"],
    tolerance: float,
    *,
    steps: int,
    longest: float = np.inf,
) -> Float[np.ndarray, "zero k"]:
    """Return unit vectors on which all forms vanish, to a tolerance, by Gauss-Newton on the sphere from many starts.

    Parameters
    ----------
    forms : array of shape (forms, k, k)
        Symmetric matrices.
    starts : array of shape (starts, k)
        Each leads to the nearest one, or to none.
    tolerance : float
        Largest value of a form.
    steps : int
        How many are made. Where a zero is double each halves the error, and the value goes with its square.
    longest : float, optional
        Length of a step at most.
    """
    x = starts / np.linalg.norm(starts, axis=1, keepdims=True)
    for _ in range(steps):
        along = np.einsum("fij,nj->nfi", forms, x)
        values = np.einsum("nfi,ni->nf", along, x)
        slopes = np.concatenate([2 * along, x[:, None]], axis=1)
        right = np.concatenate([values, np.zeros((len(x), 1))], axis=1)
        step = np.einsum("nij,nj->ni", np.linalg.pinv(slopes, rcond=1e-10), right)
        step *= np.minimum(1.0, longest / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300))
        x = (x - step) / np.linalg.norm(x - step, axis=1, keepdims=True)
    return x[np.abs(np.einsum("fij,ni,nj->nf", forms, x, x)).max(axis=1) <= tolerance]
