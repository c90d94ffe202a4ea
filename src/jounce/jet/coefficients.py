"""Sums and products of Taylor coefficients; a coefficient of None is known to be zero.

High orders trace these functions thousands of times. Each function of `jax.numpy` is a `jax.jit` around an operation of
`jax.lax`; numbers that need no promotion use the latter directly.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import reduce
from operator import add
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import Real

Coefficient = Real | None
"""A Taylor coefficient of any shape; None is known to be zero."""

Coefficients = Sequence[Any]
"""Taylor coefficients, lowest order first."""

Product = Callable[[Any, Any], Any]


_FLOAT = np.dtype(float)


def _elementwise(operation: Product, promoting: Product) -> Product:
    """Return an operation that aligns operands of different rank at their trailing (batch) axes, without promotion.

    Parameters
    ----------
    operation : callable
        Operation of `jax.lax`, for double precision.
    promoting : callable
        The same operation of `jax.numpy`, for all other types.
    """

    def aligned(a: Any, b: Any) -> Any:
        x, y = _plain(a), _plain(b)
        if x is None or y is None or (type(x) is type(y) is float):
            rank = max(jnp.ndim(a), jnp.ndim(b))
            return promoting(with_rank(a, rank), with_rank(b, rank))
        if type(x) is not float and type(y) is not float and x.ndim != y.ndim:
            rank = max(x.ndim, y.ndim)
            x, y = (jax.lax.reshape(z, (1,) * (rank - z.ndim) + z.shape) for z in (x, y))
        return operation(x, y)

    return aligned


def _plain(x: Any) -> Any:
    """Return a double or an array of doubles, for which `jax.lax` needs no promotion; None for other types."""
    kind = type(x)
    if kind is float:
        return x
    if kind is int:
        return float(x)
    if kind is np.ndarray:
        return x if x.dtype == _FLOAT else None
    aval = getattr(x, "aval", None)  # of JAX arrays and tracers
    return x if aval is not None and aval.dtype == _FLOAT and not aval.weak_type else None


added = _elementwise(jax.lax.add, jnp.add)
subtracted = _elementwise(jax.lax.sub, jnp.subtract)
multiplied = _elementwise(jax.lax.mul, jnp.multiply)
divided = _elementwise(jax.lax.div, jnp.divide)


def negated(a: Any) -> Any:
    """Return a coefficient with opposite sign."""
    return -a if (x := _plain(a)) is None or type(a) in (int, float) else jax.lax.neg(x)


# Products of vectors multiply all components at once, which traces few operations, and then sum. The machine code of an
# instant has the same instructions as with each component written out.


def of_components(a: Any, b: Any) -> Any:
    """Multiply two vectors component by component, arrays of shape (components, ...) with equal last axes."""
    if len(a) != len(b):
        raise ValueError(f"vectors of {len(a)} and {len(b)} components have no product")
    rank = max(a.ndim, b.ndim)
    return multiplied(*(x if x.ndim == rank else _widened(x, rank) for x in (a, b)))


def _widened(vector: Any, rank: int) -> Any:
    """Return a vector with axes of length one inserted behind its components."""
    return vector.reshape(len(vector), *[1] * (rank - vector.ndim), *vector.shape[1:])


def component_sum(vector: Any) -> Any:
    """Return the sum of the components of a vector."""
    return jax.lax.reduce_sum(vector, (0,))


def cycled(vector: Any) -> Any:
    """Return the components y, z and x of a vector."""
    if len(vector) != 3:
        raise ValueError(f"a vector product takes vectors of 2 or 3 components, got {len(vector)}")
    return jnp.concatenate([vector[1:], vector[:1]])


def turned_back(vector: Any) -> Any:
    """Return a plane vector rotated clockwise by a quarter turn: its components y and -x."""
    return jnp.concatenate([vector[1:], -vector[:1]])


def total(terms: Iterable[Any]) -> Any:
    """Return the sum without the leading ``0 +`` of the built-in, which would trace an operation."""
    return reduce(add, terms)


def plus(a: Coefficient, b: Coefficient) -> Any:
    """Return the sum of two coefficients; None is zero."""
    if a is None or b is None:
        return b if a is None else a
    return added(a, b)


def minus(a: Coefficient, b: Coefficient) -> Any:
    """Return the difference of two coefficients; None is zero."""
    if a is None or b is None:
        return a if b is None else negated(b)
    return subtracted(a, b)


def sum_of_products(product: Product, a: Iterable[Any], b: Iterable[Any]) -> Any:
    """Return the sum of the products of paired coefficients; None if all products vanish."""
    terms = [product(x, y) for x, y in zip(a, b, strict=True) if x is not None and y is not None]
    return reduce(added, terms) if terms else None


def convolution(product: Product, a: Coefficients, b: Coefficients) -> list[Any]:
    """Return the coefficients of a product of two series, to the order of the shorter one."""
    return [sum_of_products(product, a[: k + 1], b[k::-1]) for k in range(min(len(a), len(b)))]


def self_convolution(product: Product, a: Coefficients) -> list[Any]:
    """Return the coefficients of a symmetric product of a series with itself, mirrored terms computed once."""
    terms = []
    for k in range(len(a)):
        half = (k + 1) // 2
        double = sum_of_products(product, a[:half], a[k : k - half : -1] if half else ())
        middle = sum_of_products(product, a[k // 2 : k // 2 + 1], a[k // 2 : k // 2 + 1]) if k % 2 == 0 else None
        terms.append(plus(None if double is None else multiplied(double, 2.0), middle))
    return terms


def quotient(a: Coefficients, b: Coefficients) -> list[Any]:
    """Return the coefficients of the quotient of two series, to the order of the shorter one."""
    first, *others = b
    coefficients: list[Any] = []
    for k in range(min(len(a), len(b))):
        remainder = minus(a[k], sum_of_products(multiplied, others[:k], coefficients[::-1]))
        coefficients.append(None if remainder is None else divided(remainder, first))
    return coefficients


def next_of_chain(outer: Coefficients, inner: Coefficients, slope: Coefficients) -> Any:
    """Return the next coefficient of y from ``y' = slope * inner'``."""
    k = len(outer)
    rates = [None if c is None else multiplied(c, j) for j, c in enumerate(inner[: k + 1])]
    value = sum_of_products(multiplied, rates[1:], slope[k - 1 :: -1])
    return None if value is None else multiplied(value, 1 / k)


def square_root(x: Coefficients) -> list[Any]:
    """Return the coefficients of the square root of a series."""
    y: list[Any] = [jnp.sqrt(x[0])]
    for k in range(1, len(x)):
        remainder = minus(x[k], sum_of_products(multiplied, y[1:k], y[k - 1 : 0 : -1]))
        y.append(None if remainder is None else divided(remainder, multiplied(y[0], 2.0)))
    return y


def raised(x: Coefficients, exponent: Real) -> list[Any]:
    """Return the coefficients of a power of a series whose first coefficient is not zero."""
    y: list[Any] = [jnp.power(x[0], exponent)]
    for k in range(1, len(x)):
        weighted = [None if x[j] is None else (exponent * j - (k - j)) * x[j] for j in range(1, k + 1)]
        value = sum_of_products(multiplied, weighted, y[k - 1 :: -1])
        y.append(None if value is None else value / (k * x[0]))
    return y


def with_rank(a: Real, rank: int) -> Any:
    """Return an array with leading axes of length one up to a rank; a number stays a number."""
    missing = rank - jnp.ndim(a)
    return jnp.reshape(a, (1,) * missing + jnp.shape(a)) if missing and jnp.ndim(a) else a


def padded_series(coefficients: list[Any], levels: int) -> Any:
    """Return the first coefficients of a series as an array with room for the others."""
    first = jnp.stack(coefficients)
    return jnp.pad(first, ((0, levels - len(first)), *((0, 0),) * (first.ndim - 1)))
