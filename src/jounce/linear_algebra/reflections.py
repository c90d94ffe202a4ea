"""Elimination of small dense matrices by Householder reflections, without pivoting: no choice depends on the numbers.

Each entry is an operation of its own, which suits code for one instant at a time (`jounce.execution.llvm`), where
pivoting would cost more than the arithmetic; on arrays, `DenseFactor` is faster.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.jax_internals import by_certain_entries, subroutine
from jounce.base.modules import Module, field, with_fields
from jounce.base.shapes import Numbers
from jounce.linear_algebra.elimination_order import Order

Columns = Float[Numbers, "row batch"]


class ReflectedFactor(Module):
    """A batch of small square matrices, factored into reflections and a triangle; batch last.

    Triangular solution after reflections is backward stable (Higham 2002, Accuracy and Stability of Numerical
    Algorithms, section 19.3). The refinement step serves factors of nearby matrices.
    """

    matrix: Float[Numbers, "row row batch"]
    reduced: Float[Numbers, "row row batch"]  # triangle above the diagonal, reflections on and below it
    pivots: Columns  # diagonal of the triangle
    shares: Columns  # two over the squared length of each reflection; 0 without reflection
    order: Order = field(static=True)  # of the rows and columns in all of these arrays

    @classmethod
    @by_certain_entries()
    def of(cls, matrix: Float[Numbers, "row row batch"], order: Order) -> "ReflectedFactor":
        """Factor matrices of shape (rows, rows, batch) with rows and columns in a given order."""
        return cls._of_ordered(_ordered(matrix, order), order)

    @classmethod
    @by_certain_entries()
    def _of_ordered(cls, matrix: Float[Numbers, "row row batch"], order: Order) -> "ReflectedFactor":
        columns, pivots, shares, rows, remainder = [], [], [], [], matrix
        for _ in range(len(matrix)):
            column, pivot, share = reflection(remainder[:, 0])
            trailing = remainder[:, 1:]
            part = jnp.sum(column[:, None] * trailing, axis=0) * share[None]
            trailing = trailing - column[:, None] * part[None]
            columns.append(column)
            pivots.append(pivot)
            shares.append(share)
            rows.append(trailing[0])
            remainder = trailing[1:]
        size = len(matrix)
        reduced = [
            jnp.concatenate([jnp.stack([columns[j][i - j] for j in range(i + 1)]), rows[i]]) for i in range(size)
        ]
        return cls(matrix, jnp.stack(reduced), jnp.stack(pivots), jnp.stack(shares), order)

    @classmethod
    def blank(cls, order: Order, lanes: int) -> "ReflectedFactor":
        """Return placeholder factors of a batch, to start a loop."""
        size = len(order[0])
        matrix, column = np.zeros((size, size, lanes)), np.zeros((size, lanes))
        return cls(matrix, matrix, column, column, order)

    def refining(self, matrix: Float[Numbers, "row row batch"]) -> "ReflectedFactor":
        """Return these factors for nearby matrices, whose solutions they find by refinement."""
        return with_fields(self, matrix=_ordered(matrix, self.order))

    def renewed(self) -> "ReflectedFactor":
        """Return new factors of the present matrices."""
        return self._of_ordered(self.matrix, self.order)

    @by_certain_entries()
    def defect(self) -> Float[Numbers, " batch"]:
        """Return the relative error of unrefined solutions, measured on one known solution, shape (batch,).

        Refined solutions have the square of this error. It is not finite where a matrix is singular.
        """
        solution = np.where(np.arange(len(self.pivots)) % 3 == 1, -1.0, 1.0)
        right = jnp.sum(self.matrix * solution[None, :, None], axis=1)
        return jnp.max(jnp.abs(_substituted(self, right) - solution[:, None]), axis=0)

    @by_certain_entries()
    def solve(self, right: Columns, *, refined: bool = True) -> Columns:
        """Return the solutions for right-hand sides of shape (rows, batch); not finite where a matrix is singular.

        A correction that is followed by another one need not be refined.
        """
        rows, columns = self.order
        right = right[np.asarray(rows)]
        solution = _substituted(self, right)
        if refined:
            solution = solution + _substituted(self, right - jnp.sum(self.matrix * solution[None], axis=1))
        return solution[np.argsort(columns)]

    def applied_inverse(self, matrix: Float[Numbers, "row column"]) -> Float[Numbers, "row column"]:
        """Return the products of the inverse of the first matrix with the columns of another, shape (rows, columns)."""
        first = jax.tree.map(lambda x: x[..., :1], self)
        return jax.lax.map(lambda column: first.solve(column[:, None], refined=False)[:, 0], matrix.T).T

    def pivot_ratio(self) -> Float[Numbers, " batch"]:
        """Return the ratio of smallest to largest pivot, shape (batch,): near zero at a singular position."""
        sizes = jnp.abs(self.pivots)
        return jnp.min(sizes, axis=0) / jnp.max(sizes, axis=0)

    def sign(self) -> Float[Numbers, " batch"]:
        """Return the signs of the determinants, shape (batch,): 0 where singular, NaN where not finite."""
        reflected = jnp.where(self.shares == 0, 1.0, -1.0)
        swaps = sum(later < index for order in self.order for k, index in enumerate(order) for later in order[k:])
        return jnp.prod(reflected * jnp.sign(self.pivots), axis=0) * (-1.0) ** swaps


def reflection(first: Columns) -> tuple[Columns, Float[Numbers, " batch"], Float[Numbers, " batch"]]:
    """Return the reflection that clears a column below its first entry, that entry, and 2 over its square or 0."""
    length = jnp.sqrt(jnp.sum(first * first, axis=0))
    pivot = jnp.where(first[0] > 0, -length, length)
    head = first[0] - pivot
    square = length * (length + jnp.abs(first[0]))  # half the squared length of the reflection
    factor = jnp.where(square == 0, 0.0, 1.0 / jnp.where(square == 0, 1.0, square))
    return jnp.concatenate([head[None], first[1:]]), pivot, factor


def _ordered(matrix: Float[Numbers, "row row batch"], order: Order) -> Float[Numbers, "row row batch"]:
    rows, columns = map(np.asarray, order)
    return matrix[rows[:, None], columns[None]]


@subroutine  # traced once for all orders
@by_certain_entries()
def _substituted(factor: ReflectedFactor, right: Columns) -> Columns:
    size = len(factor.pivots)
    for k in range(size):
        column = factor.reduced[k:, k]
        part = jnp.sum(column * right[k:], axis=0) * factor.shares[k]
        right = jnp.concatenate([right[:k], right[k:] - column * part[None]])
    solution = right[:0]
    for k in reversed(range(size)):
        remainder = right[k] - jnp.sum(factor.reduced[k, k + 1 :] * solution, axis=0)
        solution = jnp.concatenate([(remainder / factor.pivots[k])[None], solution])
    return solution
