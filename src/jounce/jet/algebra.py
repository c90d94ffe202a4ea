"""The jet: a truncated Taylor series in time, its arithmetic, powers, and products of vectors."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import wraps
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import ArrayLike, Labeled, Numbers, Real, no_numbers, real_derivatives, real_or_traced
from jounce.jet.coefficients import (
    Coefficient,
    Product,
    component_sum,
    convolution,
    cycled,
    divided,
    minus,
    multiplied,
    negated,
    next_of_chain,
    of_components,
    plus,
    quotient,
    raised,
    self_convolution,
    square_root,
    total as total,
    turned_back,
    with_rank,
)
from jounce.settings import in_full


@jax.tree_util.register_pytree_node_class
class Jet:
    """Truncated Taylor series in time of a scalar, vector or matrix quantity.

    A jet of order K holds ``c[k] = x^(k)(t0) / k!`` for k = 0..K. Each coefficient is an array of the
    quantity's own shape: components first, batch axes last. Operators act on jets, arrays and numbers alike;
    an array or number is a constant in time, and of two jets the shorter one sets the order of the result.
    A coefficient of None is known to be zero, and nothing is computed with it.

    Parameters
    ----------
    coefficients : iterable of array or None
        Taylor coefficients ``c[0], ..., c[K]``, all of one shape; the first must be an array.

    Raises
    ------
    ValueError
        If there are no coefficients.

    Examples
    --------
    >>> import jounce as jn
    >>> t = jn.Jet.variable(2.0, order=3)
    >>> [float(x) for x in (t**3).derivatives()]
    [8.0, 12.0, 12.0, 6.0]
    """

    __slots__ = ("coefficients",)
    __array_ufunc__ = None  # NumPy arrays on the left leave the operator to the jet

    def __init__(self, coefficients: Iterable[Any]):  # of `Coefficient`, or placeholders of JAX transformations
        self.coefficients = tuple(coefficients)
        if not self.coefficients:
            raise ValueError("a jet needs at least one coefficient, got none")

    @classmethod
    def constant(cls, value: ArrayLike, order: int) -> "Jet":
        """Return the jet of a constant; raise a ValueError unless it is made of real numbers."""
        return cls((in_full(real_or_traced("value", value, no_numbers)), *[None] * _checked(order)))

    @classmethod
    def variable(cls, value: ArrayLike, order: int) -> "Jet":
        """Return the jet of time itself at the instant (or instants) `value`, in seconds; durations are converted."""
        value = in_full(real_or_traced("value", value, no_numbers, timed=True))
        return cls((value, jnp.ones_like(value), *[None] * (order - 1))[: _checked(order) + 1])

    @classmethod
    def from_derivatives(cls, derivatives: Iterable[ArrayLike]) -> "Jet":
        """Return the jet whose plain derivatives ``x, x', x'', ...`` stand along the leading axis."""
        return cls(jnp.asarray(x, float) * (1 / math.factorial(k)) for k, x in enumerate(real_derivatives(derivatives)))

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
        """Highest order of derivative in the jet."""
        return len(self.coefficients) - 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one coefficient."""
        return jnp.shape(self.coefficients[0])

    @property
    def dtype(self) -> np.dtype:
        """Type of the numbers; together with `shape`, it lets jaxtyping check jets like arrays."""
        return jnp.result_type(self.coefficients[0])

    def tree_flatten(self) -> tuple[Any, None]:
        """Return the coefficients as the leaves for JAX."""
        return self.coefficients, None

    @classmethod
    def tree_unflatten(cls, _: None, leaves: Iterable[Any]) -> "Jet":
        """Return the jet of transformed coefficients."""
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

    def append(self, coefficient: Coefficient) -> "Jet":
        """Return the jet of the next order, with a given highest Taylor coefficient."""
        return Jet((*self.coefficients, coefficient))

    def truncate(self, order: int) -> "Jet":
        """Return the jet cut to at most `order`."""
        return Jet(self.coefficients[: order + 1])

    def differentiate(self) -> "Jet":
        """Return the jet of the time derivative, one order shorter; raise a ValueError at order 0."""
        if self.order == 0:
            raise ValueError("a jet of order 0 carries no derivative")
        first, *rest = (None if c is None else multiplied(c, k) for k, c in enumerate(self.coefficients) if k)
        return Jet((jnp.zeros_like(self.coefficients[0]) if first is None else first, *rest))

    def integrate(self, initial: Real) -> "Jet":
        """Return the jet of the time integral that has the value `initial`, one order longer."""
        rest = [None if c is None else multiplied(c, 1 / (k + 1)) for k, c in enumerate(self.coefficients)]
        return Jet((initial, *rest))

    def evaluate(self, step: Real) -> Any:
        """Return the Taylor prediction a time `step` (in seconds) away."""
        *lower, value = self.coefficients
        for c in reversed(lower):
            value = plus(c, None if value is None else multiplied(value, step))
        return value

    def dot(self, other: "Jet | Numbers") -> "Jet":
        """Return the scalar product along the component axis."""
        return dot(self, other)

    def cross(self, other: "Jet | Numbers") -> "Jet":
        """Return the vector product along the component axis (a scalar in the plane)."""
        return cross(self, other)

    def __neg__(self) -> "Jet":
        return self.map(negated)

    def __pos__(self) -> "Jet":
        return self

    def __add__(self, other: "Quantity") -> "Jet":
        return self._combined(plus, other)

    __radd__ = __add__

    def __sub__(self, other: "Quantity") -> "Jet":
        return self._combined(minus, other)

    def __rsub__(self, other: "Quantity") -> "Jet":
        return -self + other

    def _combined(self, combine: Product, other: "Quantity") -> "Jet":
        """Return the sum or difference; a constant of larger shape broadcasts the other coefficients."""
        if isinstance(other, Jet):
            return Jet(map(combine, self.coefficients, other.coefficients))._filled()
        return Jet((combine(self.coefficients[0], other), *self.coefficients[1:]))._filled()

    def _filled(self) -> "Jet":
        """Return the jet with all coefficients broadcast to the shape of the first."""
        shape = self.shape
        if all(c is None or jnp.shape(c) == shape for c in self.coefficients):
            return self
        return self.map(lambda c: jnp.broadcast_to(with_rank(c, len(shape)), shape))

    def __mul__(self, other: "Quantity") -> "Jet":
        return self.square() if other is self else bilinear(multiplied, self, other)

    __rmul__ = __mul__

    def square(self) -> "Jet":
        """Return the square, with half the products of a general multiplication."""
        return symmetric(multiplied, self)

    def __truediv__(self, other: "Quantity") -> "Jet":
        if not isinstance(other, Jet):
            return self.map(lambda c: divided(c, other))
        return Jet(quotient(self.coefficients, other.coefficients))._filled()

    def __rtruediv__(self, other: Real) -> "Jet":
        return Jet.constant(other, self.order) / self

    def __pow__(self, exponent: "Quantity") -> "Jet":
        return power(self, exponent)

    def __rpow__(self, base: Real) -> "Jet":
        return power(base, self)


Quantity = Jet | Real
"""A jet, or a constant in time: an array or a number."""

JetLike = Quantity | Sequence[Any] | Labeled
"""A jet, or data that becomes one: an array, a number, or a sequence of them."""


def _checked(order: int) -> int:
    if order < 0:
        raise ValueError(f"the order of a jet must not be negative, got {order}")
    return order


def stacked(jet: Jet) -> jax.Array:
    """Return the Taylor coefficients of a jet as one array, order first.

    Examples
    --------
    >>> stacked(Jet.variable(3.0, 2)).tolist()
    [3.0, 1.0, 0.0]
    """
    return jnp.stack(jet.dense().coefficients)


def bilinear(product: Product, a: Quantity, b: Quantity) -> Any:
    """Extend a bilinear `product` of arrays to jets: the Cauchy convolution of their coefficients."""
    if isinstance(a, Jet) and isinstance(b, Jet):
        return Jet(convolution(product, a.coefficients, b.coefficients))
    if isinstance(a, Jet):
        return a.map(lambda c: product(c, b))
    if isinstance(b, Jet):
        return b.map(lambda c: product(a, c))
    return product(a, b)


def symmetric(product: Product, a: Jet) -> Jet:
    """Extend a symmetric bilinear `product` to a jet with itself: mirrored terms are computed once."""
    return Jet(self_convolution(product, a.coefficients))


def components(vector: Jet | Numbers) -> list[Any]:
    """Return the components of a vector of shape (components, ...), each of shape (1, ...)."""
    return [vector[i : i + 1] for i in range(vector.shape[0])]


def dot(a: Jet | Numbers, b: Jet | Numbers) -> Any:
    """Return the scalar product of two vectors, of shape (components, ...), as shape (...)."""
    product = symmetric(multiplied, a) if isinstance(a, Jet) and a is b else bilinear(of_components, a, b)
    return _map_coefficients(component_sum, product)


def cross(a: Jet | Numbers, b: Jet | Numbers) -> Any:
    """Return the vector product of two 3-vectors, or the scalar ``a_x b_y - a_y b_x`` of two plane vectors."""
    if a.shape[0] == 2:
        return dot(a, _map_coefficients(turned_back, b))
    p, q = (_map_coefficients(cycled, vector) for vector in (a, b))
    return _map_coefficients(cycled, bilinear(of_components, a, q) - bilinear(of_components, p, b))


def _map_coefficients(function: Callable[[Any], Any], vector: Any) -> Any:
    """Apply a linear function to an array, or to the coefficients of a jet."""
    return vector.map(function) if isinstance(vector, Jet) else function(vector)


def concatenate(parts: Sequence[Jet | Numbers]) -> Any:
    """Join vectors, jets or arrays, of shape (components, ...), along the component axis.

    Their other axes are broadcast. Jets are joined coefficient by coefficient; the result is None where all are.
    """
    jets = [part for part in parts if isinstance(part, Jet)]
    if not jets:
        return jnp.concatenate(_broadcast_batch(parts))
    order = min(jet.order for jet in jets)
    operands = [part if isinstance(part, Jet) else Jet.constant(part, order) for part in parts]
    first = _broadcast_batch([jet.coefficients[0] for jet in operands])
    shapes = [jnp.shape(value) for value in first]

    def level(coefficients: tuple[Any, ...]) -> Any:
        if all(c is None for c in coefficients):
            return None
        pairs = zip(coefficients, shapes, strict=True)
        return jnp.concatenate([jnp.zeros(s) if c is None else jnp.broadcast_to(c, s) for c, s in pairs])

    rest = zip(*(jet.coefficients[1 : order + 1] for jet in operands), strict=True)
    return Jet((jnp.concatenate(first), *map(level, rest)))


def _broadcast_batch(arrays: Sequence[Any]) -> list[Any]:
    """Broadcast the batch axes, all but the first."""
    batch = jnp.broadcast_shapes(*(jnp.shape(a)[1:] for a in arrays))
    return [jnp.broadcast_to(a, (jnp.shape(a)[0], *batch)) for a in arrays]


def of_quantities(on_arrays: Callable[[Any], Any]) -> Callable[[Callable[[Jet], Jet]], Callable[[Quantity], Any]]:
    """Return a decorator that lets a function of jets take arrays and numbers, too, by a function of JAX."""

    def decorate(on_jets: Callable[[Jet], Jet]) -> Callable[[Quantity], Any]:
        return wraps(on_jets)(lambda x: on_jets(x) if isinstance(x, Jet) else on_arrays(x))

    return decorate


@of_quantities(jnp.exp)
def exp(x: Jet) -> Jet:
    """Return the exponential."""
    y = [jnp.exp(x.coefficients[0])]
    for _ in range(x.order):
        y.append(next_of_chain(y, x.coefficients, y))
    return Jet(y)


@of_quantities(jnp.log)
def log(x: Jet) -> Jet:
    """Return the natural logarithm."""
    first, *rest = x.coefficients
    return (x.differentiate() / x.truncate(x.order - 1)).integrate(jnp.log(first)) if rest else Jet([jnp.log(first)])


@of_quantities(jnp.sqrt)
def sqrt(x: Jet) -> Jet:
    """Return the square root."""
    return Jet(square_root(x.coefficients))


def power(x: Quantity, exponent: Quantity) -> Any:
    """Return `x` to the power `exponent`.

    A whole exponent uses repeated products, as the recurrence for real exponents divides by the base and fails at zero.
    """
    if isinstance(exponent, Jet):
        return exp(exponent * log(x))
    if not isinstance(x, Jet):
        return jnp.power(x, exponent)
    if isinstance(exponent, int) or (isinstance(exponent, float) and exponent.is_integer()):
        return whole_power(x, int(exponent))
    if isinstance(exponent, float) and exponent == 0.5:
        return sqrt(x)
    return real_power(x, jnp.asarray(exponent, float))


def real_power(x: Jet, exponent: Real) -> Jet:
    """Return a power with an exponent that is known at run time only.

    The recurrence divides by the base, so repeated products replace it for whole exponents up to the order.
    """
    at_zero = x.coefficients[0] == 0
    c = (jnp.where(at_zero, 1.0, x.coefficients[0]), *x.coefficients[1:])
    integer_powers = [whole_power(x, m).dense() for m in range(x.order + 1)]
    vanishes = exponent > x.order  # at a base of zero all coefficients vanish; for other real exponents they are NaN

    def coefficient(k: int, value: Any) -> Any:
        value = jnp.where(at_zero, jnp.where(vanishes | ((exponent > 0) & (k == 0)), 0.0, jnp.nan), value)
        for m, power_m in enumerate(integer_powers):
            value = jnp.where(exponent == m, power_m.coefficients[k], value)
        return value

    return Jet(coefficient(k, value) for k, value in enumerate(Jet(raised(c, exponent)).dense().coefficients))


def whole_power(x: Quantity, exponent: int) -> Any:
    """Return a power of a jet or an array by repeated products."""
    if exponent < 0:
        return 1.0 / whole_power(x, -exponent)
    result, doubled = None, x
    while exponent:
        if exponent & 1:
            result = doubled if result is None else result * doubled
        exponent >>= 1
        if exponent:
            doubled = doubled * doubled
    if result is not None:
        return result
    return Jet.constant(jnp.ones_like(x.coefficients[0]), x.order) if isinstance(x, Jet) else jnp.ones_like(x)
