"""Point-to-point laws with a trapezoidal velocity and limited jerk."""

import math

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import seconds
from jounce.errors import TrajectoryError
from jounce.trajectory.checks import finite, positive
from jounce.trajectory.motion import SplineMotion

LIMITS = ("velocity", "acceleration", "jerk")


class TrapezoidalMotion(SplineMotion):
    """A point-to-point law with a trapezoidal velocity and limited jerk: the double S of seven phases.

    The phases are: jerk up, constant acceleration, jerk down, constant velocity, jerk down, constant deceleration, jerk
    up; a phase has no length if the rise is too short for it. Derivatives are one-sided from the right where phases
    meet; those above the third vanish. Before and after, the law holds its ends.

    Parameters
    ----------
    start, end : float
        Values at the beginning and at the end, m or rad.
    velocity, acceleration, jerk : float, optional
        Limits, all three or none, m or rad per s, s^2 and s^3: the law is the quickest within them.
    duration : float, optional
        Time from the beginning to the end, s, to which the quickest law is stretched. Without limits, the seven phases
        have equal length.
    start_time : float, default 0
        Initial instant, s.

    Raises
    ------
    TrajectoryError
        If a value is not finite or a limit not greater than zero, if neither limits nor a duration are given, or if the
        limits do not allow the duration.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.TrapezoidalMotion(0.0, 4.0, velocity=1.0, acceleration=1.0, jerk=1.0)
    >>> law.switches.tolist()
    [0.0, 1.0, 1.0, 2.0, 4.0, 5.0, 5.0, 6.0]
    >>> [float(x) for x in law(jn.Jet.variable(3.0, order=3)).derivatives()]
    [2.0, 1.0, 0.0, 0.0]
    """

    def __init__(
        self,
        start: float,
        end: float,
        velocity: float | None = None,
        acceleration: float | None = None,
        jerk: float | None = None,
        duration: float | None = None,
        start_time: float = 0.0,
    ):
        start, end, start_time = finite("start", start), finite("end", end), finite("start_time", start_time, seconds)
        if duration is not None:
            duration = positive("duration", duration, seconds)
        distance = abs(end - start)
        limits = {name: x for name, x in zip(LIMITS, (velocity, acceleration, jerk), strict=True) if x is not None}
        if len(limits) == len(LIMITS):
            lengths = np.array(_quickest(distance, *(positive(name, value) for name, value in limits.items())))
        elif limits:
            message = "limits on velocity, acceleration and jerk are needed, all three or none"
            raise TrajectoryError(message, value=sorted(limits))
        elif duration is None:
            raise TrajectoryError("either the three limits or a duration are needed", name="duration", value=duration)
        else:
            lengths = np.full(7, duration / 7)
        quickest = float(lengths.sum())
        if duration is not None and duration < quickest * (1 - 1e-12):
            message = f"the limits do not allow this duration; the quickest takes {quickest:.9g} s"
            raise TrajectoryError(message, name="duration", value=duration)
        if duration is not None and quickest > 0:
            lengths = lengths * (duration / quickest)
        total_length = quickest if duration is None else duration
        pieces = _phases(lengths, start, end)
        starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1], [total_length]])
        begins = start_time + np.concatenate([[-1.0], starts])
        self._set(begins, pieces, begins[-1], "continue")  # the first and the last piece are at rest

    @property
    def switches(self) -> Float[np.ndarray, "8"]:
        """The eight instants at which the phases begin and the last one ends, s."""
        return self.breakpoints[1:]

    @property
    def duration(self) -> float:
        """Time from the beginning to the end, s."""
        return float(self.breakpoints[-1] - self.breakpoints[1])


def _quickest(distance: float, velocity: float, acceleration: float, jerk: float) -> tuple[float, ...]:
    """Return the lengths of the seven phases of the quickest law from rest to rest within limits."""
    ramp = min(acceleration / jerk, math.sqrt(velocity / jerk))  # duration of a phase of jerk
    steady = max(velocity / (jerk * ramp) - ramp, 0.0)  # duration of a phase of constant acceleration
    if steady < 1e-12 * ramp:
        steady = 0.0
    cruise = distance / velocity - (2 * ramp + steady)
    if cruise < 0:  # the rise is too short for the velocity
        cruise = 0.0
        ramp = min(acceleration / jerk, math.cbrt(distance / (2 * jerk)))
        rising = ramp / 2 + math.sqrt(ramp**2 / 4 + distance / (jerk * ramp)) if ramp > 0 else 0.0
        steady = max(rising - 2 * ramp, 0.0) if acceleration / jerk <= ramp else 0.0
    return ramp, steady, ramp, cruise, ramp, steady, ramp


def _phases(lengths: Float[np.ndarray, "7"], start: float, end: float) -> Float[np.ndarray, "4 9"]:
    """Return the local Taylor coefficients of rest, seven phases and rest, shape (4, 9)."""
    signs = np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])
    position = velocity = acceleration = 0.0
    states = []
    for sign, length in zip(signs, lengths, strict=True):
        states.append((position, velocity, acceleration / 2, sign / 6))
        position += length * (velocity + length * (acceleration / 2 + length * sign / 6))
        velocity += length * (acceleration + length * sign / 2)
        acceleration += length * sign
    scale = (end - start) / position if position > 0 else 0.0  # the jerk that makes the rise
    phases = np.array(states).T * scale
    phases[0] += start
    resting = np.zeros((4, 2))
    resting[0] = start, end
    return np.concatenate([resting[:, :1], phases, resting[:, 1:]], axis=1)
