"""Vector and matrix products of jets; components stand on the leading axes, batches behind them."""

from collections.abc import Iterable
from typing import Any

import jax.numpy as jnp

from jounce.jet.algebra import Jet, Quantity, bilinear, components, concatenate
from jounce.jet.coefficients import total
from jounce.shapes import Numbers


def matvec(matrix: Jet | Numbers, vector: Jet | Numbers) -> Any:
    """Return matrix times vector: shapes (rows, columns, ...) and (columns, ...)."""
    parts = components(vector)
    return total(bilinear(jnp.multiply, matrix[:, i], part) for i, part in enumerate(parts))


def matmul(a: Jet | Numbers, b: Jet | Numbers) -> Any:
    """Return matrix times matrix: shapes (rows, inner, ...) and (inner, columns, ...)."""
    return total(bilinear(jnp.multiply, a[:, i : i + 1], b[i : i + 1]) for i in range(b.shape[0]))


def transpose(matrix: Jet | Numbers) -> Any:
    """Exchange the rows and columns of a matrix of shape (rows, columns, ...)."""
    if isinstance(matrix, Jet):
        return matrix.map(transpose)
    return jnp.swapaxes(matrix, 0, 1)


def stack(parts: Iterable[Quantity]) -> Any:
    """Stack scalars, or vectors, jets or arrays, along a new leading component axis."""
    return concatenate([part[None] if isinstance(part, Jet) else jnp.asarray(part)[None] for part in parts])
