"""Motion laws with a measured derivative: splines through its samples, integrated exactly."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.base.modules import field
from jounce.base.shapes import ArrayLike
from jounce.errors import MechanismError, check_choice
from jounce.jet import Jet
from jounce.trajectory.beyond import CLOSED
from jounce.trajectory.checks import whole_number
from jounce.trajectory.motion import SplineMotion, Untraced
from jounce.trajectory.sample_errors import derivative_errors
from jounce.trajectory.splines import integrated, spline_through
from jounce.units.expression import Expression

HIGHEST = 4  # highest derivative that can be measured: jounce
BEYOND = ("refuse", "hold", "repeat", "advance", "continue")

InitialValue = float | str | Expression | jax.Array


class MeasuredMotion(SplineMotion):
    """A motion law of which a derivative goes through samples, such as measured accelerations.

    The spline through the samples is integrated exactly; the constants of integration are given at the first sample, as
    in Negrean 2025, section 4.

    Parameters
    ----------
    times : array_like of shape (samples,)
        Strictly increasing instants, s.
    values : array_like of shape (samples,)
        Samples of the derivative, m or rad per s to the power of `derivative`.
    derivative : int, default 2
        Order of the measured derivative: 1 velocity, 2 acceleration, 3 jerk, 4 jounce.
    initial : sequence of float, str or Expression, optional
        The law and its derivatives below `derivative` at the first sample, lowest first; zero by default. Expressions
        of parameters get values from the mechanism of the law.
    degree : int, default 5
        Degree of the spline through the samples, from 1 to 11; that of the law is higher by `derivative`.
    beyond : {"refuse", "hold", "repeat", "advance", "continue"}, default "refuse"
        The law before the first and after the last sample, as for `SplineMotion`. With repeat or advance, its
        derivatives must be the same at the last sample as at the first.

    Raises
    ------
    MechanismError
        If the samples are not valid, as for `SplineMotion`, or there are too many initial values.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> law = jn.laws.MeasuredMotion(t, 6 * t, derivative=2, initial=[2.0, 1.0])  # accelerations of t^3
    >>> [round(float(x), 9) for x in law(jn.Jet.variable(0.5, order=3)).derivatives()]
    [2.625, 1.75, 3.0, 6.0]
    """

    derivative: int = field(static=True)
    initial: Untraced = field(static=True)
    extrapolation: str = field(static=True)

    def __init__(
        self,
        times: ArrayLike,
        values: ArrayLike,
        derivative: int = 2,
        initial: Sequence[InitialValue] = (),
        degree: int = 5,
        beyond: str = "refuse",
    ):
        check_choice("beyond", beyond, BEYOND, MechanismError)
        self.derivative = whole_number("derivative", derivative, 1, HIGHEST, error=MechanismError)
        repeats = beyond in ("repeat", "advance")
        samples, ends, pieces, gap = spline_through(times, values, degree, "repeat" if repeats else beyond)
        if gap:
            message = "samples of a derivative that repeat must end at the value they begin with; the last differs by"
            raise MechanismError(message, name="values", value=gap)
        for _ in range(self.derivative):
            pieces = integrated(pieces, np.diff(ends))
        self.initial = Untraced(_checked(initial, self.derivative))
        initial_numbers = [np.nan if isinstance(x, Expression) else x for x in self.initial.value]
        if any(isinstance(x, Tracer) for x in initial_numbers):
            self.initial = Untraced(())  # a tracer must not outlive its trace
        integrated_pieces, advance = _started(pieces, ends, initial_numbers), 0.0
        if repeats and not self._open:
            advance = _advance(integrated_pieces, ends, self.derivative, beyond)
        extrapolation = "repeat" if beyond == "advance" else beyond
        self._set(ends[:-1], integrated_pieces, ends[-1], extrapolation, advance, samples=samples)
        self.extrapolation = beyond

    def resolved(self, parameters: Mapping[str, Any]) -> "MeasuredMotion":
        """Return the law with numbers in the place of expressions of parameters."""
        if not self._open:
            return self
        initial_values = [x.evaluate(parameters) if isinstance(x, Expression) else x for x in self.initial.value]
        times, values = self.samples.value
        degree = self.degree - self.derivative
        return MeasuredMotion(times, values, self.derivative, initial_values, degree, self.extrapolation)

    @property
    def _open(self) -> list[str]:
        """Names of the parameters that lack values."""
        return sorted({name for x in self.initial.value if isinstance(x, Expression) for name in x.names})

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet; parameters need values, see `resolved`."""
        if self._open:
            message = "depends on parameters, whose values a mechanism knows; give numbers"
            raise MechanismError(message, name="initial", value=self._open)
        return super().__call__(time)

    @property
    def errors(self) -> np.ndarray:
        """Estimated errors of the derivatives, relative to their peaks, (degree + 1,)."""
        if self.samples.derived is None:
            times, values = self.samples.value
            errors = derivative_errors(times, values, self.degree - self.derivative)
            self.samples.derived = np.concatenate([np.full(self.derivative, errors[0]), errors])
        return self.samples.derived


def _started(
    pieces: Float[np.ndarray, "powers pieces"], ends: Float[np.ndarray, " breakpoints"], initial: Sequence[Any]
) -> Any:
    """Return pieces with the polynomial of the initial values added."""
    elapsed = ends[:-1] - ends[0]
    polynomial = [
        sum(x / math.factorial(n) * math.comb(n, k) * elapsed ** (n - k) for n, x in enumerate(initial) if n >= k)
        for k in range(len(initial))
    ]
    namespace = jnp if any(isinstance(x, Tracer) for x in initial) else np
    return namespace.concatenate([pieces[: len(polynomial)] + namespace.stack(polynomial), pieces[len(polynomial) :]])


def _advance(pieces: Any, ends: Float[np.ndarray, " breakpoints"], derivative: int, beyond: str) -> Any:
    """Return the gain of a law over a period; raise MechanismError unless its derivatives end as they begin."""
    length = ends[-1] - ends[-2]
    gains = []
    for level in range(derivative):
        end = sum(c * math.perm(k, level) * length ** (k - level) for k, c in enumerate(pieces[:, -1]) if k >= level)
        gains.append(end - math.factorial(level) * pieces[level, 0])
    if any(isinstance(x, Tracer) for x in gains):
        return gains[0] if beyond == "advance" else 0.0
    for level, gain in enumerate(gains):
        size = math.factorial(level) * float(np.max(np.abs(pieces[level]))) + abs(float(gain))
        if abs(float(gain)) > CLOSED * size and (level or beyond == "repeat"):
            subject = f"its derivative {level}" if level else "the law"
            advice = "change the samples or initial" if level else "close it, or choose beyond: advance"
            message = (
                f"samples of a derivative that repeat: {subject} ends {float(gain):.6g} from where it began; {advice}"
            )
            raise MechanismError(message, name="beyond", value=beyond)
    return float(gains[0]) if beyond == "advance" else 0.0


def _checked(initial: Any, derivative: int) -> tuple[Any, ...]:
    """Return the values at the first sample after a check, padded by zeros."""
    try:
        initial_values = [Expression(x) if isinstance(x, str) else x for x in initial]
        initial_values = [x.evaluate() if isinstance(x, Expression) and not x.names else x for x in initial_values]
        initial_values = [x if isinstance(x, Expression | Tracer) else float(x) for x in initial_values]
    except (TypeError, ValueError):
        raise MechanismError("must be a list of numbers", name="initial", value=initial) from None
    if len(initial_values) > derivative or not np.isfinite([x for x in initial_values if isinstance(x, float)]).all():
        message = f"must be at most {derivative} finite numbers: the law and its derivatives below the measured one"
        raise MechanismError(message, name="initial", value=initial_values)
    return (*initial_values, *(0.0,) * (derivative - len(initial_values)))
