"""Quadratic forms from their values in given directions, and their common zeros."""

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
        Returns values of the forms in directions: the unit vectors, and sums of two of them.
    count : int
        Number of variables of the forms.
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
    """Return unit vectors on which all forms vanish to a tolerance, by Gauss-Newton on the sphere from many starts.

    Parameters
    ----------
    forms : array of shape (forms, k, k)
        Symmetric matrices.
    starts : array of shape (starts, k)
        Start vectors; each leads to a zero nearby or to none.
    tolerance : float
        Largest value of a form.
    steps : int
        Number of steps. At a double zero, each halves the error and quarters the value.
    longest : float, optional
        Largest length of a step.
    """
    x = starts / np.linalg.norm(starts, axis=1, keepdims=True)
    for _ in range(steps):
        images = np.einsum("fij,nj->nfi", forms, x)
        values = np.einsum("nfi,ni->nf", images, x)
        slopes = np.concatenate([2 * images, x[:, None]], axis=1)
        rhs = np.concatenate([values, np.zeros((len(x), 1))], axis=1)
        step = np.einsum("nij,nj->ni", np.linalg.pinv(slopes, rcond=1e-10), rhs)
        step *= np.minimum(1.0, longest / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300))
        x = (x - step) / np.linalg.norm(x - step, axis=1, keepdims=True)
    return x[np.abs(np.einsum("fij,ni,nj->nf", forms, x, x)).max(axis=1) <= tolerance]
