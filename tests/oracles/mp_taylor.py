"""Taylor coefficients of composed functions in many digits, and the natural scale of each, to judge jets by."""

import math

from mpmath import mp

DIGITS = 120


def product(a, b):
    """Return the Cauchy product of two coefficient lists of equal length."""
    return [mp.fsum(a[j] * b[k - j] for j in range(k + 1)) for k in range(len(a))]


def substituted(outer, inner):
    """Return the coefficients of the outer series in the inner one, whose own constant term is left out."""
    inner = [mp.mpf(0), *inner[1:]]
    total = [mp.mpf(0)] * len(inner)
    for coefficient in reversed(outer):
        total = product(total, inner)
        total[0] += coefficient
    return total


def composed(function, inner):
    """Return the coefficients of ``function(x)`` and the scale of each, for a polynomial x given as floats.

    The scale replaces every number that is added up by its magnitude, so that it tells how much rounding the
    coefficient must forgive. Where it vanishes (an odd function at zero) the neighbors stand in.
    """
    inner = [mp.mpf(c) for c in inner]
    outer = taylor(function, inner[0], len(inner) - 1)
    values = substituted(outer, inner)
    scale = substituted([abs(c) for c in outer], [abs(c) for c in inner])
    widened = [s if s else max(scale[max(k - 1, 0) : k + 2]) for k, s in enumerate(scale)]
    return values, widened


def taylor(function, point, order):
    """Return the Taylor coefficients of a function at a point; `log` and powers in closed form, being scale-free."""
    if function == mp.log:
        return [mp.log(point), *((-1) ** (k + 1) / (k * point**k) for k in range(1, order + 1))]
    if isinstance(function, (int, float)):
        power = mp.mpf(function)
        binomials = [mp.binomial(power, k) for k in range(order + 1)]
        return [b * point ** (power - k) if b else mp.mpf(0) for k, b in enumerate(binomials)]
    found = mp.taylor(function, point, order)  # by differences, which leave a trace where there is a zero
    size = [max(map(abs, found[max(k - 1, 0) : k + 2])) for k in range(order + 1)]
    noise = mp.mpf(10) ** (-0.5 * mp.dps)
    absolute = noise if point == 0 else 0
    return [c if k == 0 or abs(c) > max(noise * size[k], absolute) else mp.mpf(0) for k, c in enumerate(found)]


def worst(coefficients, values, scale):
    """Return the largest error of float coefficients against the true values, by their scales."""
    errors = []
    for got, value, size in zip(coefficients, values, scale, strict=True):
        got = float(got)
        if not math.isfinite(got):
            return math.inf
        error = abs(mp.mpf(got) - value)
        errors.append(float(error / size) if size else float(error))
    return max(errors)
