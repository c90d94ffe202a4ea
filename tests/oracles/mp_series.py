"""Truncated power series in time on multi-precision (or float) numbers: the arithmetic of the independent judge.

A series is a list of Taylor coefficients. Nothing here knows of the library, nor of its jets: the same scalars may be
mpmath's ``mpf`` (any number of digits) or Python floats (quick, for continuation).
"""

import mpmath
from mpmath import mp


def context(x):
    """Return the mpmath context of a scalar: `mpmath.mp` for an mpf, `mpmath.fp` for a float or an int."""
    return mp if isinstance(x, mpmath.mpf) else mpmath.fp


class Series:
    """Power series c[0] + c[1] h + ... + c[K] h^K."""

    __slots__ = ("c",)

    def __init__(self, coefficients):
        self.c = list(coefficients)

    def __len__(self):
        return len(self.c)

    def __add__(self, other):
        if isinstance(other, Series):
            return Series([a + b for a, b in zip(self.c, other.c, strict=True)])
        return Series([self.c[0] + other, *self.c[1:]])

    __radd__ = __add__

    def __neg__(self):
        return Series([-a for a in self.c])

    def __sub__(self, other):
        if isinstance(other, Series):
            return Series([a - b for a, b in zip(self.c, other.c, strict=True)])
        return Series([self.c[0] - other, *self.c[1:]])

    def __rsub__(self, other):
        return (-self) + other

    def __mul__(self, other):
        if not isinstance(other, Series):
            return Series([a * other for a in self.c])
        a, b = self.c, other.c
        return Series([_dot(a[: k + 1], b[k::-1]) for k in range(len(a))])

    __rmul__ = __mul__

    def __truediv__(self, other):
        if not isinstance(other, Series):
            return Series([a / other for a in self.c])
        out, b = [], other.c
        for k in range(len(self.c)):
            rest = self.c[k] - _dot(out, b[k:0:-1]) if k else self.c[k]
            out.append(rest / b[0])
        return Series(out)

    def __rtruediv__(self, other):
        return Series([other] + [other * 0] * (len(self.c) - 1)) / self

    def __pow__(self, power):
        if isinstance(power, Series):
            return exp(power * log(self))
        if isinstance(power, int) or power == int(power):
            power = int(power)
            if power < 0:
                return 1 / self**-power
            out = Series([self.c[0] * 0 + 1] + [self.c[0] * 0] * (len(self.c) - 1))
            for _ in range(power):
                out = out * self
            return out
        out = [self.c[0] ** power]
        for k in range(1, len(self.c)):
            terms = [(power * j - (k - j)) * self.c[j] * out[k - j] for j in range(1, k + 1)]
            out.append(sum(terms[1:], terms[0]) / (k * self.c[0]))
        return Series(out)

    def __rpow__(self, base):
        return exp(self * context(self.c[0]).log(base))

    def __abs__(self):
        return self if self.c[0] >= 0 else -self

    def derivatives(self):
        """Return the plain derivatives k! c[k]."""
        out, factorial = [], 1
        for k, c in enumerate(self.c):
            factorial *= max(k, 1)
            out.append(c * factorial)
        return out

    def differentiate(self):
        """Return the series of the time derivative, one order shorter."""
        return Series([k * c for k, c in enumerate(self.c)][1:])


def _dot(a, b):
    """Return the inner product of two short lists, in one rounding for mpf."""
    if isinstance(a[0], mpmath.mpf):
        return mp.fdot(zip(a, b, strict=True))
    return sum(x * y for x, y in zip(a, b, strict=True))


def _from_derivative(first, derivative):
    """Return the series with the given constant term and derivative."""
    return Series([first, *(c / (k + 1) for k, c in enumerate(derivative.c))])


def exp(x):
    """Return e^x by k y[k] = sum j x[j] y[k-j]."""
    if not isinstance(x, Series):
        return context(x).exp(x)
    out = [context(x.c[0]).exp(x.c[0])]
    for k in range(1, len(x)):
        out.append(_dot([j * x.c[j] for j in range(1, k + 1)], out[::-1]) / k)
    return Series(out)


def log(x):
    """Return the natural logarithm."""
    if not isinstance(x, Series):
        return context(x).log(x)
    first = context(x.c[0]).log(x.c[0])
    if len(x) == 1:
        return Series([first])
    return _from_derivative(first, x.differentiate() / Series(x.c[:-1]))


def sin_cos(x):
    """Return sine and cosine together."""
    ctx = context(x.c[0])
    s, c = [ctx.sin(x.c[0])], [ctx.cos(x.c[0])]
    for k in range(1, len(x)):
        rate = [j * x.c[j] for j in range(1, k + 1)]
        s_k, c_k = _dot(rate, c[::-1]) / k, -_dot(rate, s[::-1]) / k
        s.append(s_k)
        c.append(c_k)
    return Series(s), Series(c)


def sin(x):
    """Return the sine."""
    return sin_cos(x)[0] if isinstance(x, Series) else context(x).sin(x)


def cos(x):
    """Return the cosine."""
    return sin_cos(x)[1] if isinstance(x, Series) else context(x).cos(x)


def tan(x):
    """Return the tangent."""
    return sin(x) / cos(x)


def sqrt(x):
    """Return the square root."""
    if not isinstance(x, Series):
        return context(x).sqrt(x)
    out = [context(x.c[0]).sqrt(x.c[0])]
    for k in range(1, len(x)):
        rest = x.c[k] - (_dot(out[1:], out[:0:-1]) if k > 1 else 0)
        out.append(rest / (2 * out[0]))
    return Series(out)


def atan2(y, x, near=None):
    """Return the angle of (x, y), on the branch nearest to the value `near` when that is given."""
    ctx = context(y.c[0])
    first = ctx.atan2(y.c[0], x.c[0])
    if near is not None:
        turn = 2 * ctx.pi
        first = first + turn * round(float((near - first) / turn))
    if len(y) == 1:
        return Series([first])
    a, b = Series(x.c[:-1]), Series(y.c[:-1])
    rate = (a * y.differentiate() - b * x.differentiate()) / (a * a + b * b)
    return _from_derivative(first, rate)


FUNCTIONS = {"sin": sin, "cos": cos, "tan": tan, "exp": exp, "log": log, "sqrt": sqrt, "abs": abs}
