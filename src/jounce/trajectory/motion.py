"""Motion laws: what a driver prescribes, as a function of time that acts on jets."""

import abc
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jounce.errors import MechanismError
from jounce.jet import Jet, compose
from jounce.trajectory.expression import Expression


class AbstractMotion(eqx.Module):
    """A law ``f(t)``: maps a jet of time, in s, to the jet of the driven quantity, in m or rad."""

    @abc.abstractmethod
    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law; its batch axes are those of `time`."""


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
    >>> law = jn.ExpressionMotion(jn.Expression("a*t**2"), {"a": 3.0})
    >>> [float(x) for x in law(jn.Jet.variable(1.0, order=2)).derivatives()]
    [3.0, 6.0, 6.0]
    """

    expression: Expression = eqx.field(static=True)
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
    >>> law = jn.FunctionMotion(lambda t: jnp.exp(-2 * t))
    >>> [float(x) for x in law(jn.Jet.variable(0.0, order=3)).derivatives()]
    [1.0, -2.0, 4.0, -8.0]
    """

    function: Callable[[Any], Any] = eqx.field(static=True)

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet."""
        return compose(self.function, time)


class SplineMotion(AbstractMotion):
    """A motion law interpolated through samples by a spline of chosen degree.

    Derivatives up to ``degree - 1`` are continuous; the one of order `degree` is a step function, and those above
    vanish. Ask for a degree above the highest derivative that matters: 5 for a continuous jounce.

    Parameters
    ----------
    times : array_like of shape (samples,)
        Strictly increasing instants, s.
    values : array_like of shape (samples,)
        Samples of the driven quantity, m or rad.
    degree : int, default 5
        Odd degrees interpolate best; at least ``degree + 1`` samples are needed.

    Raises
    ------
    MechanismError
        If the samples are too few for the degree, not finite, not increasing in time, or of unequal number.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> t = np.linspace(0.0, 1.0, 21)
    >>> law = jn.SplineMotion(t, t**3, degree=5)
    >>> [round(float(x), 9) for x in law(jn.Jet.variable(0.5, order=3)).derivatives()]
    [0.125, 0.75, 3.0, 6.0]
    """

    breakpoints: Any
    coefficients: Any
    degree: int = eqx.field(static=True)

    def __init__(self, times: Any, values: Any, degree: int = 5):
        times, values = np.asarray(times, float), np.asarray(values, float)
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
            message = f"times of samples must increase; sample {first + 1} does not come after sample {first}"
            raise MechanismError(message, value=float(times[first + 1]))
        if not 1 <= degree <= 11:
            raise MechanismError("the degree of a spline must be a whole number from 1 to 11", value=degree)
        if len(times) <= degree:
            raise MechanismError(f"a spline of degree {degree} needs at least {degree + 1} samples", value=len(times))
        from scipy.interpolate import PPoly, make_interp_spline  # here, since importing SciPy takes half a second

        try:
            pieces = PPoly.from_spline(make_interp_spline(times, values, k=degree))
        except (np.linalg.LinAlgError, ValueError):
            message = "no spline goes through the samples: their spacing is too uneven; sample evenly"
            raise MechanismError(message, value=float(np.diff(times).min())) from None
        inside = np.diff(pieces.x) > 0
        self.breakpoints = pieces.x[:-1][inside]
        self.coefficients = pieces.c[::-1, inside]  # lowest power first
        self.degree = degree

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet; outside the samples the end pieces go on."""
        instants = time.coefficients[0]
        breakpoints, coefficients = jnp.asarray(self.breakpoints), jnp.asarray(self.coefficients)
        if breakpoints.ndim == 1:
            piece = jnp.searchsorted(breakpoints, instants, side="right") - 1
            piece = jnp.clip(piece, 0, None)
            start, powers = breakpoints[piece], coefficients[:, piece]
        else:  # several drivers of one kind, stacked along an axis before the batch: (samples, drivers, 1)
            search = jax.vmap(lambda x: jnp.searchsorted(x, instants[0], side="right") - 1, in_axes=1)
            piece = jnp.clip(search(breakpoints[..., 0]), 0, None)
            start = jnp.take_along_axis(breakpoints[..., 0], piece.T, axis=0).T
            powers = jnp.take_along_axis(coefficients[..., 0], piece.T[None], axis=1)
            powers = jnp.swapaxes(powers, 1, 2)
        local = time - start
        value = Jet.constant(powers[-1], time.order)
        for c in powers[-2::-1]:
            value = value * local + c
        return value
