"""Motion laws made of segments: dwells, rises and returns by the profiles of cam design, once or again and again."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.errors import TrajectoryError, check_choice, check_name
from jounce.jet import Jet, sin
from jounce.shapes import Numbers
from jounce.trajectory.checks import finite, positive
from jounce.trajectory.expression import Expression
from jounce.trajectory.motion import SplineMotion, Untraced
from jounce.trajectory.profiles import RESTS, rest_to_rest_powers
from jounce.trajectory.trapezoid import LIMITS, TrapezoidalMotion

BEYOND = ("hold", "repeat", "advance")
CLOSED = 1e-9  # of the range of a law: so near to where it began it ends there
SMOOTH = 1e-9  # of the peak of a derivative: a smaller jump is rounding
MOST_CONDITIONS = 10  # derivatives that a polynomial is given at an end

Value = Any
"""A number, an expression of parameters, or what JAX traces."""


@dataclasses.dataclass(frozen=True)
class Segment:
    """A part of a `SegmentedMotion`: how the law goes on, and for how long.

    Parameters
    ----------
    profile : str
        ``dwell``, ``constant_velocity``, ``harmonic``, ``cycloidal``, ``polynomial_3_4_5`` (or ``minimum_jerk``),
        ``polynomial_4_5_6_7`` (or ``minimum_snap``), ``modified_trapezoid``, ``modified_sine``, ``trapezoidal`` (seven
        phases of limited jerk), or ``polynomial``, which meets given derivatives at its ends.
    duration : number or expression, optional
        s, or rad or m where the law is one of another coordinate. Only a trapezoidal segment with limits needs none.
    to, by : number or expression, optional
        The value at the end of the segment, or how far that is from the value at its beginning, m or rad. One of them,
        or none in a dwell.
    begin, end : sequence of number or expression, optional
        Of a polynomial: its derivatives at the beginning and at the end, the velocity first. Unless given, it begins
        with the velocity and the acceleration with which the segment before ends, and ends at rest.
    limits : sequence of 3 numbers or expressions, optional
        Of a trapezoidal segment: largest velocity, acceleration and jerk.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.Segment("cycloidal", duration=0.5, by=0.02).profile
    'cycloidal'
    """

    profile: str
    duration: Value = None
    to: Value = None
    by: Value = None
    begin: Sequence[Value] | None = None
    end: Sequence[Value] | None = None
    limits: Sequence[Value] | None = None


class SegmentedMotion(SplineMotion):
    """A motion law of segments that follow each other, as those of cams do: dwell, rise, dwell, return.

    Every segment begins where the one before it ends. Where they meet, derivatives are those from the right; `jumps`
    tells which are not continuous.

    Parameters
    ----------
    segments : sequence of Segment
        In their order.
    initial : number or expression, default 0
        The value at the beginning, m or rad.
    start : number or expression, default 0
        The instant of the beginning, s (or the coordinate there, where the law is one of another coordinate).
    beyond : {"hold", "repeat", "advance"}, default "hold"
        What the law is before and after: the value at the nearest end; the segments again, which must end where they
        begin; or the segments again, each time from where they ended, as an indexing table does.

    Raises
    ------
    TrajectoryError
        If a profile does not exist, something of a segment is missing, too much or no number, or segments that are to
        repeat do not close.

    Examples
    --------
    >>> import jounce as jn
    >>> lift = jn.SegmentedMotion([
    ...     jn.Segment("dwell", 1.0),
    ...     jn.Segment("cycloidal", 2.0, to=0.03),
    ...     jn.Segment("polynomial_3_4_5", 1.0, to=0.0),
    ... ], beyond="repeat")
    >>> [round(float(x), 12) for x in lift(jn.Jet.variable(6.0, order=1)).derivatives()]
    [0.015, 0.03]
    >>> lift.smoothness  # acceleration is continuous, jerk is not
    2
    """

    sines: Any
    recipe: Untraced = eqx.field(static=True)

    def __init__(self, segments: Sequence[Segment], initial: Value = 0.0, start: Value = 0.0, beyond: str = "hold"):
        check_choice("beyond", beyond, BEYOND, TrajectoryError)
        if not isinstance(segments, Sequence) or not segments:
            raise TrajectoryError("must be a list of at least one jn.Segment", name="segments", value=segments)
        for k, segment in enumerate(segments):
            _check_segment(segment, f"segments[{k}]")
        self.recipe = Untraced((tuple(segments), initial, start, beyond))
        if self._open:
            self._set(np.zeros(1), np.full((1, 1), np.nan), np.zeros(()), "continue")
            self.sines = np.zeros((3, 1))
            return
        pieces, ends, values = _joined(segments, _number("initial", initial))
        begins = [_number("start", start) + end for end in ends]
        advance = values[-1] - values[0]
        if beyond == "repeat":
            _check_closed(values)
            advance = 0.0
        if beyond == "hold":  # at rest, exactly, before and after
            pieces, begins = [_Piece([values[0]]), *pieces, _Piece([values[-1]])], [begins[0] - 1.0, *begins]
        height = max(len(piece.powers) for piece in pieces)
        padded = [piece.powers + [0.0] * (height - len(piece.powers)) for piece in pieces]
        self._set(
            _array(begins[: len(pieces)]),
            _array(padded).T,
            _array(begins[-1]),
            "continue" if beyond == "hold" else "repeat",
            _array(advance),
        )
        self.sines = _array([piece.sine for piece in pieces]).T
        if any(isinstance(x, Tracer) for x in (self.breakpoints, self.coefficients)):
            self.recipe = Untraced(((), 0.0, 0.0, beyond))  # a tracer must not outlive its trace

    @property
    def segments(self) -> tuple[Segment, ...]:
        """The segments as they were given."""
        return self.recipe.value[0]

    @property
    def _open(self) -> list[str]:
        """Names of the parameters without which the law is not known."""
        segments, initial, start, _ = self.recipe.value
        values = [initial, start, *(value for segment in segments for value in _values(segment))]
        return sorted({name for x in map(_parsed, values) if isinstance(x, Expression) for name in x.names})

    def resolved(self, parameters: Mapping[str, Any]) -> "SegmentedMotion":
        """Return the law with numbers in the place of its expressions of parameters."""
        if not self._open:
            return self

        def known(value: Value) -> Value:
            value = _parsed(value)
            return value.evaluate(parameters) if isinstance(value, Expression) else value

        def each(values: Sequence[Value] | None) -> Sequence[Value] | None:
            return None if values is None else [known(value) for value in values]

        segments, initial, start, beyond = self.recipe.value
        found = [
            Segment(s.profile, known(s.duration), known(s.to), known(s.by), each(s.begin), each(s.end), each(s.limits))
            for s in segments
        ]
        return SegmentedMotion(found, known(initial), known(start), beyond)

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet; parameters need their values, see `resolved`."""
        if self._open:
            message = "depends on parameters, whose values a mechanism knows; give numbers"
            raise TrajectoryError(message, name="segments", value=self._open)
        return super().__call__(time)

    def _within(self, time: Jet) -> Jet:
        """Return the jet of the polynomials and the sines at the instants."""
        start, (amplitude, frequency, phase) = self._chosen(time.coefficients[0], jnp.asarray(self.sines))
        return super()._within(time) + sin((time - start) * frequency + phase) * amplitude

    def jumps(self, order: int = 4) -> tuple[Float[np.ndarray, " knots"], Float[np.ndarray, "{order}+1 knots"]]:
        """Return by how much derivatives jump where segments meet, and at the ends.

        Parameters
        ----------
        order : int, default 4
            The highest derivative that is looked at.

        Returns
        -------
        instants : ndarray of shape (knots,)
            Where pieces meet, s; of a law that repeats its beginning stands for its end, too.
        jumps : ndarray of shape (order + 1, knots)
            The value from the right less that from the left, m or rad by s to the power of the order; rounding is zero.

        Examples
        --------
        >>> import jounce as jn
        >>> law = jn.SegmentedMotion([jn.Segment("harmonic", 1.0, to=2.0)])
        >>> instants, jumps = law.jumps(2)
        >>> jumps[2].round(6).tolist()  # acceleration, at the beginning and at the end
        [9.869604, 9.869604]
        """
        begins, lengths = np.asarray(self.breakpoints), np.diff(np.append(self.breakpoints, self.stop))
        left = np.array([_derivatives(self, k, lengths, order) for k in range(len(begins))]).T
        right = np.array([_derivatives(self, k, 0.0 * lengths, order) for k in range(len(begins))]).T
        if self.beyond == "continue":  # the first and the last piece rest
            before, after, instants = left[:, :-1], right[:, 1:], begins[1:]
        else:
            wrapped = left[:, -1] - np.append(np.asarray(self.advance), np.zeros(order))
            before, after, instants = np.column_stack([wrapped, left[:, :-1]]), right, begins
        found, peaks = after - before, _largest(self, lengths, order)[:, None]
        return instants, np.where(np.abs(found) <= SMOOTH * peaks, 0.0, found)

    @property
    def smoothness(self) -> int:
        """The highest derivative to which the law is continuous everywhere, at most 10; -1 if the law itself jumps."""
        _, jumps = self.jumps(MOST_CONDITIONS)
        broken = np.flatnonzero(np.any(jumps != 0, axis=1))
        return int(broken[0]) - 1 if len(broken) else MOST_CONDITIONS


@dataclasses.dataclass(frozen=True)
class _Piece:
    """A polynomial and a sine of the time since the beginning of a piece."""

    powers: list[Value]
    sine: tuple[Value, Value, Value] = (0.0, 0.0, 0.0)  # amplitude, frequency, phase
    length: Value = 0.0

    def stretched(self, way: Value, duration: Value) -> "_Piece":
        """Return the piece over a way and a duration other than one."""
        amplitude, frequency, phase = self.sine
        powers = [c * way / duration**k for k, c in enumerate(self.powers)]
        return _Piece(powers, (amplitude * way, frequency / duration, phase), self.length * duration)

    def lifted(self, value: Value) -> "_Piece":
        """Return the piece with a value added."""
        return _Piece([self.powers[0] + value, *self.powers[1:]], self.sine, self.length)


def _derivatives(law: SegmentedMotion, piece: int, lengths: Any, order: int) -> list[float]:
    """Return the derivatives of a piece of a law a time after its beginning."""
    powers, (amplitude, frequency, phase) = np.asarray(law.coefficients)[:, piece], np.asarray(law.sines)[:, piece]
    at, found = lengths[piece], []
    for k in range(order + 1):
        polynomial = sum(c * math.perm(j, k) * at ** (j - k) for j, c in enumerate(powers) if j >= k)
        found.append(polynomial + amplitude * frequency**k * math.sin(frequency * at + phase + k * math.pi / 2))
    return found


def _largest(law: SegmentedMotion, lengths: Any, order: int) -> Float[np.ndarray, " {order}+1"]:
    """Return bounds of the derivatives of a law, of the size of their peaks."""
    powers, (amplitude, frequency, _) = np.abs(law.coefficients), np.abs(law.sines)
    at = np.minimum(lengths, np.max(lengths[1:], initial=0.0)) if law.beyond == "continue" else lengths
    terms = [
        sum(c * math.perm(j, k) * at ** (j - k) for j, c in enumerate(powers) if j >= k) + amplitude * frequency**k
        for k in range(order + 1)
    ]
    return np.max(np.array(terms), axis=1)


def _joined(segments: Sequence[Segment], value: Value) -> tuple[list[_Piece], list[Value], list[Value]]:
    """Return the pieces of all segments, where each begins and the last one ends, and the values between segments."""
    pieces: list[_Piece] = []
    values = [value]
    ends: list[Value] = [0.0]
    derivatives: list[Value] = [0.0, 0.0]
    for k, segment in enumerate(segments):
        new, target, derivatives = _of_segment(segment, f"segments[{k}]", values[-1], derivatives)
        pieces += new
        values.append(target)
        for piece in new:
            ends.append(ends[-1] + piece.length)
    return pieces, ends, values


def _of_segment(
    segment: Segment, name: str, value: Value, derivatives: list[Value]
) -> tuple[list[_Piece], Value, list[Value]]:
    """Return the pieces of a segment, the value at its end, and the derivatives there, the velocity first."""
    rest: list[Value] = [0.0, 0.0]
    if segment.to is not None:
        target = _number(f"{name}.to", segment.to)
    else:
        target = value if segment.by is None else value + _number(f"{name}.by", segment.by)
    way = target - value
    if segment.limits is not None:
        return _within_limits(segment, name, value, target), target, rest
    duration = _number(f"{name}.duration", segment.duration, positive)
    if segment.profile == "dwell":
        return [_Piece([value], length=duration)], target, rest
    if segment.profile == "constant_velocity":
        return [_Piece([value, way / duration], length=duration)], target, [way / duration, 0.0]
    if segment.profile == "polynomial":
        given = [
            default if x is None else [_number(f"{name}.{key}", entry) for entry in x]
            for key, x, default in (("begin", segment.begin, derivatives), ("end", segment.end, rest))
        ]
        polynomial = _Piece(_meeting([value, *given[0]], [target, *given[1]], duration), length=duration)
        return [polynomial], target, [*given[1], 0.0, 0.0][:2]
    pieces = [piece.stretched(way, duration).lifted(value) for piece in _shape(segment.profile)]
    last = [0.0, -(math.pi**2) / 2 * way / duration**2] if segment.profile == "harmonic" else rest
    return pieces, target, last


def _within_limits(segment: Segment, name: str, value: Value, target: Value) -> list[_Piece]:
    """Return the seven phases of a trapezoidal segment within limits."""
    numbers = (value, target, *(segment.limits or ()), *([] if segment.duration is None else [segment.duration]))
    if any(isinstance(x, Tracer) for x in numbers):
        message = "phases within limits are found case by case, which JAX cannot trace; give a duration, and no limits"
        raise TrajectoryError(message, name=f"{name}.limits")
    bounds = [_number(f"{name}.limits", x, positive) for x in segment.limits or ()]
    given = {} if segment.duration is None else {"duration": _number(f"{name}.duration", segment.duration, positive)}
    if value == target and not given:
        raise TrajectoryError("goes nowhere, so that its limits give it no duration; give one", name=f"{name}.duration")
    try:
        law = TrapezoidalMotion(value, target, **dict(zip(LIMITS, bounds, strict=True)), **given)
    except TrajectoryError as error:
        raise error.located(name=f"{name}.{error.name}" if error.name else name) from None
    lengths = np.diff(law.switches).tolist()
    return [_Piece(c, length=t) for c, t in zip(law.coefficients[:, 1:-1].T.tolist(), lengths, strict=True)]


def _meeting(begin: list[Value], end: list[Value], duration: Value) -> list[Value]:
    """Return the powers of the polynomial of least degree that has values and derivatives at both ends."""
    lower, count = len(begin), len(begin) + len(end)
    first = [x * duration**k / math.factorial(k) for k, x in enumerate(begin)]  # in units of the duration
    matrix = np.array([[math.perm(k, j) for k in range(lower, count)] for j in range(len(end))], float)
    rest = [
        x * duration**j - sum(c * math.perm(k, j) for k, c in enumerate(first) if k >= j) for j, x in enumerate(end)
    ]
    inverse = np.linalg.inv(matrix)
    upper = [sum(float(a) * x for a, x in zip(row, rest, strict=True)) for row in inverse]
    return [c / duration**k for k, c in enumerate([*first, *upper])]


def _check_closed(values: list[Value]) -> None:
    """Raise TrajectoryError unless a law that is to repeat ends where it begins."""
    if any(isinstance(x, Tracer) for x in values):
        return
    away = values[-1] - values[0]
    if abs(away) > CLOSED * (max(values) - min(values)):
        message = f"do not end where they begin, but {away:.6g} from there; close them, or choose beyond: advance"
        raise TrajectoryError(message, name="segments", value=float(values[-1]))


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
def _shape(profile: str) -> tuple[_Piece, ...]:
    """Return the pieces of a profile over a way and a duration of one."""
    if profile in RESTS:
        return (_Piece(rest_to_rest_powers(RESTS[profile]), length=1.0),)
    if profile == "trapezoidal":
        law = TrapezoidalMotion(0.0, 1.0, duration=1.0)
        lengths = np.diff(law.switches).tolist()
        return tuple(_Piece(c, length=t) for c, t in zip(law.coefficients[:, 1:-1].T.tolist(), lengths, strict=True))
    position = velocity = 0.0
    pieces = []
    for length, constant, amplitude, frequency, phase in ACCELERATIONS[profile]:
        reach = amplitude / frequency
        powers = [
            position + reach / frequency * math.sin(phase),
            velocity + reach * math.cos(phase),
            constant / 2,
        ]
        pieces.append(_Piece(powers, (-reach / frequency, frequency, phase), length))
        turned = frequency * length + phase
        position = sum(c * length**k for k, c in enumerate(powers)) - reach / frequency * math.sin(turned)
        velocity = powers[1] + constant * length - reach * math.cos(turned)
    return tuple(_whole(piece, position) for piece in pieces)


def _whole(piece: _Piece, way: float) -> _Piece:
    amplitude, frequency, phase = piece.sine
    return _Piece([c / way for c in piece.powers], (amplitude / way, frequency, phase), piece.length)


def _values(segment: Segment) -> list[Value]:
    lists = [value for part in (segment.begin, segment.end, segment.limits) for value in part or ()]
    return [segment.duration, segment.to, segment.by, *lists]


def _parsed(value: Value) -> Value:
    return Expression(value) if isinstance(value, str) else value


def _number(name: str, value: Value, check: Callable[[str, Any], float] = finite) -> Value:
    """Return a checked number; what JAX traces, and an expression without names, is taken as it is."""
    value = _parsed(value)
    value = value.evaluate() if isinstance(value, Expression) else value
    return value if isinstance(value, Tracer) else check(name, value)


def _array(values: Any) -> Numbers:
    """Return an array of nested lists of numbers, or of what JAX traces among them."""
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves(values))
    return jnp.array(values, float) if traced else np.array(values, float)


def _check_segment(segment: Any, name: str) -> None:
    """Raise TrajectoryError for what a segment lacks, or has too much."""
    if not isinstance(segment, Segment):
        raise TrajectoryError("must be a jn.Segment", name=name, value=segment)
    check_name("profile", segment.profile, SEGMENT_PROFILES, TrajectoryError, name=f"{name}.profile")
    given = [key for key in ("to", "by") if getattr(segment, key) is not None]
    if segment.profile == "dwell" and given:
        raise TrajectoryError("a dwell goes nowhere", name=f"{name}.{given[0]}", value=getattr(segment, given[0]))
    if segment.profile != "dwell" and len(given) != 1:
        message = "give where the segment goes by to or by, not both" if given else "give where it goes: to, or by"
        raise TrajectoryError(message, name=name)
    for key, profile in (("begin", "polynomial"), ("end", "polynomial"), ("limits", "trapezoidal")):
        value = getattr(segment, key)
        if value is None:
            continue
        if segment.profile != profile:
            raise TrajectoryError(f"goes with the profile {profile} only", name=f"{name}.{key}", value=value)
        if isinstance(value, str) or not isinstance(value, Sequence):
            raise TrajectoryError("must be a list of numbers", name=f"{name}.{key}", value=value)
        if key == "limits" and len(value) != len(LIMITS):
            message = "limits are three numbers, the largest velocity, acceleration and jerk"
            raise TrajectoryError(message, name=f"{name}.limits", value=list(value))
        if key != "limits" and len(value) > MOST_CONDITIONS:
            raise TrajectoryError(f"at most {MOST_CONDITIONS} derivatives", name=f"{name}.{key}", value=list(value))
    if segment.duration is None and segment.limits is None:
        raise TrajectoryError("is missing", name=f"{name}.duration")
