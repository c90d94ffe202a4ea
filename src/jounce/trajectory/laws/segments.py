"""Motion laws of segments: dwells, rises and returns by the profiles of cam design, possibly repeated."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import field
from jounce.base.shapes import Numbers, is_traced
from jounce.errors import TrajectoryError, check_choice, check_name
from jounce.jet import Jet, sin
from jounce.trajectory.beyond import CLOSED
from jounce.trajectory.knots import knot_jumps
from jounce.trajectory.laws.segment_pieces import (
    SEGMENT_PROFILES,
    Piece,
    Segment,
    Value,
    joined_pieces,
    number_of_value,
    parsed_value,
)
from jounce.trajectory.laws.trapezoid import LIMITS
from jounce.trajectory.motion import SplineMotion, Untraced
from jounce.units.expression import Expression

BEYOND = ("hold", "repeat", "advance")
MOST_CONDITIONS = 10  # derivatives of a polynomial at an end


class SegmentedMotion(SplineMotion):
    """A motion law of consecutive segments, as in cam design: dwell, rise, dwell, return.

    Every segment begins where the one before it ends. At the joins, derivatives are those from the right; `jumps`
    returns the discontinuous ones.

    Parameters
    ----------
    segments : sequence of Segment
        Segments in order.
    initial : number or expression, default 0
        Initial value, m or rad.
    start : number or expression, default 0
        Initial instant, s (or the coordinate, for a law of another coordinate).
    beyond : {"hold", "repeat", "advance"}, default "hold"
        The law before and after the segments: the value of the nearest end; a repetition, for segments that end where
        they begin; or a repetition that advances from where the segments ended, as for an indexing table.

    Raises
    ------
    TrajectoryError
        If a profile does not exist, an entry of a segment is missing, superfluous or no number, or segments to be
        repeated are not closed.

    Examples
    --------
    >>> import jounce as jn
    >>> lift = jn.laws.SegmentedMotion([
    ...     jn.laws.Segment("dwell", 1.0),
    ...     jn.laws.Segment("cycloidal", 2.0, to=0.03),
    ...     jn.laws.Segment("polynomial_3_4_5", 1.0, to=0.0),
    ... ], beyond="repeat")
    >>> [round(float(x), 12) for x in lift(jn.Jet.variable(6.0, order=1)).derivatives()]
    [0.015, 0.03]
    >>> lift.smoothness  # acceleration is continuous, jerk is not
    2
    """

    sines: Any
    recipe: Untraced = field(static=True)

    def __init__(self, segments: Sequence[Segment], initial: Value = 0.0, start: Value = 0.0, beyond: str = "hold"):
        check_choice("beyond", beyond, BEYOND, TrajectoryError)
        if not isinstance(segments, Sequence) or not segments:
            raise TrajectoryError("must be a list of at least one jn.laws.Segment", name="segments", value=segments)
        for k, segment in enumerate(segments):
            _check_segment(segment, f"segments[{k}]")
        self.recipe = Untraced((tuple(segments), initial, start, beyond))
        if self._open:
            self._set(np.zeros(1), np.full((1, 1), np.inf), np.zeros(()), "continue")  # equal to itself, but no number
            self.sines = np.zeros((3, 1))
            return
        pieces, ends, values = joined_pieces(segments, number_of_value("initial", initial))
        begins = [number_of_value("start", start) + end for end in ends]
        advance = values[-1] - values[0]
        if beyond == "repeat":
            _check_closed(values)
            advance = 0.0
        if beyond == "hold":  # exactly at rest before and after
            pieces, begins = [Piece([values[0]]), *pieces, Piece([values[-1]])], [begins[0] - 1.0, *begins]
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
        if is_traced((self.breakpoints, self.coefficients)):
            self.recipe = Untraced(((), 0.0, 0.0, beyond))  # a tracer must not outlive its trace

    @property
    def segments(self) -> tuple[Segment, ...]:
        """The segments as given."""
        return self.recipe.value[0]

    def lasts(self, duration: float) -> bool:
        """Return whether the segments extend from zero to a duration, s, or an angle."""
        first = 1 if self.beyond == "continue" else 0  # the first and the last piece are at rest
        start = float(np.asarray(self.breakpoints)[first])
        return abs(start) <= CLOSED * duration and abs(float(self.stop) - duration) <= CLOSED * duration

    def repeated(self) -> "SegmentedMotion":
        """Return the law with repeated segments.

        Raises
        ------
        TrajectoryError
            If the segments do not end where they begin.
        """
        segments, initial, start, _ = self.recipe.value
        return SegmentedMotion(segments, initial, start, "repeat")

    @property
    def _open(self) -> list[str]:
        """Names of the parameters that lack values."""
        segments, initial, start, _ = self.recipe.value
        values = [initial, start, *(value for segment in segments for value in _values(segment))]
        return sorted({name for x in map(parsed_value, values) if isinstance(x, Expression) for name in x.names})

    def resolved(self, parameters: Mapping[str, Any]) -> "SegmentedMotion":
        """Return the law with numbers in the place of expressions of parameters."""
        if not self._open:
            return self

        def known(value: Value) -> Value:
            value = parsed_value(value)
            return value.evaluate(parameters) if isinstance(value, Expression) else value

        def each(values: Sequence[Value] | None) -> Sequence[Value] | None:
            return None if values is None else [known(value) for value in values]

        segments, initial, start, beyond = self.recipe.value
        known_segments = [
            Segment(s.profile, known(s.duration), known(s.to), known(s.by), each(s.begin), each(s.end), each(s.limits))
            for s in segments
        ]
        try:
            return SegmentedMotion(known_segments, known(initial), known(start), beyond)
        except TrajectoryError as error:  # the mechanism knows the location of the law
            raise TrajectoryError(f"{error.name}: {error.message}", value=error.value) from None

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet; parameters need values, see `resolved`."""
        if self._open:
            message = "depends on parameters, whose values a mechanism knows; give numbers"
            raise TrajectoryError(message, name="segments", value=self._open)
        return super().__call__(time)

    def _within(self, time: Jet, choosing: Any) -> Jet:
        """Return the jet of the polynomials and the sines at given instants."""
        start, (amplitude, frequency, phase) = self._chosen(choosing, jnp.asarray(self.sines))
        return super()._within(time, choosing) + sin((time - start) * frequency + phase) * amplitude

    def jumps(self, order: int = 4) -> tuple[Float[np.ndarray, " knots"], Float[np.ndarray, "{order}+1 knots"]]:
        """Return the jumps of derivatives where segments meet, and at the ends.

        Parameters
        ----------
        order : int, default 4
            Highest derivative.

        Returns
        -------
        instants : ndarray of shape (knots,)
            Instants at which pieces meet, s; for a law that repeats, the beginning represents the end, too.
        jumps : ndarray of shape (order + 1, knots)
            Values from the right minus those from the left, m or rad per s to the power of the order; rounding is zero.

        Examples
        --------
        >>> import jounce as jn
        >>> law = jn.laws.SegmentedMotion([jn.laws.Segment("harmonic", 1.0, to=2.0)])
        >>> instants, jumps = law.jumps(2)
        >>> jumps[2].round(6).tolist()  # acceleration, at the beginning and at the end
        [9.869604, 9.869604]
        """
        return knot_jumps(self, order)

    @property
    def smoothness(self) -> int:
        """Order of the highest derivative that is continuous everywhere, at most 10; -1 if the law itself jumps."""
        _, jumps = self.jumps(MOST_CONDITIONS)
        broken = np.flatnonzero(np.any(jumps != 0, axis=1))
        return int(broken[0]) - 1 if len(broken) else MOST_CONDITIONS


def _check_closed(values: list[Value]) -> None:
    """Raise TrajectoryError unless a law to be repeated ends where it begins."""
    if is_traced(values):
        return
    gap = values[-1] - values[0]
    if abs(gap) > CLOSED * (max(values) - min(values)):
        message = f"do not end where they begin, but {gap:.6g} from there; close them, or choose beyond: advance"
        raise TrajectoryError(message, name="segments", value=float(values[-1]))


def _values(segment: Segment) -> list[Value]:
    lists = [value for entries in (segment.begin, segment.end, segment.limits) for value in entries or ()]
    return [segment.duration, segment.to, segment.by, *lists]


def _array(values: Any) -> Numbers:
    """Return an array of nested lists of numbers, of which some may be traced."""
    traced = is_traced(values)
    return jnp.array(values, float) if traced else np.array(values, float)


def _check_segment(segment: Any, name: str) -> None:
    """Raise TrajectoryError for missing or superfluous entries of a segment."""
    if not isinstance(segment, Segment):
        raise TrajectoryError("must be a jn.laws.Segment", name=name, value=segment)
    check_name("profile", segment.profile, SEGMENT_PROFILES, TrajectoryError, name=f"{name}.profile")
    targets = [key for key in ("to", "by") if getattr(segment, key) is not None]
    if segment.profile == "dwell" and targets:
        raise TrajectoryError("a dwell goes nowhere", name=f"{name}.{targets[0]}", value=getattr(segment, targets[0]))
    if segment.profile != "dwell" and len(targets) != 1:
        message = "give where the segment goes by to or by, not both" if targets else "give where it goes: to, or by"
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
