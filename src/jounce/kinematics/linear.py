"""The linear solver, behind one small interface: factor once, solve often, also with the transpose."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp


class DenseFactor(eqx.Module):
    """LU factors with partial pivoting of a batch of small dense matrices.

    Right-hand sides and solutions have the batch last, shape (rows, batch); the matrices have it first, for LAPACK.
    """

    lu: Any
    permutation: Any

    @classmethod
    def of(cls, matrix: Any) -> "DenseFactor":
        """Factor matrices of shape (rows, rows, batch)."""
        lu, _, permutation = jax.lax.linalg.lu(jnp.moveaxis(matrix, -1, 0))
        return cls(lu, permutation)

    @classmethod
    def blank(cls, shape: tuple[int, ...], lanes: int) -> "DenseFactor":
        """Return a placeholder for the factors of a batch, to start a loop with."""
        return cls(jnp.zeros((lanes, *shape)), jnp.zeros((lanes, shape[0]), jnp.int32))

    def solve(self, right: Any) -> Any:
        """Return the solution for right-hand sides of shape (rows, batch)."""
        b = jnp.take_along_axis(right.T, self.permutation, axis=1)[..., None]
        y = jax.lax.linalg.triangular_solve(self.lu, b, left_side=True, lower=True, unit_diagonal=True)
        return jax.lax.linalg.triangular_solve(self.lu, y, left_side=True, lower=False)[..., 0].T

    def solve_transposed(self, right: Any) -> Any:
        """Return the solution with the transposed matrices, for right-hand sides of shape (rows, batch)."""
        solve = jax.lax.linalg.triangular_solve
        y = solve(self.lu, right.T[..., None], left_side=True, lower=False, transpose_a=True)
        y = solve(self.lu, y, left_side=True, lower=True, transpose_a=True, unit_diagonal=True)[..., 0]
        inverse = jnp.argsort(self.permutation, axis=1)
        return jnp.take_along_axis(y, inverse, axis=1).T

    def inverse(self) -> Any:
        """Return the inverse matrices, shape (rows, rows, batch), for many right-hand sides that come one by one.

        A product with it is one operation on the whole batch, where LAPACK is called for each matrix.
        """
        size = self.lu.shape[-1]
        unit = jnp.broadcast_to(jnp.eye(size)[:, :, None], (size, size, self.lu.shape[0]))
        columns = jnp.take_along_axis(jnp.moveaxis(unit, -1, 0), self.permutation[:, :, None], axis=1)
        y = jax.lax.linalg.triangular_solve(self.lu, columns, left_side=True, lower=True, unit_diagonal=True)
        return jnp.moveaxis(jax.lax.linalg.triangular_solve(self.lu, y, left_side=True, lower=False), 0, -1)

    def pivot_ratio(self) -> Any:
        """Return the smallest pivot over the largest, shape (batch,): near zero at a singular position."""
        pivots = jnp.abs(jnp.diagonal(self.lu, axis1=-2, axis2=-1))
        return jnp.min(pivots, axis=-1) / jnp.max(pivots, axis=-1)
