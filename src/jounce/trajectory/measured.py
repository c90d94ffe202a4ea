"""Motion laws of which a derivative was measured: splines through its samples, integrated exactly."""

import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import numpy as np

from jounce.errors import MechanismError
from jounce.trajectory.motion import Aside, SplineMotion, check_beyond
from jounce.trajectory.sampling import derivative_errors
from jounce.trajectory.splines import checked_samples, interpolated

MOST = 4  # derivatives: jounce
BEYOND = ("refuse", "hold", "continue")


class MeasuredMotion(SplineMotion):
    """A motion law one of whose derivatives goes through samples, such as measured accelerations.

    The spline through the samples is integrated exactly; what the samples do not say is given at the first of them.
    Negrean 2025, section 4, drives a robot so.

    Parameters
    ----------
    times : array_like of shape (samples,)
        Strictly increasing instants, s.
    values : array_like of shape (samples,)
        Samples of the derivative, m or rad by s to the power of `derivative`.
    derivative : int, default 2
        Which derivative was measured: 1 velocity, 2 acceleration, 3 jerk, 4 jounce.
    initial : sequence of float, optional
        The law and its derivatives below `derivative` at the first sample, lowest first; zero where not given.
    degree : int, default 5
        Of the spline through the samples, from 1 to 11; that of the law is higher by `derivative`.
    beyond : {"refuse", "hold", "continue"}, default "refuse"
        What the law is before the first and after the last sample, as for `SplineMotion`.

    Raises
    ------
    MechanismError
        If the samples are not valid, as for `SplineMotion`, or there are too many initial values.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> law = jn.MeasuredMotion(t, 6 * t, derivative=2, initial=[2.0, 1.0])  # accelerations of t^3
    >>> [round(float(x), 9) for x in law(jn.Jet.variable(0.5, order=3)).derivatives()]
    [2.625, 1.75, 3.0, 6.0]
    """

    derivative: int = eqx.field(static=True)
    initial: Aside = eqx.field(static=True)

    def __init__(
        self,
        times: Any,
        values: Any,
        derivative: int = 2,
        initial: Sequence[float] = (),
        degree: int = 5,
        beyond: str = "refuse",
    ):
        times, values = checked_samples(times, values, degree)
        check_beyond(beyond, BEYOND)
        if isinstance(derivative, bool) or not isinstance(derivative, int | np.integer) or not 1 <= derivative <= MOST:
            message = f"must be a whole number from 1 to {MOST}"
            raise MechanismError(message, name="derivative", value=derivative)
        known = _initial(initial, int(derivative))
        try:
            ends, pieces = interpolated(times, values, int(degree))
        except (np.linalg.LinAlgError, ValueError):
            message = "no spline goes through the samples: too uneven or too large; sample evenly"
            raise MechanismError(message, value=float(np.diff(times).min())) from None
        for value in reversed(known):
            pieces = integrated(pieces, np.diff(ends), value)
        self._set(ends[:-1], pieces, ends[-1], beyond, samples=(times, values))
        self.derivative, self.initial = int(derivative), Aside(tuple(known))

    @property
    def errors(self) -> np.ndarray:
        """Estimated errors of the derivatives, relative to their peaks, (degree + 1,)."""
        if self.samples.derived is None:
            times, values = self.samples.value
            measured = derivative_errors(times, values, self.degree - self.derivative)
            self.samples.derived = np.concatenate([np.full(self.derivative, measured[0]), measured])
        return self.samples.derived


def integrated(pieces: np.ndarray, lengths: np.ndarray, initial: float) -> np.ndarray:
    """Return the integral of piecewise polynomials, as local Taylor coefficients, from a value at the beginning."""
    raised = pieces / np.arange(1, len(pieces) + 1)[:, None]
    gains = (raised * lengths ** np.arange(1, len(raised) + 1)[:, None]).sum(axis=0)
    values = [math.fsum([initial, *gains[:k]]) for k in range(len(gains))]
    return np.concatenate([[values], raised])


def _initial(initial: Any, derivative: int) -> list[float]:
    """Return the values at the first sample, zeros added."""
    try:
        known = [float(x) for x in initial]
    except (TypeError, ValueError):
        raise MechanismError("must be a list of numbers", name="initial", value=initial) from None
    if len(known) > derivative or not np.isfinite(known).all():
        message = f"must be at most {derivative} finite numbers: the law and its derivatives below the measured one"
        raise MechanismError(message, name="initial", value=known)
    return known + [0.0] * (derivative - len(known))
