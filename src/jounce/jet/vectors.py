"""Vector and matrix products of jets; components stand on the leading axes, batches behind them."""

from typing import Any

import jax.numpy as jnp

from jounce.jet.algebra import Jet, bilinear, symmetric, total


def dot(a: Any, b: Any) -> Any:
    """Return the scalar product of two vectors, of shape (components, ...), as shape (...)."""
    if isinstance(a, Jet) and a is b:
        return symmetric(_dot, a)
    return bilinear(_dot, a, b)


def cross(a: Any, b: Any) -> Any:
    """Return the vector product of two 3-vectors, or the scalar ``a_x b_y - a_y b_x`` of two plane vectors."""
    return bilinear(_cross, a, b)


def matvec(matrix: Any, vector: Any) -> Any:
    """Return matrix times vector: shapes (rows, columns, ...) and (columns, ...)."""
    return bilinear(_matvec, matrix, vector)


def matmul(a: Any, b: Any) -> Any:
    """Return matrix times matrix: shapes (rows, inner, ...) and (inner, columns, ...)."""
    return bilinear(_matmul, a, b)


def transpose(matrix: Any) -> Any:
    """Exchange the rows and columns of a matrix of shape (rows, columns, ...)."""
    if isinstance(matrix, Jet):
        return matrix.map(transpose)
    return jnp.swapaxes(matrix, 0, 1)


def stack(components: Any) -> Any:
    """Stack scalars, or vectors, jets or arrays, along a new leading component axis."""
    components = list(components)
    jets = [c for c in components if isinstance(c, Jet)]
    if not jets:
        return jnp.stack(jnp.broadcast_arrays(*components))
    order = min(c.order for c in jets)
    whole = [c if isinstance(c, Jet) else Jet.constant(c, order) for c in components]
    return stack_jets(whole, jnp.stack)


def stack_jets(jets: list[Jet], join: Any) -> Jet:
    """Join jets coefficient by coefficient, by ``jnp.stack`` or ``jnp.concatenate``; zeros stay None if all are."""
    values = [jet.coefficients[0] for jet in jets]
    if join is jnp.stack:
        values = jnp.broadcast_arrays(*values)
    shapes = [jnp.shape(v) for v in values]
    zeros = [jnp.zeros(shape) for shape in shapes]

    def level(coefficients: tuple[Any, ...]) -> Any:
        if all(c is None for c in coefficients):
            return None
        filled = zip(coefficients, zeros, shapes, strict=True)
        return join([zero if c is None else jnp.broadcast_to(c, shape) for c, zero, shape in filled])

    return Jet(map(level, zip(*(jet.coefficients for jet in jets), strict=False)))


# Sums of three products are written out: XLA vectorises them along the batch, which it does not do for a reduction.


def _dot(a: Any, b: Any) -> Any:
    return total(a[i] * b[i] for i in range(len(a)))


def _cross(a: Any, b: Any) -> Any:
    if len(a) == 2:
        return a[0] * b[1] - a[1] * b[0]
    return jnp.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _matvec(matrix: Any, vector: Any) -> Any:
    return total(matrix[:, i] * vector[i][None] for i in range(len(vector)))


def _matmul(a: Any, b: Any) -> Any:
    return total(a[:, i, None] * b[None, i] for i in range(len(b)))
