"""The linear solver, behind one small interface: factor once, solve often, also with the transpose."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp


class DenseFactor(eqx.Module):
    """A batch of small dense matrices, factored by Gauss-Jordan elimination with partial pivoting; the batch is last.

    Each operation is one on the whole batch, and none is LAPACK's, so that programs with it may run in several threads:
    JAX 0.10 shares the batches of LAPACK among XLA's threads and waits for them in such a thread, and two programs on
    two cores wait for each other forever.

    Rows stay where they are: the pivot of column k is that of row ``order[k]``. One step of refinement brings the
    residual of a solution to rounding, as substitution would, which a product with the inverse alone does not (Higham
    2002, Accuracy and Stability of Numerical Algorithms, sections 12.1 and 14.1).
    """

    matrix: Any  # (rows, rows, batch)
    eliminated: Any  # (rows, rows, batch): element (order[k], j) is element (k, order[j]) of the inverse
    order: Any  # (rows, batch): the row of each pivot
    rank: Any  # (rows, batch): which pivot each row has; the inverse permutation
    pivots: Any  # (rows, batch)

    @classmethod
    def of(cls, matrix: Any) -> "DenseFactor":
        """Factor matrices of shape (rows, rows, batch)."""
        size, lanes = matrix.shape[0], matrix.shape[-1]
        rows = jnp.arange(size)[:, None]
        at, put = jax.lax.dynamic_index_in_dim, jax.lax.dynamic_update_index_in_dim

        def eliminate(k: Any, carry: Any) -> Any:
            matrix, order, rank, pivots = carry
            column = at(matrix, k, 1, False)
            largest = jnp.argmax(jnp.where(rank == size, jnp.abs(column), -1.0), axis=0)[None]
            row = jnp.take_along_axis(matrix, largest[None], axis=0)[0]
            pivot, here, chosen = at(row, k, 0), rows == k, rows == largest
            # column k makes room for that of the identity; a pivot of zero leaves the others finite
            row = jnp.where(here, 1.0, row) / jnp.where(pivot == 0, 1.0, pivot)
            others = jnp.where(chosen[:, None] | here[None], 0.0, matrix)
            matrix = others - jnp.where(chosen, -1.0, column)[:, None] * row[None]
            return matrix, put(order, largest, k, 0), jnp.where(chosen, k, rank), put(pivots, pivot, k, 0)

        order = jnp.zeros((size, lanes), int)
        start = (matrix, order, jnp.full_like(order, size), jnp.zeros((size, lanes)))
        return cls(matrix, *jax.lax.fori_loop(0, size, eliminate, start))

    @classmethod
    def blank(cls, shape: tuple[int, ...], lanes: int) -> "DenseFactor":
        """Return a placeholder for the factors of a batch, to start a loop with."""
        matrix, column = jnp.zeros((*shape, lanes)), jnp.zeros((shape[0], lanes))
        return cls(matrix, matrix, column.astype(int), column.astype(int), column)

    def solve(self, right: Any) -> Any:
        """Return the solution for right-hand sides of shape (rows, batch); it is NaN where a matrix is singular."""

        def product(right: Any) -> Any:
            columns = jnp.take_along_axis(right, self.order, axis=0)
            return jnp.take_along_axis(jnp.sum(self.eliminated * columns[None], axis=1), self.order, axis=0)

        solution = product(right)
        rest = right - jnp.sum(self.matrix * solution[None], axis=1)
        return (solution + product(rest)) * self._regular()

    def solve_transposed(self, right: Any) -> Any:
        """Return the solution with the transposed matrices, for right-hand sides of shape (rows, batch)."""

        def product(right: Any) -> Any:
            rows = jnp.take_along_axis(right, self.rank, axis=0)
            return jnp.take_along_axis(jnp.sum(self.eliminated * rows[:, None], axis=0), self.rank, axis=0)

        solution = product(right)
        rest = right - jnp.sum(self.matrix * solution[:, None], axis=0)
        return (solution + product(rest)) * self._regular()

    def inverse(self) -> Any:
        """Return the inverse matrices, shape (rows, rows, batch), for many right-hand sides that come one by one."""
        rows = jnp.take_along_axis(self.eliminated, self.order[:, None], axis=0)
        return jnp.take_along_axis(rows, self.rank[None], axis=1) * self._regular()[None]

    def pivot_ratio(self) -> Any:
        """Return the smallest pivot over the largest, shape (batch,): near zero at a singular position."""
        sizes = jnp.abs(self.pivots)
        return jnp.min(sizes, axis=0) / jnp.max(sizes, axis=0)

    def sign(self) -> Any:
        """Return the signs of the determinants, shape (batch,): 0 where singular, NaN where not finite."""
        size = len(self.order)
        later = jnp.triu(jnp.ones((size, size), bool), 1)[..., None]
        swaps = later & (self.order[:, None] > self.order[None])
        odd = jnp.sum(swaps, axis=(0, 1)) % 2 == 1
        return jnp.prod(jnp.sign(self.pivots), axis=0) * jnp.where(odd, -1.0, 1.0)

    def _regular(self) -> Any:
        return jnp.where(jnp.all(self.pivots != 0, axis=0, keepdims=True), 1.0, jnp.nan)
