"""The jet: a truncated Taylor series in time, its arithmetic, powers, and products of vectors."""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from jounce.jet.coefficients import elementwise, minus, plus, ranked, sum_of_products, total


@jax.tree_util.register_pytree_node_class
class Jet:
    """Truncated Taylor series in time of a scalar, vector or matrix quantity.

    A jet of order K holds ``c[k] = x^(k)(t0) / k!`` for k = 0..K. Each coefficient is an array of the
    quantity's own shape: components first, batch axes last. Operators act on jets, arrays and numbers alike;
    an array or number is a constant in time, and of two jets the shorter one sets the order of the result.
    A coefficient that is None is zero for certain, and nothing is computed with it.

    Parameters
    ----------
    coefficients : iterable of array or None
        Taylor coefficients ``c[0], ..., c[K]``, all of one shape; the first one is an array.

    Raises
    ------
    ValueError
        If there is no coefficient.

    Examples
    --------
    >>> import jounce as jn
    >>> t = jn.Jet.variable(2.0, order=3)
    >>> [float(x) for x in (t**3).derivatives()]
    [8.0, 12.0, 12.0, 6.0]
    """

    __slots__ = ("coefficients",)
    __array_ufunc__ = None  # NumPy arrays on the left leave the operator to the jet

    def __init__(self, coefficients: Iterable[Any]):
        self.coefficients = tuple(coefficients)
        if not self.coefficients:
            raise ValueError("a jet needs at least one coefficient, got none")

    @classmethod
    def constant(cls, value: Any, order: int) -> "Jet":
        """Return the jet of a quantity that does not change in time."""
        return cls((jnp.asarray(value), *[None] * _checked(order)))

    @classmethod
    def variable(cls, value: Any, order: int) -> "Jet":
        """Return the jet of time itself at the instant (or instants) `value`, in seconds."""
        value = jnp.asarray(value)
        return cls((value, jnp.ones_like(value), *[None] * (order - 1))[: _checked(order) + 1])

    @classmethod
    def from_derivatives(cls, derivatives: Any) -> "Jet":
        """Return the jet whose plain derivatives ``x, x', x'', ...`` stand along the leading axis."""
        return cls(jnp.asarray(x, float) * (1 / math.factorial(k)) for k, x in enumerate(derivatives))

    def derivatives(self) -> jax.Array:
        """Return the plain derivatives ``x, x', x'', ...`` along a new leading axis."""
        return jnp.stack([c * math.factorial(k) for k, c in enumerate(self.dense().coefficients)])

    def dense(self) -> "Jet":
        """Return the same jet with arrays of zeros where coefficients are None."""
        if all(c is not None for c in self.coefficients):  # `in` would compare arrays
            return self
        zero = jnp.zeros_like(self.coefficients[0])
        return Jet(zero if c is None else c for c in self.coefficients)

    @property
    def order(self) -> int:
        """Highest derivative that the jet carries."""
        return len(self.coefficients) - 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one coefficient."""
        return jnp.shape(self.coefficients[0])

    def tree_flatten(self) -> tuple[Any, None]:
        """Tell JAX that the coefficients are what it transforms."""
        return self.coefficients, None

    @classmethod
    def tree_unflatten(cls, _: None, leaves: Any) -> "Jet":
        """Build the jet again from its transformed coefficients."""
        jet = object.__new__(cls)  # transformations pass placeholders that are not arrays
        jet.coefficients = tuple(leaves)
        return jet

    def __repr__(self) -> str:
        return f"Jet(order={self.order}, shape={self.shape})"

    def __getitem__(self, index: Any) -> "Jet":
        return self.map(lambda c: c[index])

    def __iter__(self) -> Iterator["Jet"]:
        return (self[i] for i in range(self.shape[0]))

    def map(self, function: Callable[[Any], Any]) -> "Jet":
        """Apply a linear, time-independent `function` to every coefficient."""
        return Jet(None if c is None else function(c) for c in self.coefficients)

    def append(self, coefficient: Any) -> "Jet":
        """Return the jet of one order more, with the given highest Taylor coefficient."""
        return Jet((*self.coefficients, coefficient))

    def truncate(self, order: int) -> "Jet":
        """Return the jet cut to at most `order`."""
        return Jet(self.coefficients[: order + 1])

    def differentiate(self) -> "Jet":
        """Return the jet of the time derivative, one order shorter.

        Raises
        ------
        ValueError
            If the jet has order 0 and carries no derivative.
        """
        if self.order == 0:
            raise ValueError("a jet of order 0 carries no derivative")
        first, *rest = (None if c is None else k * c for k, c in enumerate(self.coefficients) if k)
        return Jet((jnp.zeros_like(self.coefficients[0]) if first is None else first, *rest))

    def integrate(self, initial: Any) -> "Jet":
        """Return the jet of the time integral that has the value `initial`, one order longer."""
        return Jet((initial, *[None if c is None else c * (1 / (k + 1)) for k, c in enumerate(self.coefficients)]))

    def evaluate(self, step: Any) -> Any:
        """Return the Taylor prediction a time `step` (in seconds) away."""
        *lower, value = self.coefficients
        for c in reversed(lower):
            value = plus(c, None if value is None else elementwise(jnp.multiply)(value, step))
        return value

    def dot(self, other: Any) -> Any:
        """Return the scalar product along the component axis."""
        return dot(self, other)

    def cross(self, other: Any) -> Any:
        """Return the vector product along the component axis (a scalar in the plane)."""
        return cross(self, other)

    def __neg__(self) -> "Jet":
        return self.map(lambda c: -c)

    def __pos__(self) -> "Jet":
        return self

    def __add__(self, other: Any) -> "Jet":
        if isinstance(other, Jet):
            return Jet(map(plus, self.coefficients, other.coefficients))._filled()
        return self._shift(plus(self.coefficients[0], other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Jet":
        if isinstance(other, Jet):
            return Jet(map(minus, self.coefficients, other.coefficients))._filled()
        return self._shift(minus(self.coefficients[0], other))

    def __rsub__(self, other: Any) -> "Jet":
        return -self + other

    def _shift(self, first: Any) -> "Jet":
        """Replace the value; a constant of larger shape than the jet makes the other coefficients follow."""
        return Jet((first, *self.coefficients[1:]))._filled()

    def _filled(self) -> "Jet":
        """Give all coefficients the shape of the first, where a sum of unequal shapes left some as they were."""
        shape = self.shape
        if all(c is None or jnp.shape(c) == shape for c in self.coefficients):
            return self
        return self.map(lambda c: jnp.broadcast_to(ranked(c, len(shape)), shape))

    def __mul__(self, other: Any) -> "Jet":
        if other is self:
            return self.square()
        return bilinear(elementwise(jnp.multiply), self, other)

    __rmul__ = __mul__

    def square(self) -> "Jet":
        """Return the square, with half the products of a general multiplication."""
        return symmetric(jnp.multiply, self)

    def __truediv__(self, other: Any) -> "Jet":
        divide = elementwise(jnp.divide)
        if not isinstance(other, Jet):
            return self.map(lambda c: divide(c, other))
        b0, *b = other.coefficients
        quotient: list[Any] = []
        for k in range(min(self.order, other.order) + 1):
            known = sum_of_products(elementwise(jnp.multiply), b[:k], quotient[::-1])
            rest = minus(self.coefficients[k], known)
            quotient.append(None if rest is None else divide(rest, b0))
        return Jet(quotient)._filled()

    def __rtruediv__(self, other: Any) -> "Jet":
        return Jet.constant(other, self.order) / self

    def __pow__(self, exponent: Any) -> "Jet":
        return power(self, exponent)

    def __rpow__(self, base: Any) -> "Jet":
        return power(base, self)


Quantity = Jet | ArrayLike
"""A jet, or what does not change in time: an array or a number."""


def _checked(order: int) -> int:
    if order < 0:
        raise ValueError(f"the order of a jet must not be negative, got {order}")
    return order


def stacked(jet: Jet) -> Any:
    """Return the Taylor coefficients of a jet as one array, order first.

    Examples
    --------
    >>> stacked(Jet.variable(3.0, 2)).tolist()
    [3.0, 1.0, 0.0]
    """
    return jnp.stack(jet.dense().coefficients)


def bilinear(product: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
    """Extend a bilinear `product` of arrays to jets: the Cauchy convolution of their coefficients."""
    if isinstance(a, Jet) and isinstance(b, Jet):
        x, y = a.coefficients, b.coefficients
        return Jet(sum_of_products(product, x[: k + 1], y[k::-1]) for k in range(min(len(x), len(y))))
    if isinstance(a, Jet):
        return a.map(lambda c: product(c, b))
    if isinstance(b, Jet):
        return b.map(lambda c: product(a, c))
    return product(a, b)


def symmetric(product: Callable[[Any, Any], Any], a: Jet) -> Jet:
    """Extend a symmetric bilinear `product` to a jet with itself: mirrored terms are computed once."""
    x = a.coefficients

    def coefficient(k: int) -> Any:
        half = (k + 1) // 2
        twice = sum_of_products(product, x[:half], x[k : k - half : -1] if half else ())
        twice = None if twice is None else 2 * twice
        middle = x[k // 2] if k % 2 == 0 else None
        return plus(twice, None if middle is None else product(middle, middle))

    return Jet(map(coefficient, range(len(x))))


# Components are cut out once for each coefficient, as slices that keep their axis, and their products are written out:
# high orders trace them hundreds of times, and XLA vectorises them along the batch, which it does not do for sums.


def components(vector: Any) -> list[Any]:
    """Return the components of a vector of shape (components, ...), each of shape (1, ...)."""
    size = vector.shape[0] if isinstance(vector, Jet) else len(vector)
    return [vector[i : i + 1] for i in range(size)]


def dot(a: Any, b: Any) -> Any:
    """Return the scalar product of two vectors, of shape (components, ...), as shape (...)."""
    if isinstance(a, Jet) and a is b:
        return total(symmetric(jnp.multiply, x) for x in components(a))[0]
    return total(bilinear(jnp.multiply, x, y) for x, y in zip(components(a), components(b), strict=True))[0]


def cross(a: Any, b: Any) -> Any:
    """Return the vector product of two 3-vectors, or the scalar ``a_x b_y - a_y b_x`` of two plane vectors."""
    a, b = components(a), components(b)

    def entry(i: int, j: int) -> Any:
        return bilinear(jnp.multiply, a[i], b[j]) - bilinear(jnp.multiply, a[j], b[i])

    if len(a) == 2:
        return entry(0, 1)[0]
    return concatenate([entry(1, 2), entry(2, 0), entry(0, 1)])


def concatenate(parts: list[Any]) -> Any:
    """Join vectors, jets or arrays, of shape (components, ...), along the component axis.

    Their other axes are broadcast. Jets are joined coefficient by coefficient; None where it is None in all of them.
    """
    jets = [part for part in parts if isinstance(part, Jet)]
    if not jets:
        return jnp.concatenate(_alike(parts))
    order = min(jet.order for jet in jets)
    whole = [part if isinstance(part, Jet) else Jet.constant(part, order) for part in parts]
    first = _alike([jet.coefficients[0] for jet in whole])
    shapes = [jnp.shape(value) for value in first]

    def level(coefficients: tuple[Any, ...]) -> Any:
        if all(c is None for c in coefficients):
            return None
        pairs = zip(coefficients, shapes, strict=True)
        return jnp.concatenate([jnp.zeros(s) if c is None else jnp.broadcast_to(c, s) for c, s in pairs])

    rest = zip(*(jet.coefficients[1 : order + 1] for jet in whole), strict=True)
    return Jet((jnp.concatenate(first), *map(level, rest)))


def _alike(arrays: list[Any]) -> list[Any]:
    """Broadcast the batch axes, all but the first."""
    batch = jnp.broadcast_shapes(*(jnp.shape(a)[1:] for a in arrays))
    return [jnp.broadcast_to(a, (jnp.shape(a)[0], *batch)) for a in arrays]


def next_of_chain(outer: list[Any], inner: Jet, slope: list[Any]) -> Any:
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
        y.append(next_of_chain(y, x, y))
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
        return whole_power(x, exponent)
    if isinstance(exponent, float) and exponent == 0.5:
        return sqrt(x)
    return real_power(x, jnp.asarray(exponent, float))


def real_power(x: Jet, exponent: Any) -> Jet:
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
    whole = [whole_power(x, m).dense() for m in range(x.order + 1)]
    beyond = exponent > x.order  # at a base of zero, every coefficient vanishes; other exponents have none there

    def coefficient(k: int, value: Any) -> Any:
        value = jnp.where(at_zero, jnp.where(beyond | ((exponent > 0) & (k == 0)), 0.0, jnp.nan), value)
        for m, power_m in enumerate(whole):
            value = jnp.where(exponent == m, power_m.coefficients[k], value)
        return value

    return Jet(coefficient(k, value) for k, value in enumerate(Jet(y).dense().coefficients))


def square(x: Any) -> Any:
    """Return the square of a jet or an array."""
    return x.square() if isinstance(x, Jet) else x * x


def whole_power(x: Any, exponent: int) -> Any:
    """Return a power of a jet or an array by repeated products."""
    if exponent < 0:
        return 1.0 / whole_power(x, -exponent)
    result, doubled = None, x
    while exponent:
        if exponent & 1:
            result = doubled if result is None else result * doubled
        exponent >>= 1
        if exponent:
            doubled = square(doubled)
    if result is not None:
        return result
    return Jet.constant(jnp.ones_like(x.coefficients[0]), x.order) if isinstance(x, Jet) else jnp.ones_like(x)
