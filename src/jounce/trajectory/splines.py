"""Splines through samples, as polynomials between their breakpoints."""

import math
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.polynomial.polynomial import polyder, polyval

from jounce.base.shapes import ArrayLike
from jounce.errors import MechanismError, TrajectoryError
from jounce.jet.turns import whole_periods
from jounce.trajectory.beyond import CLOSED
from jounce.trajectory.checks import check_samples, whole_number

_Samples = Float[np.ndarray, " samples"]
_Breakpoints = Float[np.ndarray, " breakpoints"]
_Pieces = Float[np.ndarray, "powers pieces"]
HIGHEST_DEGREE = 11


def spline_through(
    times: ArrayLike, values: ArrayLike, degree: int, beyond: str = "refuse"
) -> tuple[tuple[_Samples, _Samples], _Breakpoints, _Pieces, float]:
    """Return checked samples, and the spline through them.

    Parameters
    ----------
    times, values : array_like of shape (samples,)
        Samples with increasing times.
    degree : int
        Degree from 1 to 11; odd for samples that repeat.
    beyond : str, default "refuse"
        With ``repeat`` or ``advance``, the samples are one period, and the spline continues smoothly over its end.

    Returns
    -------
    samples : tuple of ndarray of shape (samples,)
        Times and values.
    breakpoints : ndarray of shape (pieces + 1,)
        Beginnings of the pieces, and the end of the last one.
    coefficients : ndarray of shape (degree + 1, pieces)
        Coefficients of the powers of the time since the beginning of each piece, lowest first.
    advance : float
        Gain over a period: 0 or whole turns, rad, with ``repeat``; any value with ``advance``.

    Raises
    ------
    MechanismError
        If the samples are not valid, are too few for the degree, or no spline goes through them.
    """
    times, values = check_samples(times, values, MechanismError)
    if values.ndim != 1:
        raise MechanismError("samples need one value for each time", name="values", value=f"shape {values.shape}")
    degree = whole_number("degree", degree, 1, HIGHEST_DEGREE, error=MechanismError)
    if len(times) <= degree:
        message = f"a spline of degree {degree} needs at least {degree + 1} samples; give more, or lower the degree"
        raise MechanismError(message, value=len(times))
    try:
        if beyond in ("repeat", "advance"):
            pieces = _periodic(times, values, degree, beyond)
        else:
            pieces = (*_interpolated(times, values, degree), 0.0)
    except (np.linalg.LinAlgError, ValueError):
        message = "no spline goes through the samples: too uneven or too large; sample evenly"
        raise MechanismError(message, value=float(np.diff(times).min())) from None
    return ((times, values), *pieces)


def local_powers(
    spline: Any, beginnings: Float[np.ndarray, " pieces"], degree: int
) -> Float[np.ndarray, "powers pieces *columns"]:
    """Return the coefficients of a spline of SciPy on the pieces with given beginnings, lowest power first.

    The derivatives come from the B-splines themselves (de Boor's recursion). SciPy's ``PPoly.from_spline`` calls
    FITPACK's splev, whose arrays end at degree 5: it crashes from degree 9 on.
    """
    return np.stack([spline(beginnings, nu=k) / math.factorial(k) for k in range(degree + 1)])


def pieces_at(law: Any, instants: Float[np.ndarray, " instants"], order: int = 0) -> Float[np.ndarray, " instants"]:
    """Return a derivative of a law of piecewise polynomials, by NumPy, so that no program is compiled for it."""
    begins, powers = np.asarray(law.breakpoints, float), polyder(np.asarray(law.coefficients, float), order)
    index = np.clip(np.searchsorted(begins, instants, side="right") - 1, 0, len(begins) - 1)
    return np.asarray(polyval(instants - begins[index], powers[:, index], tensor=False))


def integrated(pieces: _Pieces, lengths: Float[np.ndarray, " pieces"]) -> Float[np.ndarray, "raised pieces"]:
    """Return the integral of piecewise polynomials from their beginning, as local Taylor coefficients."""
    raised = pieces / np.arange(1, len(pieces) + 1)[:, None]
    gains = (raised * lengths ** np.arange(1, len(raised) + 1)[:, None]).sum(axis=0)
    return np.concatenate([[_sums_before(gains.tolist())], raised])


def _sums_before(terms: list[float]) -> list[float]:
    """Return the sums of the terms before each term, by compensated summation.

    The rounding error of each addition is added up separately (the two-sum of Knuth).
    """
    sums, partial_sum, compensation = [], 0.0, 0.0
    for term in terms:
        sums.append(partial_sum + compensation)
        raised = partial_sum + term
        addend = raised - partial_sum
        compensation += (partial_sum - (raised - addend)) + (term - addend)
        partial_sum = raised
    return sums


def _interpolated(times: _Samples, values: _Samples, degree: int, **ends: Any) -> tuple[_Breakpoints, _Pieces]:
    """Return the breakpoints and the local Taylor coefficients of a spline through samples."""
    from scipy.interpolate import make_interp_spline  # local, since the import of SciPy takes half a second

    scale = (times[-1] - times[0]) / (len(times) - 1)  # time in steps, so that high powers keep one size
    first = values[0]  # subtracted, so that constant samples are exactly at rest
    with np.errstate(over="ignore", invalid="ignore"):
        spline = make_interp_spline((times - times[0]) / scale, values - first, k=degree, **ends)
        knots = np.unique(spline.t[degree : len(spline.t) - degree])
        powers = local_powers(spline, knots[:-1], degree) / scale ** np.arange(degree + 1)[:, None]
    powers[0] += first
    if not np.isfinite(powers).all():
        raise ValueError("derivatives beyond the range of numbers")
    breakpoints = times[0] + knots * scale
    indices = np.clip(np.searchsorted(times, breakpoints), 1, len(times) - 1)
    indices = np.where(breakpoints - times[indices - 1] < times[indices] - breakpoints, indices - 1, indices)
    rounded = np.abs(times[indices] - breakpoints) <= 8 * np.finfo(float).eps * np.abs(times).max()
    return np.where(rounded, times[indices], breakpoints), powers


def _periodic(times: _Samples, values: _Samples, degree: int, beyond: str) -> tuple[_Breakpoints, _Pieces, float]:
    """Return breakpoints, coefficients and gain of a spline that continues smoothly from its end to its beginning."""
    if degree % 2 == 0:
        raise MechanismError("samples that repeat need a spline of odd degree", value=degree)
    difference, spread = float(values[-1] - values[0]), float(np.ptp(values)) or 1.0
    advance = float(whole_periods(difference)) if beyond == "repeat" else difference
    if abs(difference - advance) > CLOSED * spread:
        message = (
            "samples that repeat must end at the value they begin with, or whole turns of 2 pi from it; the last one "
            f"is {difference:g} (SI) from the first: close them, or choose beyond: advance"
        )
        raise MechanismError(message)
    slope = advance / (times[-1] - times[0])
    level = values - slope * (times - times[0])
    level[-1] = level[0]
    breakpoints, coefficients = _interpolated(times, level, degree, bc_type="periodic")
    coefficients[0] += slope * (breakpoints[:-1] - times[0])
    coefficients[1] += slope
    return breakpoints, coefficients, advance


def check_odd(degree: object) -> None:
    """Raise TrajectoryError unless the degree of splines through samples is odd, from 3 to 11."""
    if isinstance(degree, bool) or degree not in range(3, HIGHEST_DEGREE + 1, 2):
        message = f"the degree of the splines is odd, from 3 to {HIGHEST_DEGREE}"
        raise TrajectoryError(f"{message}; even ones carry errors along undamped", name="degree", value=degree)
