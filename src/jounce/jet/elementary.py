"""Elementary functions of jets, each by the recurrence of its differential equation, O(K^2) at order K.

Every function takes a jet, an array or a number; what is not a jet is passed to JAX. Where the textbook
recurrence loses digits, another form of the same equation stands here, with the reason beside it.
"""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jounce.jet.algebra import Jet, minus, sum_of_products


def _chain(outer: list[Any], inner: Jet, slope: list[Any]) -> Any:
    """Return the next coefficient of y from ``y' = slope * inner'``."""
    k = len(outer)
    rates = [None if c is None else j * c for j, c in enumerate(inner.coefficients[: k + 1])]
    value = sum_of_products(jnp.multiply, rates[1:], slope[k - 1 :: -1])
    return None if value is None else value * (1 / k)


def exp(x: Any) -> Any:
    """Return the exponential."""
    if not isinstance(x, Jet):
        return jnp.exp(x)
    y = [jnp.exp(x.coefficients[0])]
    for _ in range(x.order):
        y.append(_chain(y, x, y))
    return Jet(y)


def log(x: Any) -> Any:
    """Return the natural logarithm."""
    if not isinstance(x, Jet):
        return jnp.log(x)
    first, *rest = x.coefficients
    return (x.differentiate() / x.truncate(x.order - 1)).integrate(jnp.log(first)) if rest else Jet([jnp.log(first)])


def sqrt(x: Any) -> Any:
    """Return the square root."""
    if not isinstance(x, Jet):
        return jnp.sqrt(x)
    y: list[Any] = [jnp.sqrt(x.coefficients[0])]
    for k in range(1, x.order + 1):
        rest = minus(x.coefficients[k], sum_of_products(jnp.multiply, y[1:k], y[k - 1 : 0 : -1]))
        y.append(None if rest is None else rest / (2 * y[0]))
    return Jet(y)


def power(x: Any, exponent: Any) -> Any:
    """Return `x` to the power `exponent`.

    A whole exponent multiplies repeatedly: the recurrence for real exponents divides by the base and fails at zero.
    """
    if isinstance(exponent, Jet) or not isinstance(x, Jet):
        if not isinstance(exponent, Jet):
            return jnp.power(x, exponent)
        return exp(exponent * log(x))
    if isinstance(exponent, float) and exponent.is_integer():
        exponent = int(exponent)
    if isinstance(exponent, int):
        return _whole_power(x, exponent)
    if isinstance(exponent, float) and exponent == 0.5:
        return sqrt(x)
    return _real_power(x, jnp.asarray(exponent, float))


def _real_power(x: Jet, exponent: Any) -> Jet:
    """Return a power whose exponent is known at run time only.

    The recurrence divides by the base, so a whole exponent up to the order is taken from repeated products instead.
    """
    at_zero = x.coefficients[0] == 0
    c = (jnp.where(at_zero, 1.0, x.coefficients[0]), *x.coefficients[1:])
    y: list[Any] = [jnp.power(c[0], exponent)]
    for k in range(1, x.order + 1):
        weighted = [None if c[j] is None else (exponent * j - (k - j)) * c[j] for j in range(1, k + 1)]
        value = sum_of_products(jnp.multiply, weighted, y[k - 1 :: -1])
        y.append(None if value is None else value / (k * c[0]))
    whole = [_whole_power(x, m).dense() for m in range(x.order + 1)]
    beyond = exponent > x.order  # at a base of zero, every coefficient vanishes; other exponents have none there

    def coefficient(k: int, value: Any) -> Any:
        value = jnp.where(at_zero, jnp.where(beyond | ((exponent > 0) & (k == 0)), 0.0, jnp.nan), value)
        for m, power_m in enumerate(whole):
            value = jnp.where(exponent == m, power_m.coefficients[k], value)
        return value

    return Jet(coefficient(k, value) for k, value in enumerate(Jet(y).dense().coefficients))


def _whole_power(x: Jet, exponent: int) -> Jet:
    if exponent < 0:
        return 1.0 / _whole_power(x, -exponent)
    result, square = None, x
    while exponent:
        if exponent & 1:
            result = square if result is None else result * square
        exponent >>= 1
        if exponent:
            square = square.square()
    return Jet.constant(jnp.ones_like(x.coefficients[0]), x.order) if result is None else result


def next_sine_cosine(sine: list[Any], cosine: list[Any], angle: Jet) -> tuple[Any, Any]:
    """Return the next coefficients of sine and cosine, from those before and a jet of the angle that reaches them."""
    falling = _chain(cosine, angle, sine)
    return _chain(sine, angle, cosine), None if falling is None else -falling


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
        y.append(_chain(y, x, s))
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
        s, c = _chain(sine, x, cosine), _chain(cosine, x, sine)
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


def _from_slope(x: Jet, value: Any, slope: Callable[[Jet], Jet]) -> Jet:
    """Return the jet of a function by integrating its slope, which is an algebraic function of `x`."""
    if x.order == 0:
        return Jet([value])
    return (slope(x.truncate(x.order - 1)) * x.differentiate()).integrate(value)


def _one_minus_square(x: Jet) -> Jet:
    """Return 1 - x^2, its value as (1 - x)(1 + x), which keeps the digits of arcsine and arccosine near their ends."""
    first = x.coefficients[0]
    return Jet(((1.0 - first) * (1.0 + first), *(-x.square()).coefficients[1:]))


def asin(x: Any) -> Any:
    """Return the arcsine, in radians."""
    if not isinstance(x, Jet):
        return jnp.arcsin(x)
    return _from_slope(x, jnp.arcsin(x.coefficients[0]), lambda u: 1.0 / sqrt(_one_minus_square(u)))


def acos(x: Any) -> Any:
    """Return the arccosine, in radians."""
    if not isinstance(x, Jet):
        return jnp.arccos(x)
    return _from_slope(x, jnp.arccos(x.coefficients[0]), lambda u: -1.0 / sqrt(_one_minus_square(u)))


def atan(x: Any) -> Any:
    """Return the arctangent, in radians."""
    if not isinstance(x, Jet):
        return jnp.arctan(x)
    return _from_slope(x, jnp.arctan(x.coefficients[0]), lambda u: 1.0 / (1.0 + u.square()))


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
    if not isinstance(x, Jet):
        return jnp.log1p(x)
    return _from_slope(x, jnp.log1p(x.coefficients[0]), lambda u: 1.0 / (1.0 + u))


def expm1(x: Any) -> Any:
    """Return ``exp(x) - 1``, exact also where x is tiny."""
    if not isinstance(x, Jet):
        return jnp.expm1(x)
    return _from_slope(x, jnp.expm1(x.coefficients[0]), exp)


def cbrt(x: Any) -> Any:
    """Return the real cube root."""
    if not isinstance(x, Jet):
        return jnp.cbrt(x)
    return _real_power(absolute(x), jnp.asarray(1 / 3)) * jnp.where(x.coefficients[0] < 0, -1.0, 1.0)


def asinh(x: Any) -> Any:
    """Return the inverse hyperbolic sine."""
    if not isinstance(x, Jet):
        return jnp.arcsinh(x)
    return _from_slope(x, jnp.arcsinh(x.coefficients[0]), lambda u: 1.0 / sqrt(1.0 + u.square()))


def acosh(x: Any) -> Any:
    """Return the inverse hyperbolic cosine."""
    if not isinstance(x, Jet):
        return jnp.arccosh(x)
    return _from_slope(x, jnp.arccosh(x.coefficients[0]), lambda u: 1.0 / sqrt((u - 1.0) * (u + 1.0)))


def atanh(x: Any) -> Any:
    """Return the inverse hyperbolic tangent."""
    if not isinstance(x, Jet):
        return jnp.arctanh(x)
    return _from_slope(x, jnp.arctanh(x.coefficients[0]), lambda u: 1.0 / _one_minus_square(u))


def erf(x: Any) -> Any:
    """Return the error function."""
    if not isinstance(x, Jet):
        return jax.lax.erf(x)
    return _from_slope(x, jax.lax.erf(x.coefficients[0]), lambda u: 2 / math.sqrt(math.pi) * exp(-u.square()))


def absolute(x: Any) -> Any:
    """Return the absolute value; at zero its derivatives do not exist, and are taken from the positive side."""
    if not isinstance(x, Jet):
        return jnp.abs(x)
    sign = jnp.where(x.coefficients[0] < 0, -1.0, 1.0)
    return x.map(lambda c: sign * c)


def wrap(x: Any, period: Any) -> Any:
    """Shift by whole periods into ``[-period/2, period/2]``: what is left of an angle or a screw's advance."""
    value = x.coefficients[0] if isinstance(x, Jet) else x
    return x - period * jnp.round(value / period)
