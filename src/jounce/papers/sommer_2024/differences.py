"""Finite differences, the older way to jerk and jounce: central (Sommer 2024, 57-58) and backward."""

import numpy as np
from jaxtyping import Float, Int

WEIGHTS = {  # by order of accuracy and order of derivative, from two steps before the instant to two steps after
    (2, 1): (0, -1 / 2, 0, 1 / 2, 0),
    (2, 2): (0, 1, -2, 1, 0),
    (4, 1): (1 / 12, -8 / 12, 0, 8 / 12, -1 / 12),  # printed with -8/12 twice, see the errata
    (4, 2): (-1 / 12, 16 / 12, -30 / 12, 16 / 12, -1 / 12),
}
REACH = 2  # samples needed on either side


def central_difference(
    samples: Float[np.ndarray, " time"],
    step: float,
    *,
    derivative: int,
    accuracy: int,
    at: Int[np.ndarray, " instants"] | None = None,
) -> Float[np.ndarray, " instants"]:
    """Return the first or second derivative of evenly spaced samples (Sommer 2024, equations 57 and 58 corrected).

    Parameters
    ----------
    samples : array of shape (time,)
        Values `step` apart (near each of the requested instants).
    step : float
        Time step, s.
    derivative : int
        Order of the derivative, 1 or 2.
    accuracy : int
        Order of accuracy, 2 or 4: the error falls with this power of the step.
    at : array of int, optional
        Indices of the requested instants; all that have two samples on either side unless given.

    Returns
    -------
    numpy.ndarray
        Derivatives at the requested instants.

    Examples
    --------
    >>> t = np.arange(5) * 0.1
    >>> central_difference(t**4, 0.1, derivative=2, accuracy=4)
    array([0.48])
    """
    centers = np.arange(REACH, len(samples) - REACH) if at is None else at
    weights = WEIGHTS[accuracy, derivative]
    terms = [weight * samples[centers + k - REACH] for k, weight in enumerate(weights) if weight]
    return np.sum(terms, axis=0) / step**derivative


def backward_difference(
    samples: Float[np.ndarray, " time"], step: float, *, derivative: int
) -> Float[np.ndarray, " time-{derivative}"]:
    """Return the first or second derivative of evenly spaced samples from past samples alone.

    Parameters
    ----------
    samples : array of shape (time,)
        Values `step` apart.
    step : float
        Time step, s.
    derivative : int
        Order of the derivative, 1 or 2.

    Returns
    -------
    numpy.ndarray of shape (time - derivative,)
        Derivatives at each instant that has enough samples before it.

    Examples
    --------
    >>> t = np.arange(4) * 0.5
    >>> backward_difference(t**2, 0.5, derivative=1).tolist()  # 2 t, half a step late
    [0.5, 1.5, 2.5]
    """
    return np.diff(samples, derivative) / step**derivative
