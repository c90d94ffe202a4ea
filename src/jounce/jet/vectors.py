"""Vector and matrix products of jets; component axes are first, batch axes last."""

from collections.abc import Iterable
from typing import Any, overload

import jax
import jax.numpy as jnp

from jounce.base.shapes import Numbers
from jounce.jet.algebra import Jet, Quantity, bilinear, components, concatenate
from jounce.jet.coefficients import total


@overload
def matvec(matrix: Jet, vector: Jet | Numbers) -> Jet: ...
@overload
def matvec(matrix: Numbers, vector: Jet) -> Jet: ...
@overload
def matvec(matrix: Numbers, vector: Numbers) -> jax.Array: ...
def matvec(matrix: Jet | Numbers, vector: Jet | Numbers) -> Jet | jax.Array:
    """Return matrix times vector: shapes (rows, columns, ...) and (columns, ...)."""
    parts = components(vector)
    return total(bilinear(jnp.multiply, matrix[:, i], part) for i, part in enumerate(parts))


@overload
def matmul(a: Jet, b: Jet | Numbers) -> Jet: ...
@overload
def matmul(a: Numbers, b: Jet) -> Jet: ...
@overload
def matmul(a: Numbers, b: Numbers) -> jax.Array: ...
def matmul(a: Jet | Numbers, b: Jet | Numbers) -> Jet | jax.Array:
    """Return matrix times matrix: shapes (rows, inner, ...) and (inner, columns, ...)."""
    return total(bilinear(jnp.multiply, a[:, i : i + 1], b[i : i + 1]) for i in range(b.shape[0]))


@overload
def transpose(matrix: Jet) -> Jet: ...
@overload
def transpose(matrix: Numbers) -> jax.Array: ...
def transpose(matrix: Jet | Numbers) -> Jet | jax.Array:
    """Return the transpose of a matrix of shape (rows, columns, ...)."""
    if isinstance(matrix, Jet):
        return matrix.map(transpose)
    return jnp.swapaxes(matrix, 0, 1)


def stack(parts: Iterable[Quantity]) -> Any:
    """Stack scalars or vectors, as jets or arrays, along a new leading component axis."""
    return concatenate([part[None] if isinstance(part, Jet) else jnp.asarray(part)[None] for part in parts])
