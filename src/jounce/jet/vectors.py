"""Vector and matrix products of jets; components stand on the leading axes, batches behind them."""

from typing import Any

import jax.numpy as jnp

from jounce.jet.algebra import Jet, bilinear, symmetric, total

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


def matvec(matrix: Any, vector: Any) -> Any:
    """Return matrix times vector: shapes (rows, columns, ...) and (columns, ...)."""
    parts = components(vector)
    return total(bilinear(jnp.multiply, matrix[:, i], part) for i, part in enumerate(parts))


def matmul(a: Any, b: Any) -> Any:
    """Return matrix times matrix: shapes (rows, inner, ...) and (inner, columns, ...)."""
    return total(bilinear(jnp.multiply, a[:, i : i + 1], b[i : i + 1]) for i in range(b.shape[0]))


def transpose(matrix: Any) -> Any:
    """Exchange the rows and columns of a matrix of shape (rows, columns, ...)."""
    if isinstance(matrix, Jet):
        return matrix.map(transpose)
    return jnp.swapaxes(matrix, 0, 1)


def stack(parts: Any) -> Any:
    """Stack scalars, or vectors, jets or arrays, along a new leading component axis."""
    return concatenate([part[None] if isinstance(part, Jet) else jnp.asarray(part)[None] for part in parts])


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
