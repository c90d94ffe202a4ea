"""Elementary functions of jets, each by the recurrence of its differential equation, O(K^2) at order K.

Every function takes a jet, an array or a number; arrays and numbers are passed to JAX. Where the textbook recurrence
loses digits, an equivalent form is used, with the reason beside it.
"""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jounce.base.shapes import Real
from jounce.jet.algebra import Jet, Quantity, exp, log, of_quantities, power, real_power, sqrt
from jounce.jet.coefficients import Coefficients, multiplied, negated, next_of_chain, sum_of_products


def next_sine_cosine(
    sine: Coefficients,
    cosine: Coefficients,
    angle: Jet,
    *,
    hyperbolic: bool = False,
) -> tuple[Any, Any]:
    """Return the next coefficients of sine and cosine from the previous ones and a jet of the angle of that order."""
    slope = next_of_chain(cosine, angle.coefficients, sine)
    return next_of_chain(sine, angle.coefficients, cosine), slope if slope is None or hyperbolic else negated(slope)


def _sine_cosine_from(x: Jet, values: tuple[Any, Any], *, hyperbolic: bool) -> tuple[Jet, Jet]:
    sine, cosine = ([value] for value in values)
    for _ in range(x.order):
        s, c = next_sine_cosine(sine, cosine, x, hyperbolic=hyperbolic)
        sine.append(s)
        cosine.append(c)
    return Jet(sine), Jet(cosine)


def sine_cosine(x: Jet) -> tuple[Jet, Jet]:
    """Return sine and cosine of an angle in radians, which share one recurrence."""
    values = jnp.sin(x.coefficients[0]), jnp.cos(x.coefficients[0])
    return _sine_cosine_from(x, values, hyperbolic=False)


@of_quantities(jnp.sin)
def sin(x: Jet) -> Jet:
    """Return the sine of an angle in radians."""
    return sine_cosine(x)[0]


@of_quantities(jnp.cos)
def cos(x: Jet) -> Jet:
    """Return the cosine of an angle in radians."""
    return sine_cosine(x)[1]


def _riccati(x: Jet, value: Real, slope: Real, sign: int) -> Jet:
    """Solve ``y' = s x'``, ``s = constant + sign y^2``, from the value of y and of its slope s."""
    y: list[Any] = [value]
    s: list[Any] = [slope]
    for _ in range(x.order):
        y.append(next_of_chain(y, x.coefficients, s))
        square = sum_of_products(multiplied, y, y[::-1])
        s.append(None if square is None else sign * square)
    return Jet(y)


@of_quantities(jnp.tan)
def tan(x: Jet) -> Jet:
    """Return the tangent of an angle in radians."""
    value = jnp.tan(x.coefficients[0])
    return _riccati(x, value, 1 + value * value, +1)


@of_quantities(jnp.tanh)
def tanh(x: Jet) -> Jet:
    """Return the hyperbolic tangent, with slope 1 / cosh^2, since 1 - tanh^2 cancels where it saturates."""
    decay = jnp.exp(-2 * jnp.abs(x.coefficients[0]))
    return _riccati(x, jnp.tanh(x.coefficients[0]), 4 * decay / (1 + decay) ** 2, -1)


def _hyperbolic(x: Jet) -> tuple[Jet, Jet]:
    """Return sinh and cosh; beyond 1 by the exponential of half the argument, as XLA's own functions lose digits."""
    value = x.coefficients[0]
    half = jnp.exp(jnp.maximum(jnp.abs(value), 1.0) / 2)
    large = 0.5 * half * half
    small = 0.25 / large
    is_large = jnp.abs(value) > 1
    sine = jnp.where(is_large, jnp.sign(value) * (large - small), jnp.sinh(value))
    return _sine_cosine_from(x, (sine, jnp.where(is_large, large + small, jnp.cosh(value))), hyperbolic=True)


@of_quantities(jnp.sinh)
def sinh(x: Jet) -> Jet:
    """Return the hyperbolic sine."""
    return _hyperbolic(x)[0]


@of_quantities(jnp.cosh)
def cosh(x: Jet) -> Jet:
    """Return the hyperbolic cosine."""
    return _hyperbolic(x)[1]


def _one_minus_square(x: Quantity) -> Any:
    """Return 1 - x^2 as (1 - x)(1 + x), which keeps the digits of arcsine and arccosine near their ends."""
    if not isinstance(x, Jet):
        return (1.0 - x) * (1.0 + x)
    return Jet((_one_minus_square(x.coefficients[0]), *(-(x * x)).coefficients[1:]))


BY_SLOPE: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "asin": (jnp.arcsin, lambda x: 1.0 / sqrt(_one_minus_square(x))),
    "acos": (jnp.arccos, lambda x: -1.0 / sqrt(_one_minus_square(x))),
    "atan": (jnp.arctan, lambda x: 1.0 / (1.0 + x * x)),
    "asinh": (jnp.arcsinh, lambda x: 1.0 / sqrt(1.0 + x * x)),
    "acosh": (jnp.arccosh, lambda x: 1.0 / sqrt((x - 1.0) * (x + 1.0))),
    "atanh": (jnp.arctanh, lambda x: 1.0 / _one_minus_square(x)),
    "log1p": (jnp.log1p, lambda x: 1.0 / (1.0 + x)),
    "erf": (jax.lax.erf, lambda x: 2.0 / math.sqrt(math.pi) * exp(-(x * x))),
}
"""Functions with an elementary slope: the function of arrays, and its slope for jets and arrays."""


def _from_slope(x: Jet, value: Real, slope: Callable[[Jet], Jet]) -> Jet:
    if x.order == 0:
        return Jet([value])
    return (slope(x.truncate(x.order - 1)) * x.differentiate()).integrate(value)


def _by_slope(name: str, meaning: str) -> Callable[[Quantity], Any]:
    """Return a function of arrays that also takes jets, whose slope it integrates."""
    function, slope = BY_SLOPE[name]

    def of_jet(x: Jet) -> Jet:
        return _from_slope(x, function(x.coefficients[0]), slope)

    of_jet.__name__, of_jet.__qualname__, of_jet.__doc__ = name, name, f"Return {meaning}."
    return of_quantities(function)(of_jet)


asin = _by_slope("asin", "the arcsine, in radians")
acos = _by_slope("acos", "the arccosine, in radians")
atan = _by_slope("atan", "the arctangent, in radians")
asinh = _by_slope("asinh", "the inverse hyperbolic sine")
acosh = _by_slope("acosh", "the inverse hyperbolic cosine")
atanh = _by_slope("atanh", "the inverse hyperbolic tangent")
erf = _by_slope("erf", "the error function")
log1p = _by_slope("log1p", "``log(1 + x)``, exact also where x is tiny")


def atan2(y: Quantity, x: Quantity) -> Any:
    """Return the angle of the point (x, y), in radians, in (-pi, pi] at order zero.

    The point is rotated onto the first axis and scaled to unit distance before the recurrence, so that squares of huge
    or tiny coordinates neither overflow nor underflow.
    """
    if not isinstance(y, Jet) and not isinstance(x, Jet):
        return jnp.arctan2(y, x)
    order = min(p.order for p in (x, y) if isinstance(p, Jet))
    x, y = (p if isinstance(p, Jet) else Jet.constant(p, order) for p in (x, y))
    x0, y0 = x.coefficients[0], y.coefficients[0]
    angle, distance = jnp.arctan2(y0, x0), jnp.hypot(x0, y0)
    if order == 0:
        return Jet([angle])
    cosine, sine = x0 / distance, y0 / distance
    along = (cosine * x + sine * y) / distance
    across = (cosine * y - sine * x) / distance
    across = Jet((jnp.zeros_like(angle), *across.coefficients[1:]))
    rate = along * across.differentiate() - across * along.differentiate()
    return (rate / (along.truncate(order - 1).square() + across.truncate(order - 1).square())).integrate(angle)


@of_quantities(jnp.expm1)
def expm1(x: Jet) -> Jet:
    """Return ``exp(x) - 1``, exact for tiny x, too."""
    return _from_slope(x, jnp.expm1(x.coefficients[0]), exp)


@of_quantities(jnp.cbrt)
def cbrt(x: Jet) -> Jet:
    """Return the real cube root."""
    return real_power(absolute(x), jnp.asarray(1 / 3)) * jnp.where(x.coefficients[0] < 0, -1.0, 1.0)


@of_quantities(jnp.abs)
def absolute(x: Jet) -> Jet:
    """Return the absolute value; its derivatives at zero, which do not exist, are those on the positive side."""
    sign = jnp.where(x.coefficients[0] < 0, -1.0, 1.0)
    return x.map(lambda c: sign * c)


@of_quantities(jnp.sign)
def sign(x: Jet) -> Jet:
    """Return the sign of the value, -1, 0 or 1; its derivatives are zero, except at its jump."""
    return Jet.constant(jnp.sign(x.coefficients[0]), x.order)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    function.__name__: function
    for function in (
        acos, acosh, asin, asinh, atan, atan2, atanh, cbrt, cos, cosh, erf, exp, expm1, log, log1p, sin, sinh, sqrt,
        tan, tanh,
    )
} | {"abs": absolute, "pow": power, "square": lambda x: x * x}  # fmt: skip
"""Functions by the names of the JAX operations."""
