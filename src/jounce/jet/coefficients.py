"""Sums and products of Taylor coefficients; None is a coefficient that is zero for certain."""

from collections.abc import Callable, Iterable
from functools import reduce
from operator import add
from typing import Any

import jax.numpy as jnp


def total(terms: Iterable[Any]) -> Any:
    """Sum without the leading ``0 +`` of the built-in, which would put an operation into every trace."""
    return reduce(add, terms)


def plus(a: Any, b: Any) -> Any:
    """Add coefficients; None is zero."""
    if a is None or b is None:
        return b if a is None else a
    return elementwise(jnp.add)(a, b)


def minus(a: Any, b: Any) -> Any:
    """Subtract coefficients; None is zero."""
    if a is None or b is None:
        return a if b is None else -b
    return elementwise(jnp.subtract)(a, b)


def sum_of_products(product: Callable[[Any, Any], Any], a: Iterable[Any], b: Iterable[Any]) -> Any:
    """Return the sum of the products of paired coefficients, None where all of them vanish."""
    terms = [product(x, y) for x, y in zip(a, b, strict=True) if x is not None and y is not None]
    return total(terms) if terms else None


def elementwise(operation: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Let operands of different rank meet at their trailing (batch) axes, said aloud for strict rank promotion."""

    def aligned(a: Any, b: Any) -> Any:
        rank = max(jnp.ndim(a), jnp.ndim(b))
        return operation(ranked(a, rank), ranked(b, rank))

    return aligned


def ranked(a: Any, rank: int) -> Any:
    """Put axes of length one before those of an array; a number stays a number."""
    missing = rank - jnp.ndim(a)
    return jnp.reshape(a, (1,) * missing + jnp.shape(a)) if missing and jnp.ndim(a) else a
