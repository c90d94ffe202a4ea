"""Least squares for batches of small matrices with dependent rows, batch last: orthonormal bases and triangles.

Where constraints are redundant but agree, the equations of each order have more rows than unknowns, but a unique
solution by least squares. The multipliers of the rows are not unique; those of least norm are returned.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import Module
from jounce.base.shapes import Numbers
from jounce.linear_algebra.linear import DenseFactor

Basis = Float[Numbers, "row column batch"]
Triangle = Float[Numbers, "column column batch"]


class LeastSquaresFactor(Module):
    """A batch of matrices with independent columns, factored into orthonormal columns and a triangle.

    Columns are orthogonalized one after another, twice, which is enough (Giraud, Langou, Rozloznik and van den Eshof
    2005, Rounding error analysis of the classical Gram-Schmidt orthogonalization process). No operation is LAPACK's, as
    in `DenseFactor`.
    """

    basis: Basis
    triangle: Triangle

    @classmethod
    def of(cls, matrix: Basis) -> "LeastSquaresFactor":
        """Factor matrices of shape (rows, columns, batch), with at least as many rows as columns."""
        _, columns, lanes = matrix.shape
        take, put = jax.lax.dynamic_index_in_dim, jax.lax.dynamic_update_index_in_dim
        rows = np.arange(columns)[:, None]

        def orthogonalize(k: Any, carry: Any) -> Any:
            basis, triangle = carry
            column, coefficients = take(matrix, k, 1, False), jnp.zeros((columns, lanes))
            for _ in range(2):
                part = jnp.sum(basis * column[:, None], axis=0)
                column, coefficients = column - jnp.sum(basis * part[None], axis=1), coefficients + part
            size = jnp.sqrt(jnp.sum(column * column, axis=0))
            basis = put(basis, column / jnp.where(size == 0, 1.0, size)[None], k, 1)
            return basis, put(triangle, jnp.where(rows == k, size[None], coefficients), k, 1)

        blank = cls.blank(matrix.shape, lanes)
        return cls(*jax.lax.fori_loop(0, columns, orthogonalize, (blank.basis, blank.triangle)))

    @classmethod
    def blank(cls, shape: tuple[int, ...], lanes: int) -> "LeastSquaresFactor":
        """Return placeholder factors of a batch, to start a loop."""
        rows, columns = shape[:2]
        return cls(np.zeros((rows, columns, lanes)), np.zeros((columns, columns, lanes)))

    def solve(self, right: Float[Numbers, "row batch"], *, refined: bool = True) -> Float[Numbers, "column batch"]:
        """Return the least-squares solutions, shape (columns, batch); not finite where columns are dependent."""
        del refined  # refinement would not improve them
        return self._substituted(jnp.sum(self.basis * right[:, None], axis=0), 0)

    def solve_transposed(self, right: Float[Numbers, "column batch"]) -> Float[Numbers, "row batch"]:
        """Return the least-norm solutions of the transposed systems, shape (rows, batch)."""
        return jnp.sum(self.basis * self._substituted(right, 1)[None], axis=1)

    def applied_inverse(self, matrix: Float[Numbers, "row k"]) -> Float[Numbers, "column k"]:
        """Return the products of the pseudo-inverse of the first matrix with the columns of another, (columns, k)."""
        first = LeastSquaresFactor(self.basis[..., :1], self.triangle[..., :1])
        repeated = [jnp.broadcast_to(x, (*x.shape[:-1], matrix.shape[1])) for x in (first.basis, first.triangle)]
        return LeastSquaresFactor(*repeated).solve(matrix)

    def pivot_ratio(self) -> Float[Numbers, " batch"]:
        """Return the ratio of smallest to largest pivot, shape (batch,): near zero at a singular position."""
        sizes = jnp.diagonal(self.triangle)
        return jnp.min(sizes, axis=-1) / jnp.max(sizes, axis=-1)

    def orientation(self, before: Any) -> Float[Numbers, " batch"]:
        """Return the orientations of the column spaces relative to those of other factors, as signs, shape (batch,).

        They replace the sign of the determinant, which a matrix with more rows than columns does not have.
        """
        relative = jnp.sum(before.basis[:, :, None] * self.basis[:, None], axis=0)
        return DenseFactor.of(relative).sign()

    def _substituted(self, right: Float[Numbers, "column batch"], axis: int) -> Float[Numbers, "column batch"]:
        """Return the solutions of the triangular systems (`axis` 0), or of the transposed ones (`axis` 1)."""
        take, put, columns = jax.lax.dynamic_index_in_dim, jax.lax.dynamic_update_index_in_dim, len(self.triangle)

        def substitute(i: Any, solved: Any) -> Any:
            k = i if axis else columns - 1 - i
            line = take(self.triangle, k, axis, False)
            remainder = take(right, k, 0, False) - jnp.sum(line * solved, axis=0)
            return put(solved, remainder / take(line, k, 0, False), k, 0)

        return jax.lax.fori_loop(0, columns, substitute, jnp.zeros(right.shape))


def range_basis(matrix: Basis, rank: int) -> Float[Numbers, "row rank batch"]:
    """Return orthonormal bases of the ranges of matrices of known rank, shape (rows, rank, batch).

    The longest remaining column is orthogonalized next.
    """
    put = jax.lax.dynamic_update_index_in_dim
    rows, _, lanes = matrix.shape

    def choose(k: Any, carry: Any) -> Any:
        basis, remainder = carry
        longest = jnp.argmax(jnp.sum(remainder * remainder, axis=0), axis=0)
        column = jnp.take_along_axis(remainder, longest[None, None], axis=1)[:, 0]
        column = column - jnp.sum(basis * jnp.sum(basis * column[:, None], axis=0)[None], axis=1)
        size = jnp.sqrt(jnp.sum(column * column, axis=0))
        column = column / jnp.where(size == 0, 1.0, size)[None]
        remainder = remainder - column[:, None] * jnp.sum(column[:, None] * remainder, axis=0)[None]
        return put(basis, column, k, 1), remainder

    return jax.lax.fori_loop(0, rank, choose, (jnp.zeros((rows, rank, lanes)), matrix))[0]
