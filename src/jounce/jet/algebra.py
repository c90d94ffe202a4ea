"""The jet: a truncated Taylor series in time, and its arithmetic."""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import reduce
from operator import add
from typing import Any

import jax
import jax.numpy as jnp


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
            value = plus(c, None if value is None else _elementwise(jnp.multiply)(value, step))
        return value

    def dot(self, other: Any) -> Any:
        """Return the scalar product along the component axis."""
        from jounce.jet.vectors import dot

        return dot(self, other)

    def cross(self, other: Any) -> Any:
        """Return the vector product along the component axis (a scalar in the plane)."""
        from jounce.jet.vectors import cross

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
        return self.map(lambda c: jnp.broadcast_to(_ranked(c, len(shape)), shape))

    def __mul__(self, other: Any) -> "Jet":
        if other is self:
            return self.square()
        return bilinear(_elementwise(jnp.multiply), self, other)

    __rmul__ = __mul__

    def square(self) -> "Jet":
        """Return the square, with half the products of a general multiplication."""
        return symmetric(jnp.multiply, self)

    def __truediv__(self, other: Any) -> "Jet":
        divide = _elementwise(jnp.divide)
        if not isinstance(other, Jet):
            return self.map(lambda c: divide(c, other))
        b0, *b = other.coefficients
        quotient: list[Any] = []
        for k in range(min(self.order, other.order) + 1):
            known = sum_of_products(_elementwise(jnp.multiply), b[:k], quotient[::-1])
            rest = minus(self.coefficients[k], known)
            quotient.append(None if rest is None else divide(rest, b0))
        return Jet(quotient)._filled()

    def __rtruediv__(self, other: Any) -> "Jet":
        return Jet.constant(other, self.order) / self

    def __pow__(self, exponent: Any) -> "Jet":
        from jounce.jet.elementary import power

        return power(self, exponent)

    def __rpow__(self, base: Any) -> "Jet":
        from jounce.jet.elementary import power

        return power(base, self)


def _checked(order: int) -> int:
    if order < 0:
        raise ValueError(f"the order of a jet must not be negative, got {order}")
    return order


def total(terms: Iterable[Any]) -> Any:
    """Sum without the leading ``0 +`` of the built-in, which would put an operation into every trace."""
    return reduce(add, terms)


def plus(a: Any, b: Any) -> Any:
    """Add coefficients; None is zero."""
    if a is None or b is None:
        return b if a is None else a
    return _elementwise(jnp.add)(a, b)


def minus(a: Any, b: Any) -> Any:
    """Subtract coefficients; None is zero."""
    if a is None or b is None:
        return a if b is None else -b
    return _elementwise(jnp.subtract)(a, b)


def sum_of_products(product: Callable[[Any, Any], Any], a: Iterable[Any], b: Iterable[Any]) -> Any:
    """Return the sum of the products of paired coefficients, None where all of them vanish."""
    terms = [product(x, y) for x, y in zip(a, b, strict=True) if x is not None and y is not None]
    return total(terms) if terms else None


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


def _elementwise(operation: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Let operands of different rank meet at their trailing (batch) axes, said aloud for strict rank promotion."""

    def aligned(a: Any, b: Any) -> Any:
        rank = max(jnp.ndim(a), jnp.ndim(b))
        return operation(_ranked(a, rank), _ranked(b, rank))

    return aligned


def _ranked(a: Any, rank: int) -> Any:
    """Put axes of length one before those of an array; a number stays a number."""
    missing = rank - jnp.ndim(a)
    return jnp.reshape(a, (1,) * missing + jnp.shape(a)) if missing and jnp.ndim(a) else a
