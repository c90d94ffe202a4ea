"""Elementary functions of jets, each by the recurrence of its differential equation, O(K^2) at order K.

Every function takes a jet, an array or a number; what is not a jet is passed to JAX. Where the textbook
recurrence loses digits, another form of the same equation stands here, with the reason beside it.
"""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jounce.jet.algebra import Jet, exp, log, next_of_chain, power, real_power, sqrt, square
from jounce.jet.coefficients import sum_of_products


def next_sine_cosine(sine: list[Any], cosine: list[Any], angle: Jet) -> tuple[Any, Any]:
    """Return the next coefficients of sine and cosine, from those before and a jet of the angle that reaches them."""
    falling = next_of_chain(cosine, angle, sine)
    return next_of_chain(sine, angle, cosine), None if falling is None else -falling


def sine_cosine(x: Jet) -> tuple[Jet, Jet]:
    """Return sine and cosine of an angle in radians, which share one recurrence."""
    sine, cosine = [jnp.sin(x.coefficients[0])], [jnp.cos(x.coefficients[0])]
    for _ in range(x.order):
        s, c = next_sine_cosine(sine, cosine, x)
        sine.append(s)
        cosine.append(c)
    return Jet(sine), Jet(cosine)


def sin(x: Any) -> Any:
    """Return the sine of an angle in radians."""
    return sine_cosine(x)[0] if isinstance(x, Jet) else jnp.sin(x)


def cos(x: Any) -> Any:
    """Return the cosine of an angle in radians."""
    return sine_cosine(x)[1] if isinstance(x, Jet) else jnp.cos(x)


def _riccati(x: Jet, value: Any, slope: Any, sign: int) -> Jet:
    """Solve ``y' = s x'``, ``s = constant + sign y^2``, from the value of y and of its slope s."""
    y, s = [value], [slope]
    for _ in range(x.order):
        y.append(next_of_chain(y, x, s))
        square = sum_of_products(jnp.multiply, y, y[::-1])
        s.append(None if square is None else sign * square)
    return Jet(y)


def tan(x: Any) -> Any:
    """Return the tangent of an angle in radians."""
    if not isinstance(x, Jet):
        return jnp.tan(x)
    value = jnp.tan(x.coefficients[0])
    return _riccati(x, value, 1 + value * value, +1)


def tanh(x: Any) -> Any:
    """Return the hyperbolic tangent; its slope is taken as 1 / cosh^2, since 1 - tanh^2 cancels where it saturates."""
    if not isinstance(x, Jet):
        return jnp.tanh(x)
    decay = jnp.exp(-2 * jnp.abs(x.coefficients[0]))
    return _riccati(x, jnp.tanh(x.coefficients[0]), 4 * decay / (1 + decay) ** 2, -1)


def _hyperbolic(x: Jet) -> tuple[Jet, Jet]:
    sine, cosine = ([value] for value in _hyperbolic_values(x.coefficients[0]))
    for _ in range(x.order):
        s, c = next_of_chain(sine, x, cosine), next_of_chain(cosine, x, sine)
        sine.append(s)
        cosine.append(c)
    return Jet(sine), Jet(cosine)


def _hyperbolic_values(x: Any) -> tuple[Any, Any]:
    """Return sinh and cosh; far out by the exponential of half the argument, since XLA's own lose digits there."""
    half = jnp.exp(jnp.maximum(jnp.abs(x), 1.0) / 2)
    large = 0.5 * half * half
    small = 0.25 / large
    far = jnp.abs(x) > 1
    sine = jnp.where(far, jnp.sign(x) * (large - small), jnp.sinh(x))
    return sine, jnp.where(far, large + small, jnp.cosh(x))


def sinh(x: Any) -> Any:
    """Return the hyperbolic sine."""
    return _hyperbolic(x)[0] if isinstance(x, Jet) else jnp.sinh(x)


def cosh(x: Any) -> Any:
    """Return the hyperbolic cosine."""
    return _hyperbolic(x)[1] if isinstance(x, Jet) else jnp.cosh(x)


def _one_minus_square(x: Any) -> Any:
    """Return 1 - x^2, its value as (1 - x)(1 + x), which keeps the digits of arcsine and arccosine near their ends."""
    if not isinstance(x, Jet):
        return (1.0 - x) * (1.0 + x)
    return Jet((_one_minus_square(x.coefficients[0]), *(-square(x)).coefficients[1:]))


BY_SLOPE: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "asin": (jnp.arcsin, lambda x: 1.0 / sqrt(_one_minus_square(x))),
    "acos": (jnp.arccos, lambda x: -1.0 / sqrt(_one_minus_square(x))),
    "atan": (jnp.arctan, lambda x: 1.0 / (1.0 + square(x))),
    "asinh": (jnp.arcsinh, lambda x: 1.0 / sqrt(1.0 + square(x))),
    "acosh": (jnp.arccosh, lambda x: 1.0 / sqrt((x - 1.0) * (x + 1.0))),
    "atanh": (jnp.arctanh, lambda x: 1.0 / _one_minus_square(x)),
    "log1p": (jnp.log1p, lambda x: 1.0 / (1.0 + x)),
    "erf": (jax.lax.erf, lambda x: 2.0 / math.sqrt(math.pi) * exp(-square(x))),
}
"""Functions whose slope is an algebraic or elementary function of the argument: both, the slope of jets and arrays."""


def _by_slope(name: str, x: Any) -> Any:
    """Return a function of an array, or of a jet by integrating its slope."""
    function, slope = BY_SLOPE[name]
    if not isinstance(x, Jet):
        return function(x)
    return _from_slope(x, function(x.coefficients[0]), slope)


def _from_slope(x: Jet, value: Any, slope: Callable[[Jet], Jet]) -> Jet:
    if x.order == 0:
        return Jet([value])
    return (slope(x.truncate(x.order - 1)) * x.differentiate()).integrate(value)


def asin(x: Any) -> Any:
    """Return the arcsine, in radians."""
    return _by_slope("asin", x)


def acos(x: Any) -> Any:
    """Return the arccosine, in radians."""
    return _by_slope("acos", x)


def atan(x: Any) -> Any:
    """Return the arctangent, in radians."""
    return _by_slope("atan", x)


def atan2(y: Any, x: Any) -> Any:
    """Return the angle of the point (x, y), in radians, in (-pi, pi] at order zero.

    The point is turned onto the first axis and scaled to unit distance before the recurrence, so that neither
    huge nor tiny coordinates overflow in the squares.
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


def log1p(x: Any) -> Any:
    """Return ``log(1 + x)``, exact also where x is tiny."""
    return _by_slope("log1p", x)


def expm1(x: Any) -> Any:
    """Return ``exp(x) - 1``, exact also where x is tiny."""
    if not isinstance(x, Jet):
        return jnp.expm1(x)
    return _from_slope(x, jnp.expm1(x.coefficients[0]), exp)


def cbrt(x: Any) -> Any:
    """Return the real cube root."""
    if not isinstance(x, Jet):
        return jnp.cbrt(x)
    return real_power(absolute(x), jnp.asarray(1 / 3)) * jnp.where(x.coefficients[0] < 0, -1.0, 1.0)


def asinh(x: Any) -> Any:
    """Return the inverse hyperbolic sine."""
    return _by_slope("asinh", x)


def acosh(x: Any) -> Any:
    """Return the inverse hyperbolic cosine."""
    return _by_slope("acosh", x)


def atanh(x: Any) -> Any:
    """Return the inverse hyperbolic tangent."""
    return _by_slope("atanh", x)


def erf(x: Any) -> Any:
    """Return the error function."""
    return _by_slope("erf", x)


def absolute(x: Any) -> Any:
    """Return the absolute value; at zero its derivatives do not exist, and are taken from the positive side."""
    if not isinstance(x, Jet):
        return jnp.abs(x)
    sign = jnp.where(x.coefficients[0] < 0, -1.0, 1.0)
    return x.map(lambda c: sign * c)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    function.__name__: function
    for function in (
        acos, acosh, asin, asinh, atan, atan2, atanh, cbrt, cos, cosh, erf, exp, expm1, log, log1p, sin, sinh, sqrt,
        square, tan, tanh,
    )
} | {"abs": absolute, "pow": power}  # fmt: skip
"""By the names that JAX gives its operations."""
