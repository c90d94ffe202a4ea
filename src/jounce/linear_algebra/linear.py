"""Linear algebra of batches of small matrices, batch last: factor once, solve often; singular values."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jounce.base.modules import Module
from jounce.base.shapes import Numbers

Matrices = Float[Numbers, "row row batch"]
Columns = Float[Numbers, "row batch"]


class DenseFactor(Module):
    """A batch of small dense matrices, factored by Gauss-Jordan elimination with partial pivoting; batch last.

    Each operation acts on the whole batch, and none is LAPACK's, so that programs may run in several threads: JAX 0.10
    distributes LAPACK batches over XLA's threads and waits for them in such a thread, so that two programs on two cores
    deadlock.

    Rows stay in place: the pivot of column k is in row ``order[k]``. One step of refinement brings the residual of a
    solution to rounding, as substitution would; a product with the inverse alone does not (Higham 2002, Accuracy and
    Stability of Numerical Algorithms, sections 12.1 and 14.1).
    """

    matrix: Matrices
    eliminated: Matrices  # element (order[k], j) is element (k, order[j]) of the inverse
    order: Int[Numbers, "row batch"]  # the row of each pivot
    pivots: Columns

    @classmethod
    def of(cls, matrix: Matrices) -> "DenseFactor":
        """Factor matrices of shape (rows, rows, batch)."""
        size, lanes = matrix.shape[0], matrix.shape[-1]
        rows = np.arange(size, dtype=np.int32)[:, None]
        take, put = jax.lax.dynamic_index_in_dim, jax.lax.dynamic_update_index_in_dim

        def eliminate(k: Any, carry: Any) -> Any:
            matrix, free, order, pivots = carry
            column = take(matrix, k, 1, False)
            largest = _largest(jnp.where(free, jnp.abs(column), -1.0), rows)
            row = _rows(matrix, largest[None])[0]
            pivot, diagonal, chosen = take(row, k, 0), rows == k, rows == largest
            # column k is replaced by that of the identity; a zero pivot leaves the other entries finite
            row = jnp.where(diagonal, 1.0, row) * (1.0 / jnp.where(pivot == 0, 1.0, pivot))
            cleared = jnp.where(chosen[:, None] | diagonal[None], 0.0, matrix)
            matrix = cleared - jnp.where(chosen, -1.0, column)[:, None] * row[None]
            return matrix, free & ~chosen, put(order, largest, k, 0), put(pivots, pivot, k, 0)

        pivots = np.zeros((size, lanes))
        start = (matrix, np.ones((size, lanes), bool), np.zeros((size, lanes), np.int32), pivots)
        eliminated, _, order, pivots = jax.lax.fori_loop(0, size, eliminate, start)
        return cls(matrix, eliminated, order, pivots)

    @classmethod
    def blank(cls, shape: tuple[int, ...], lanes: int) -> "DenseFactor":
        """Return placeholder factors of a batch, to start a loop."""
        matrix, column = np.zeros((*shape, lanes)), np.zeros((shape[0], lanes))
        return cls(matrix, matrix, column.astype(np.int32), column)

    def refining(self, matrix: Matrices) -> "DenseFactor":
        """Return these factors for nearby matrices, whose solutions they find by refinement."""
        return DenseFactor(matrix, self.eliminated, self.order, self.pivots)

    def renewed(self) -> "DenseFactor":
        """Return new factors of the present matrices."""
        return self.of(self.matrix)

    def defect(self) -> Float[Numbers, " batch"]:
        """Return the relative error of unrefined solutions, measured on one known solution, shape (batch,).

        Refined solutions have the square of this error. It is NaN where a matrix is singular.
        """
        solution = np.where(np.arange(len(self.order)) % 3 == 1, -1.0, 1.0)
        right = jnp.sum(self.matrix * solution[None, :, None], axis=1)
        return jnp.max(jnp.abs(self.solve(right, refined=False) - solution[:, None]), axis=0)

    def solve(self, right: Columns, *, refined: bool = True) -> Columns:
        """Return the solutions for right-hand sides of shape (rows, batch); NaN where a matrix is singular.

        A correction that is followed by another one need not be refined.
        """

        def product(right: Any) -> Any:
            columns = _rows(right, self.order)
            return _rows(jnp.sum(self.eliminated * columns[None], axis=1), self.order)

        solution = product(right)
        if not refined:
            return solution * self._regular()
        residual = right - jnp.sum(self.matrix * solution[None], axis=1)
        return (solution + product(residual)) * self._regular()

    def solve_transposed(self, right: Columns) -> Columns:
        """Return the solutions of the transposed systems, for right-hand sides of shape (rows, batch)."""
        rank = self._rank()

        def product(right: Any) -> Any:
            rows = _rows(right, rank)
            return _rows(jnp.sum(self.eliminated * rows[:, None], axis=0), rank)

        solution = product(right)
        residual = right - jnp.sum(self.matrix * solution[:, None], axis=0)
        return (solution + product(residual)) * self._regular()

    def inverse(self) -> Matrices:
        """Return the inverse matrices, shape (rows, rows, batch), for many successive right-hand sides."""
        rows = _rows(self.eliminated, self.order[:, None])
        return jnp.take_along_axis(rows, self._rank()[None], axis=1, mode="promise_in_bounds") * self._regular()[None]

    def applied_inverse(self, matrix: Float[Numbers, "row column"]) -> Float[Numbers, "row column"]:
        """Return the products of the inverse of the first matrix with the columns of another, shape (rows, columns)."""
        first = DenseFactor(self.matrix[..., :1], self.eliminated[..., :1], self.order[..., :1], self.pivots[..., :1])
        return first.inverse()[..., 0] @ matrix

    def pivot_ratio(self) -> Float[Numbers, " batch"]:
        """Return the ratio of smallest to largest pivot, shape (batch,): near zero at a singular position."""
        sizes = jnp.abs(self.pivots)
        return jnp.min(sizes, axis=0) / jnp.max(sizes, axis=0)

    def sign(self) -> Float[Numbers, " batch"]:
        """Return the signs of the determinants, shape (batch,): 0 where singular, NaN where not finite."""
        size = len(self.order)
        upper = np.triu(np.ones((size, size), bool), 1)[..., None]
        swaps = upper & (self.order[:, None] > self.order[None])
        is_odd = jnp.sum(swaps, axis=(0, 1)) % 2 == 1
        return jnp.prod(jnp.sign(self.pivots), axis=0) * jnp.where(is_odd, -1.0, 1.0)

    def _rank(self) -> Int[Numbers, "row batch"]:
        """Return the index of the pivot in each row; `argsort` would call an XLA library."""
        positions = np.arange(len(self.order), dtype=np.int32)
        matches = self.order[None] == positions[:, None, None]
        return jnp.sum(jnp.where(matches, positions[None, :, None], 0), axis=1)

    def _regular(self) -> Float[Numbers, "1 batch"]:
        return jnp.where(jnp.all(self.pivots != 0, axis=0, keepdims=True), 1.0, jnp.nan)


def _rows(matrix: Any, rows: Any) -> Any:
    """Return rows by index; no index may be out of bounds."""
    return jnp.take_along_axis(matrix, rows, axis=0, mode="promise_in_bounds")


def _largest(sizes: Columns, rows: Int[Numbers, "row 1"]) -> Int[Numbers, "1 batch"]:
    """Return the row of the largest entry in each lane, the first among equals, shape (1, batch); NaN is the largest.

    XLA's argmax goes entry by entry; two reductions process all lanes at once.
    """
    sizes = jnp.where(jnp.isnan(sizes), jnp.inf, sizes)
    return jnp.min(jnp.where(sizes == jnp.max(sizes, axis=0, keepdims=True), rows, len(rows)), axis=0, keepdims=True)


SWEEPS = 10  # a third is enough for robot tasks, as convergence is quadratic


def singular_values(
    matrix: Float[Numbers, "row column batch"],
) -> tuple[Float[Numbers, "row k batch"], Float[Numbers, "k batch"], Float[Numbers, "column k batch"]]:
    """Return the singular value decomposition of a batch of small matrices, the batch last, without LAPACK.

    One-sided Jacobi rotations orthogonalize the rows pair by pair (Demmel and Veselic 1992, Jacobi's method is more
    accurate than QR).

    Parameters
    ----------
    matrix : array of shape (rows, columns, batch)
        Matrices to be decomposed as ``sum_k u[:, k] s[k] v[:, k]^T``.

    Returns
    -------
    u, s, v : arrays of shape (rows, k, batch), (k, batch) and (columns, k, batch)
        k is the lesser of rows and columns. Singular values are in descending order; v is zero for zero ones.
    """
    rows, columns, lanes = matrix.shape
    if rows > columns:
        v, s, u = singular_values(jnp.swapaxes(matrix, 0, 1))
        return u, s, v
    first, second = (jnp.asarray(indices) for indices in np.triu_indices(rows, 1))

    def rotate(k: Any, carry: Any) -> Any:
        p, q = (pairs[k % len(pairs)] for pairs in (first, second))
        take, put = jax.lax.dynamic_index_in_dim, jax.lax.dynamic_update_index_in_dim
        a, b = (take(carry[0], index, 0, False) for index in (p, q))
        product, excess = 2 * jnp.sum(a * b, axis=0), jnp.sum(b * b - a * a, axis=0)
        root = jnp.abs(excess) + jnp.hypot(excess, product)
        tangent = jnp.where(excess < 0, -1.0, 1.0) * product / jnp.where(root == 0, 1.0, root)
        cosine = 1 / jnp.hypot(1.0, tangent)

        def turned(part: Any) -> Any:
            a, b = (take(part, index, 0, False) for index in (p, q))
            c, s = cosine[None], (cosine * tangent)[None]
            return put(put(part, c * a - s * b, p, 0), s * a + c * b, q, 0)

        return tuple(turned(part) for part in carry)

    unit = jnp.broadcast_to(np.eye(rows)[..., None], (rows, rows, lanes))
    start = (matrix, unit)
    orthogonal, turns = jax.lax.fori_loop(0, SWEEPS * len(first), rotate, start) if rows > 1 else start
    sizes = jnp.sqrt(jnp.sum(orthogonal**2, axis=1))
    order = jnp.argsort(-sizes, axis=0)
    s = jnp.take_along_axis(sizes, order, axis=0)
    v = jnp.take_along_axis(orthogonal, order[:, None], axis=0) / jnp.where(s == 0, 1.0, s)[:, None]
    return jnp.swapaxes(jnp.take_along_axis(turns, order[:, None], axis=0), 0, 1), s, jnp.swapaxes(v, 0, 1)
