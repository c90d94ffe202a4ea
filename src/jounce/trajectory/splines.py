"""Splines through samples, as polynomials on the pieces between their breakpoints."""

import math
from typing import Any

import numpy as np

from jounce.errors import MechanismError
from jounce.jet.turns import whole_periods

CLOSED = 1e-9  # how nearly samples that repeat come back to their first value, over their range


def checked_samples(times: Any, values: Any, degree: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values of samples as arrays of shape (samples,), or raise MechanismError."""
    try:
        times, values = np.asarray(times, float), np.asarray(values, float)
    except (TypeError, ValueError):
        raise MechanismError("times and values of samples must be numbers") from None
    if times.ndim != 1 or times.shape != values.shape:
        shapes = f"{times.shape} and {values.shape}"
        raise MechanismError("samples need one value for each time, as two lists of equal length", value=shapes)
    for name, samples in (("times", times), ("values", values)):
        if not np.isfinite(samples).all():
            first = int(np.flatnonzero(~np.isfinite(samples))[0])
            message = f"{name} of samples must be finite numbers; sample {first} is not"
            raise MechanismError(message, value=float(samples[first]))
    if (np.diff(times) <= 0).any():
        first = int(np.flatnonzero(np.diff(times) <= 0)[0])
        same = ", it has the same time" if times[first + 1] == times[first] else ""
        message = f"times of samples must increase; sample {first + 1} does not come after sample {first}{same}"
        raise MechanismError(message, value=float(times[first + 1]))
    if isinstance(degree, bool) or not isinstance(degree, int | np.integer) or not 1 <= degree <= 11:
        raise MechanismError("the degree of a spline must be a whole number from 1 to 11", value=degree)
    if len(times) <= degree:
        raise MechanismError(f"a spline of degree {degree} needs at least {degree + 1} samples", value=len(times))
    return times, values


def interpolated(times: np.ndarray, values: np.ndarray, degree: int, **ends: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the breakpoints and the local Taylor coefficients of a spline through samples.

    Parameters
    ----------
    times, values : ndarray of shape (samples,)
        Samples, the times increasing.
    degree : int
        Of the spline.
    **ends
        What `scipy.interpolate.make_interp_spline` takes for the conditions at the ends: ``t`` or ``bc_type``.

    Returns
    -------
    breakpoints : ndarray of shape (pieces + 1,)
        Where the pieces begin, and where the last one ends.
    coefficients : ndarray of shape (degree + 1, pieces)
        Of the powers of the time since the beginning of each piece, lowest first.

    Raises
    ------
    LinAlgError, ValueError
        The samples and the conditions do not determine a spline.

    Notes
    -----
    The derivatives at the breakpoints come from the B-splines themselves (de Boor's recursion). SciPy's
    ``PPoly.from_spline`` calls FITPACK's splev, whose arrays end at degree 5: it crashes from degree 9 on.
    """
    from scipy.interpolate import make_interp_spline  # here, since importing SciPy takes half a second

    scale = (times[-1] - times[0]) / (len(times) - 1)  # in steps, so that high powers stay of one size
    spline = make_interp_spline((times - times[0]) / scale, values, k=degree, **ends)
    inside = np.unique(spline.t[degree : len(spline.t) - degree])
    with np.errstate(over="ignore", invalid="ignore"):
        powers = [spline(inside[:-1], nu=k) / (math.factorial(k) * scale**k) for k in range(degree + 1)]
    if not np.isfinite(powers).all():
        raise ValueError("derivatives beyond the range of numbers")
    breakpoints = times[0] + inside * scale
    near = np.clip(np.searchsorted(times, breakpoints), 1, len(times) - 1)
    near = np.where(breakpoints - times[near - 1] < times[near] - breakpoints, near - 1, near)
    rounded = np.abs(times[near] - breakpoints) <= 8 * np.finfo(float).eps * np.abs(times).max()
    return np.where(rounded, times[near], breakpoints), np.stack(powers)


def periodic(times: np.ndarray, values: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return breakpoints, coefficients and advance of a spline that goes on smoothly from its end at its beginning.

    Parameters
    ----------
    times, values : ndarray of shape (samples,)
        One period; the last value is the first one, or whole turns, in rad, away from it.
    degree : int
        Odd.

    Returns
    -------
    breakpoints : ndarray of shape (samples,)
    coefficients : ndarray of shape (degree + 1, samples - 1)
    advance : float
        From one period to the next: 0, or whole turns, rad.

    Raises
    ------
    MechanismError
        The degree is even, or the samples do not close.
    """
    if degree % 2 == 0:
        raise MechanismError("samples that repeat need a spline of odd degree", value=degree)
    difference, span = float(values[-1] - values[0]), float(np.ptp(values)) or 1.0
    advance = float(whole_periods(difference))
    if abs(difference - advance) > CLOSED * span:
        message = "samples that repeat must end at the value they begin with, or whole turns (in rad) from it"
        raise MechanismError(f"{message}; the last one differs by", value=difference)
    slope = advance / (times[-1] - times[0])
    level = values - slope * (times - times[0])
    level[-1] = level[0]
    breakpoints, coefficients = interpolated(times, level, degree, bc_type="periodic")
    coefficients[0] += slope * (breakpoints[:-1] - times[0])
    coefficients[1] += slope
    return breakpoints, coefficients, advance
