"""Motion laws, which drivers prescribe as functions of time on jets."""

import abc
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import Module, Untraced, field
from jounce.base.shapes import ArrayLike, Numbers, Real, is_traced
from jounce.errors import MechanismError, check_choice
from jounce.jet import Jet, compose
from jounce.jet.pieces import last_begun
from jounce.trajectory.beyond import check_within, continued
from jounce.trajectory.sample_errors import derivative_errors
from jounce.trajectory.splines import spline_through
from jounce.units.expression import Expression


class AbstractMotion(Module):
    """A law ``f(t)``, which maps a jet of time, s, to the jet of the driven quantity, m or rad."""

    @abc.abstractmethod
    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law; its batch axes are those of `time`."""

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if the law is not defined at some instants between two instants, s."""

    def resolved(self, parameters: Mapping[str, Any]) -> "AbstractMotion":  # noqa: ARG002 - few laws have parameters
        """Return the law with numbers in the place of expressions of parameters."""
        return self


class ExpressionMotion(AbstractMotion):
    """A motion law given by an expression of ``t`` and of parameters.

    Parameters
    ----------
    expression : Expression
        For example ``30*deg + 60*deg*sin(2*pi*t/tau)``.
    parameters : dict of str to float or array
        Values of the other names in the expression.

    Raises
    ------
    ExpressionError
        If a name in the expression has no value.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.ExpressionMotion(jn.laws.Expression("a*t**2"), {"a": 3.0})
    >>> [float(x) for x in law(jn.Jet.variable(1.0, order=2)).derivatives()]
    [3.0, 6.0, 6.0]
    """

    expression: Expression = field(static=True)
    parameters: dict[str, Any]

    def __init__(self, expression: Expression | str, parameters: Mapping[str, Any] | None = None):
        self.expression = Expression(expression) if isinstance(expression, str) else expression
        self.parameters = {} if parameters is None else dict(parameters)
        self.expression.check({*self.parameters, "t"})

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet."""
        value = self.expression.evaluate({**self.parameters, "t": time})
        if isinstance(value, Jet):
            return value
        return Jet.constant(jnp.zeros_like(time.coefficients[0]) + value, time.order)


class FunctionMotion(AbstractMotion):
    """A motion law given by any JAX-traceable Python function of time.

    Parameters
    ----------
    function : callable
        Maps the time, a scalar in s, to one scalar, in m or rad.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> import jounce as jn
    >>> law = jn.laws.FunctionMotion(lambda t: jnp.exp(-2 * t))
    >>> [float(x) for x in law(jn.Jet.variable(0.0, order=3)).derivatives()]
    [1.0, -2.0, 4.0, -8.0]
    """

    function: Callable[[Any], Any] = field(static=True)

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet."""
        return compose(self.function, time)


BEYOND = ("refuse", "hold", "repeat", "advance", "continue")


class SplineMotion(AbstractMotion):
    """A motion law through samples, interpolated by a spline of chosen degree.

    Derivatives up to ``degree - 1`` are continuous; the derivative of order `degree` is a step function, and those
    above vanish. Choose a degree above the highest derivative that matters: 5 for a continuous jounce.

    Parameters
    ----------
    times : array_like of shape (samples,)
        Strictly increasing instants, s.
    values : array_like of shape (samples,)
        Samples of the driven quantity, m or rad.
    degree : int, default 5
        Degree from 1 to 11; odd degrees interpolate best. At least ``degree + 1`` samples are needed.
    beyond : {"refuse", "hold", "repeat", "advance", "continue"}, default "refuse"
        The law before the first and after the last sample: an error; the value there, at rest; a repetition of the
        samples as one period of a smooth motion whose last sample equals the first one (or differs by whole turns of 2
        pi: then the law keeps turning); a repetition that advances from where the samples ended; or the polynomials at
        the ends.

    Raises
    ------
    MechanismError
        If the samples are too few for the degree, not finite, not increasing in time, or of unequal number, or samples
        to be repeated are not closed.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> t = np.linspace(0.0, 1.0, 21)
    >>> law = jn.laws.SplineMotion(t, t**3, degree=5)
    >>> [round(float(x), 9) for x in law(jn.Jet.variable(0.5, order=3)).derivatives()]
    [0.125, 0.75, 3.0, 6.0]
    >>> held = jn.laws.SplineMotion(t, t**3, beyond="hold")
    >>> [round(float(x), 9) for x in held(jn.Jet.variable(2.0, order=1)).derivatives()]
    [1.0, 0.0]
    """

    breakpoints: Any
    coefficients: Any
    stop: Any
    advance: Any
    degree: int = field(static=True)
    beyond: str = field(static=True)
    samples: Untraced = field(static=True)

    def __init__(self, times: ArrayLike, values: ArrayLike, degree: int = 5, beyond: str = "refuse"):
        check_choice("beyond", beyond, BEYOND, MechanismError)
        samples, ends, pieces, advance = spline_through(times, values, degree, beyond)
        self._set(ends[:-1], pieces, ends[-1], "repeat" if beyond == "advance" else beyond, advance, samples)

    def _set(
        self,
        breakpoints: Float[Numbers, " pieces"],
        coefficients: Float[Numbers, "powers pieces"],
        stop: float | Real,
        beyond: str,
        advance: float | Real = 0.0,
        samples: tuple[Float[np.ndarray, " samples"], Float[np.ndarray, " samples"]] | None = None,
    ) -> None:
        """Set the fields of the pieces, and of the samples through which they go, if any."""
        self.breakpoints, self.coefficients, self.stop, self.advance = breakpoints, coefficients, stop, advance
        self.degree, self.beyond, self.samples = len(coefficients) - 1, beyond, Untraced(samples)

    @property
    def joined(self) -> int:
        """Order of the highest derivative that is continuous by construction between pieces; -1 if none is."""
        return self.degree - 1 if self.samples.value is not None else -1

    @property
    def errors(self) -> np.ndarray:
        """Estimated errors of the derivatives, relative to their peaks, (degree + 1,); 0 for a law without samples."""
        if self.samples.derived is None and self.samples.value is not None:
            times, values = self.samples.value
            self.samples.derived = derivative_errors(times, values, self.degree)
        return np.zeros(self.degree + 1) if self.samples.derived is None else self.samples.derived

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if the law is not defined at some instants between two instants, s."""
        if self.beyond == "refuse":
            check_within(first, last, float(self.breakpoints[0]), float(self.stop), "samples")

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet.

        Raises
        ------
        MechanismError
            If an instant is beyond the samples and `beyond` is ``"refuse"``; for traced values, which cannot raise
            errors, the law is NaN there.
        """
        values = self.breakpoints, self.stop, time.coefficients[0]
        if self.beyond == "refuse" and np.ndim(self.stop) == 0 and not is_traced(values) and np.size(values[2]):
            self.check_instants(float(np.min(values[2])), float(np.max(values[2])))
        # one program for a call outside of other programs
        return (SplineMotion._evaluated if is_traced((self, time)) else _compiled_evaluation)(self, time)

    def _evaluated(self, time: Jet) -> Jet:
        """Return the jet of the law; NaN at instants that it refuses."""
        first, stop = jnp.asarray(self.breakpoints)[0], jnp.asarray(self.stop)
        return continued(self._within, time, first, stop, self.beyond, self.advance)

    def _within(self, time: Jet, choosing: Any) -> Jet:
        """Return the jet of the polynomials at given instants; outside, those at the ends are extrapolated."""
        start, powers = self._chosen(choosing, jnp.asarray(self.coefficients))
        local = time - start
        value = Jet.constant(powers[-1], time.order)
        for c in powers[-2::-1]:
            value = value * local + c
        return value

    def _chosen(self, instants: Any, table: Any) -> tuple[Any, Any]:
        """Return the beginnings of the pieces at given instants, and their columns of a table, (rows, pieces)."""
        breakpoints = jnp.asarray(self.breakpoints)
        if breakpoints.ndim == 1:
            index = last_begun(breakpoints, instants)
            start, columns = (x.at[..., index].get(mode="promise_in_bounds") for x in (breakpoints, table))
            return start, columns
        # several stacked drivers of one kind, along an axis before the batch: (samples, drivers, 1)
        rows = jnp.broadcast_to(instants, (breakpoints.shape[1], instants.shape[-1]))
        index = jax.vmap(last_begun, in_axes=(1, 0))(breakpoints[..., 0], rows)
        start = jnp.take_along_axis(breakpoints[..., 0], index.T, axis=0).T
        return start, jnp.swapaxes(jnp.take_along_axis(table[..., 0], index.T[None], axis=1), 1, 2)


_compiled_evaluation = jax.jit(SplineMotion._evaluated)
