"""Segments of motion laws, and the polynomials and sines of their pieces: the profiles of cam design.

Harmonic, cycloidal, modified trapezoidal and modified sine laws are given by their accelerations, which consist of
sines and constants, and are integrated exactly.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from jax.core import Tracer

from jounce.errors import TrajectoryError
from jounce.trajectory.checks import finite, positive
from jounce.trajectory.laws.profiles import RESTS, rest_to_rest_powers
from jounce.trajectory.laws.trapezoid import LIMITS, TrapezoidalMotion
from jounce.units.expression import Expression

Value = Any
"""A number, an expression of parameters, or a traced value."""


@dataclasses.dataclass(frozen=True)
class Segment:
    """A part of a `SegmentedMotion`: its profile, duration and rise.

    Parameters
    ----------
    profile : str
        ``dwell``, ``constant_velocity``, ``harmonic``, ``cycloidal``, ``polynomial_3_4_5`` (or ``minimum_jerk``),
        ``polynomial_4_5_6_7`` (or ``minimum_snap``), ``modified_trapezoid``, ``modified_sine``, ``trapezoidal`` (seven
        phases of limited jerk), or ``polynomial``, which meets given derivatives at its ends.
    duration : number or expression, optional
        Duration, s, or rad or m for a law of another coordinate; only a trapezoidal segment with limits needs none.
    to, by : number or expression, optional
        Value at the end of the segment, or its difference from the value at the beginning, m or rad. One of them, or
        none for a dwell.
    begin, end : sequence of number or expression, optional
        Derivatives of a polynomial at the beginning and at the end, the velocity first. By default, it begins with the
        velocity and the acceleration at the end of the previous segment, and ends at rest.
    limits : sequence of 3 numbers or expressions, optional
        Largest velocity, acceleration and jerk of a trapezoidal segment.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.laws.Segment("cycloidal", duration=0.5, by=0.02).profile
    'cycloidal'
    """

    profile: str
    duration: Value = None
    to: Value = None
    by: Value = None
    begin: Sequence[Value] | None = None
    end: Sequence[Value] | None = None
    limits: Sequence[Value] | None = None


@dataclasses.dataclass(frozen=True)
class Piece:
    """A polynomial and a sine of the time since the beginning of a piece."""

    powers: list[Value]
    sine: tuple[Value, Value, Value] = (0.0, 0.0, 0.0)  # amplitude, frequency, phase
    length: Value = 0.0

    def stretched(self, rise: Value, duration: Value) -> "Piece":
        """Return the piece for another rise and duration."""
        amplitude, frequency, phase = self.sine
        powers = [c * rise / duration**k for k, c in enumerate(self.powers)]
        return Piece(powers, (amplitude * rise, frequency / duration, phase), self.length * duration)

    def lifted(self, value: Value) -> "Piece":
        """Return the piece with a value added."""
        return Piece([self.powers[0] + value, *self.powers[1:]], self.sine, self.length)


def joined_pieces(segments: Sequence[Segment], value: Value) -> tuple[list[Piece], list[Value], list[Value]]:
    """Return the pieces of all segments, their beginnings with the final end, and the values between segments."""
    pieces: list[Piece] = []
    values = [value]
    ends: list[Value] = [0.0]
    derivatives: list[Value] = [0.0, 0.0]
    for k, segment in enumerate(segments):
        added, target, derivatives = _of_segment(segment, f"segments[{k}]", values[-1], derivatives)
        pieces += added
        values.append(target)
        for piece in added:
            ends.append(ends[-1] + piece.length)
    return pieces, ends, values


def _of_segment(
    segment: Segment, name: str, value: Value, derivatives: list[Value]
) -> tuple[list[Piece], Value, list[Value]]:
    """Return the pieces of a segment, the value at its end, and the derivatives there, the velocity first."""
    at_rest: list[Value] = [0.0, 0.0]
    if segment.to is not None:
        target = number_of_value(f"{name}.to", segment.to)
    else:
        target = value if segment.by is None else value + number_of_value(f"{name}.by", segment.by)
    rise = target - value
    if segment.limits is not None:
        return _within_limits(segment, name, value, target), target, at_rest
    duration = number_of_value(f"{name}.duration", segment.duration, positive)
    if segment.profile == "dwell":
        return [Piece([value], length=duration)], target, at_rest
    if segment.profile == "constant_velocity":
        return [Piece([value, rise / duration], length=duration)], target, [rise / duration, 0.0]
    if segment.profile == "polynomial":
        conditions = [
            default if x is None else [number_of_value(f"{name}.{key}", entry) for entry in x]
            for key, x, default in (("begin", segment.begin, derivatives), ("end", segment.end, at_rest))
        ]
        powers = _meeting([value, *conditions[0]], [target, *conditions[1]], duration)
        # derivatives without a condition follow from the polynomial, and the next segment begins with them
        derived = [_derivative(powers, order, duration) for order in range(len(conditions[1]) + 1, len(at_rest) + 1)]
        return [Piece(powers, length=duration)], target, [*conditions[1], *derived][: len(at_rest)]
    pieces = [piece.stretched(rise, duration).lifted(value) for piece in _shape(segment.profile)]
    end_derivatives = [0.0, -(math.pi**2) / 2 * rise / duration**2] if segment.profile == "harmonic" else at_rest
    return pieces, target, end_derivatives


def _within_limits(segment: Segment, name: str, value: Value, target: Value) -> list[Piece]:
    """Return the seven phases of a trapezoidal segment within limits."""
    numbers = (value, target, *(segment.limits or ()), *([] if segment.duration is None else [segment.duration]))
    if any(isinstance(x, Tracer) for x in numbers):
        message = "phases within limits are found case by case, which JAX cannot trace; give a duration, and no limits"
        raise TrajectoryError(message, name=f"{name}.limits")
    bounds = [number_of_value(f"{name}.limits", x, positive) for x in segment.limits or ()]
    options = (
        {}
        if segment.duration is None
        else {"duration": number_of_value(f"{name}.duration", segment.duration, positive)}
    )
    if value == target and not options:
        raise TrajectoryError(
            "has no displacement, so that its limits determine no duration; give one", name=f"{name}.duration"
        )
    try:
        law = TrapezoidalMotion(value, target, **dict(zip(LIMITS, bounds, strict=True)), **options)
    except TrajectoryError as error:
        raise error.located(name=f"{name}.{error.name}" if error.name else name) from None
    lengths = np.diff(law.switches).tolist()
    return [Piece(c, length=t) for c, t in zip(law.coefficients[:, 1:-1].T.tolist(), lengths, strict=True)]


def _meeting(begins: list[Value], ends: list[Value], duration: Value) -> list[Value]:
    """Return the powers of the polynomial of least degree with given values and derivatives at both ends."""
    lower, count = len(begins), len(begins) + len(ends)
    first = [x * duration**k / math.factorial(k) for k, x in enumerate(begins)]  # in units of the duration
    matrix = np.array([[math.perm(k, j) for k in range(lower, count)] for j in range(len(ends))], float)
    residuals = [
        x * duration**j - sum(c * math.perm(k, j) for k, c in enumerate(first) if k >= j) for j, x in enumerate(ends)
    ]
    inverse = np.linalg.inv(matrix)
    upper = [sum(float(a) * x for a, x in zip(row, residuals, strict=True)) for row in inverse]
    return [c / duration**k for k, c in enumerate([*first, *upper])]


def _derivative(powers: list[Value], order: int, instant: Value) -> Value:
    """Return a derivative of a polynomial."""
    return sum(c * math.perm(k, order) * instant ** (k - order) for k, c in enumerate(powers) if k >= order)


# accelerations by parts: share of the duration, constant, and amplitude, frequency and phase of a sine
QUARTER, UP, DOWN = 4 * math.pi, math.pi / 2, 3 * math.pi / 2
ACCELERATIONS = {
    "harmonic": ((1.0, 0.0, 1.0, math.pi, UP),),
    "cycloidal": ((1.0, 0.0, 1.0, 2 * math.pi, 0.0),),
    "modified_sine": (
        (0.125, 0.0, 1.0, QUARTER, 0.0), (0.75, 0.0, 1.0, QUARTER / 3, UP), (0.125, 0.0, 1.0, QUARTER, DOWN),
    ),
    "modified_trapezoid": (
        (0.125, 0.0, 1.0, QUARTER, 0.0), (0.25, 1.0, 0.0, 1.0, 0.0), (0.25, 0.0, 1.0, QUARTER, UP),
        (0.25, -1.0, 0.0, 1.0, 0.0), (0.125, 0.0, 1.0, QUARTER, DOWN),
    ),
}  # fmt: skip
SEGMENT_PROFILES = ("dwell", "constant_velocity", *ACCELERATIONS, *RESTS, "trapezoidal", "polynomial")


@lru_cache
def _shape(profile: str) -> tuple[Piece, ...]:
    """Return the pieces of a profile for a rise and a duration of one."""
    if profile in RESTS:
        return (Piece(rest_to_rest_powers(RESTS[profile]), length=1.0),)
    if profile == "trapezoidal":
        law = TrapezoidalMotion(0.0, 1.0, duration=1.0)
        lengths = np.diff(law.switches).tolist()
        return tuple(Piece(c, length=t) for c, t in zip(law.coefficients[:, 1:-1].T.tolist(), lengths, strict=True))
    position = velocity = 0.0
    pieces = []
    for length, constant, amplitude, frequency, phase in ACCELERATIONS[profile]:
        reach = amplitude / frequency
        powers = [
            position + reach / frequency * math.sin(phase),
            velocity + reach * math.cos(phase),
            constant / 2,
        ]
        pieces.append(Piece(powers, (-reach / frequency, frequency, phase), length))
        end_phase = frequency * length + phase
        position = sum(c * length**k for k, c in enumerate(powers)) - reach / frequency * math.sin(end_phase)
        velocity = powers[1] + constant * length - reach * math.cos(end_phase)
    return tuple(_whole(piece, position) for piece in pieces)


def _whole(piece: Piece, rise: float) -> Piece:
    amplitude, frequency, phase = piece.sine
    return Piece([c / rise for c in piece.powers], (amplitude / rise, frequency, phase), piece.length)


def parsed_value(value: Value) -> Value:
    """Return a value, with text parsed as an expression."""
    return Expression(value) if isinstance(value, str) else value


def number_of_value(name: str, value: Value, check: Callable[[str, Any], float] = finite) -> Value:
    """Return a checked number, with an expression without names evaluated; a traced value is returned unchanged."""
    value = parsed_value(value)
    value = value.evaluate() if isinstance(value, Expression) else value
    return value if isinstance(value, Tracer) else check(name, value)


def number_or_expression(name: str, value: Value) -> Value:
    """Return a checked number; an expression of parameters or a traced value is returned unchanged."""
    value = parsed_value(value)
    return value if isinstance(value, Expression) and value.names else number_of_value(name, value)
