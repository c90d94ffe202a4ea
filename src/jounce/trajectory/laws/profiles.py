"""Smooth point-to-point laws: polynomials at rest at both ends, the cycloid, and all profiles by name."""

import abc
import math
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.base.modules import field
from jounce.base.shapes import seconds
from jounce.errors import TrajectoryError, check_name
from jounce.jet import Jet, sin
from jounce.trajectory.checks import finite, positive, whole_number
from jounce.trajectory.laws.trapezoid import LIMITS, TrapezoidalMotion
from jounce.trajectory.motion import AbstractMotion

MAX_REST = 8


class AbstractProfile(AbstractMotion):
    """A law from rest to rest that is symmetric about its middle, and holds its ends before and after.

    A subclass gives the first half, as a share of the rise for a share of the duration; the second half mirrors it.
    Derivatives are one-sided from the right at the beginning and at the end.
    """

    start: Any
    end: Any
    duration: Any
    start_time: Any

    def __init__(self, start: float = 0.0, end: float = 1.0, duration: float = 1.0, start_time: float = 0.0):
        self.start, self.end = finite("start", start), finite("end", end)
        self.duration, self.start_time = (
            positive("duration", duration, seconds),
            finite("start_time", start_time, seconds),
        )

    @abc.abstractmethod
    def first_half(self, share: Jet) -> Jet:
        """Return the share of the rise after a share of the duration from 0 to 1/2."""

    @property
    @abc.abstractmethod
    def peaks(self) -> tuple[float, float, float]:
        """Largest velocity, acceleration and jerk for a rise and a duration of 1."""

    @property
    def stop_time(self) -> Any:
        """Instant from which the law is at rest again, s."""
        return self.start_time + self.duration

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet."""
        instants = time.coefficients[0]
        is_late = 2 * (instants - self.start_time) >= self.duration
        is_moving = (instants >= self.start_time) & (instants < self.stop_time)
        # time counts from the nearer end, so that rest is exact at both; outside, from that end itself
        elapsed, remaining = (time - self.start_time) / self.duration, (self.stop_time - time) / self.duration
        pairs = zip(elapsed.dense().coefficients, remaining.dense().coefficients, strict=True)
        nearer = Jet(jnp.where(is_late, b, f) for f, b in pairs)
        nearer = Jet((jnp.where(is_moving, nearer.coefficients[0], 0.0), *nearer.coefficients[1:]))
        half = self.first_half(nearer).dense().coefficients
        distance = jnp.asarray(self.end - self.start)
        signed = jnp.where(is_late, -distance, distance)
        value = jnp.where(is_late, self.end, self.start) + jnp.where(is_moving, signed * half[0], 0.0)
        return Jet((value, *(jnp.where(is_moving, signed * c, 0.0) for c in half[1:])))


class RestToRestMotion(AbstractProfile):
    """A point-to-point polynomial of degree ``2 r + 1``, at rest to the derivative of order r at both ends.

    The share of the rise after the share u of the duration is ``u^(r+1) sum_k C(r+k, k) (1 - u)^k``, k from 0 to r.
    With r = 2 it is the 3-4-5 polynomial, the law of minimum jerk (of the least integral of the square of jerk), with r
    = 3 the 4-5-6-7 polynomial, the law of minimum snap (jounce). Before and after, the law holds its ends.

    Parameters
    ----------
    start, end : float, default 0 and 1
        Values at the beginning and at the end, m or rad.
    duration : float, default 1
        Time from the beginning to the end, s.
    start_time : float, default 0
        Initial instant, s.
    rest : int, default 2
        Order r up to which the derivatives vanish at both ends, from 1 to 8.

    Raises
    ------
    TrajectoryError
        If a value is not finite, or the duration is not greater than zero.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.RestToRestMotion(0.0, 1.0, duration=2.0)
    >>> [float(x) for x in law(jn.Jet.variable(1.0, order=1)).derivatives()]
    [0.5, 0.9375]
    """

    rest: int = field(static=True)

    def __init__(
        self, start: float = 0.0, end: float = 1.0, duration: float = 1.0, start_time: float = 0.0, rest: int = 2
    ):
        super().__init__(start, end, duration, start_time)
        self.rest = whole_number("rest", rest, 1, MAX_REST)

    def first_half(self, share: Jet) -> Jet:
        """Return the share of the rise after a share of the duration."""
        *lower, top = rest_to_rest_powers(self.rest)[self.rest + 1 :]
        value = share * top
        for coefficient in reversed(lower):
            value = (value + coefficient) * share
        return value * share**self.rest

    @property
    def peaks(self) -> tuple[float, float, float]:
        """Largest velocity, acceleration and jerk for a rise and a duration of 1."""
        law = np.polynomial.Polynomial(rest_to_rest_powers(self.rest))
        first, second, third = (_largest(law.deriv(k)) for k in (1, 2, 3))
        return first, second, third


def rest_to_rest_powers(rest: int) -> list[float]:
    """Return the coefficients of the powers from 0 to ``2 rest + 1`` for a rise and a duration of 1."""
    powers = [(-1) ** j * math.comb(rest + j, j) * math.comb(2 * rest + 1, rest - j) for j in range(rest + 1)]
    return [0.0] * (rest + 1) + [float(c) for c in powers]


def _largest(law: np.polynomial.Polynomial) -> float:
    """Return the largest absolute value on [0, 1/2], which suffices by symmetry."""
    roots = law.deriv().roots()
    inner_roots = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0) & (roots.real < 0.5)]
    return float(np.abs(law(np.concatenate([inner_roots, [0.0, 0.5]]))).max())


class CycloidalMotion(AbstractProfile):
    """A point-to-point law along a cycloid: the acceleration is one full wave of a sine.

    The share of the rise after the share u of the duration is ``u - sin(2 pi u) / (2 pi)``. Acceleration is continuous
    and zero at both ends, where jerk jumps. Before and after, the law holds its ends.

    Parameters
    ----------
    start, end : float, default 0 and 1
        Values at the beginning and at the end, m or rad.
    duration : float, default 1
        Time from the beginning to the end, s.
    start_time : float, default 0
        Initial instant, s.

    Raises
    ------
    TrajectoryError
        If a value is not finite, or the duration is not greater than zero.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.CycloidalMotion(0.0, 1.0, duration=2.0)
    >>> [round(float(x), 12) for x in law(jn.Jet.variable(0.5, order=2)).derivatives()]
    [0.090845056908, 0.5, 1.570796326795]
    """

    def first_half(self, share: Jet) -> Jet:
        """Return the share of the rise after a share of the duration."""
        angle = share * (2 * math.pi)
        return (angle - sin(angle)) / (2 * math.pi)  # exactly at rest at its beginning

    @property
    def peaks(self) -> tuple[float, float, float]:
        """Largest velocity, acceleration and jerk for a rise and a duration of 1."""
        return 2.0, 2 * math.pi, 4 * math.pi**2


RESTS = {"polynomial_3_4_5": 2, "polynomial_4_5_6_7": 3, "minimum_jerk": 2, "minimum_snap": 3}
"""Orders up to which the polynomials are at rest at both ends."""
PROFILES = ("cycloidal", *RESTS, "trapezoidal")
"""Names of the profiles."""


def motion_profile(
    name: str,
    start: float,
    end: float,
    duration: float | None = None,
    start_time: float = 0.0,
    limits: Sequence[float] | None = None,
) -> AbstractMotion:
    """Return a point-to-point law by the name of its profile.

    Parameters
    ----------
    name : str
        cycloidal, polynomial_3_4_5 (or minimum_jerk), polynomial_4_5_6_7 (or minimum_snap), trapezoidal.
    start, end : float
        Values at the beginning and at the end, m or rad.
    duration : float, optional
        Time from the beginning to the end, s; by default the shortest within the limits.
    start_time : float, default 0
        Initial instant, s.
    limits : sequence of 3 float, optional
        Largest velocity, acceleration and jerk; without a duration, the law is the quickest within them.

    Returns
    -------
    AbstractMotion
        The law, which holds its ends before and after.

    Raises
    ------
    TrajectoryError
        If the profile does not exist, neither a duration nor limits are given, or the limits do not allow the duration.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.motion_profile("cycloidal", 0.0, 1.0, limits=(2.0, 20.0, 500.0))
    >>> float(law.duration)
    1.0
    """
    check_name("profile", name, PROFILES, TrajectoryError, name="profile")
    if limits is not None and len(limits) != len(LIMITS):
        message = "limits are three numbers, the largest velocity, acceleration and jerk"
        raise TrajectoryError(message, name="limits", value=list(limits))
    if name == "trapezoidal":
        return TrapezoidalMotion(start, end, *(limits or (None,) * 3), duration=duration, start_time=start_time)

    def law(time: float) -> AbstractProfile:
        if name == "cycloidal":
            return CycloidalMotion(start, end, time, start_time)
        return RestToRestMotion(start, end, time, start_time, RESTS[name])

    if limits is None:
        if duration is None:
            raise TrajectoryError("either limits or a duration are needed", name="duration", value=duration)
        return law(duration)
    bounds = [positive(limit, value) for limit, value in zip(LIMITS, limits, strict=True)]
    distance = abs(finite("end", end) - finite("start", start))
    peaks = zip(law(1.0).peaks, bounds, strict=True)
    quickest = max((distance * peak / limit) ** (1 / order) for order, (peak, limit) in enumerate(peaks, start=1))
    if duration is None:
        return law(quickest or 1.0)
    if duration < quickest * (1 - 1e-12):
        message = f"the limits do not allow this duration; the quickest takes {quickest:.9g} s"
        raise TrajectoryError(message, name="duration", value=duration)
    return law(duration)
