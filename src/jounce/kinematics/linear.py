"""The linear solvers, behind one small interface: factor once, solve often, also with the transpose."""

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


class InverseFactor(eqx.Module):
    """Inverses of a batch of small dense matrices by Gauss-Jordan elimination with partial pivoting, the batch last.

    Each operation is one on the whole batch, and none is LAPACK's: programs with these may run in several threads. JAX
    0.10 shares the batches of LAPACK among XLA's threads and waits for them in such a thread: two programs, two cores,
    and both wait forever.
    """

    matrix: Any

    @classmethod
    def of(cls, matrix: Any) -> "InverseFactor":
        """Invert matrices of shape (rows, rows, batch)."""
        size, lanes = matrix.shape[0], matrix.shape[-1]
        rows = jnp.arange(size)[:, None]
        at, put = jax.lax.dynamic_index_in_dim, jax.lax.dynamic_update_index_in_dim

        def eliminate(k: Any, carry: Any) -> Any:
            matrix, order = carry
            column, top = at(matrix, k, 1, False), at(matrix, k, 0, False)
            largest = jnp.argmax(jnp.where(rows >= k, jnp.abs(column), -1.0), axis=0)[None]
            best = jnp.take_along_axis(matrix, largest[None], axis=0)[0]
            swapped, here = rows == largest, rows == k
            # column k makes room for that of the identity
            row = jnp.where(here, 1.0, best) / at(best, k, 0)
            others = jnp.where(here[None], 0.0, jnp.where(swapped[:, None], top[None], matrix))
            others = others - jnp.where(swapped, at(column, k, 0), column)[:, None] * row[None]
            chosen = jnp.take_along_axis(order, largest, axis=0)[0]
            order = put(jnp.where(swapped, at(order, k, 0), order), chosen, k, 0)
            return put(others, row, k, 0), order

        start = (matrix, jnp.broadcast_to(rows, (size, lanes)))
        inverse, order = jax.lax.fori_loop(0, size, eliminate, start)
        return cls(jnp.take_along_axis(inverse, jnp.argsort(order, axis=0)[None], axis=1))

    @classmethod
    def blank(cls, shape: tuple[int, ...], lanes: int) -> "InverseFactor":
        """Return a placeholder for the inverses of a batch, to start a loop with."""
        return cls(jnp.zeros((*shape, lanes)))

    def solve(self, right: Any) -> Any:
        """Return the solution for right-hand sides of shape (rows, batch)."""
        return jnp.sum(self.matrix * right[None], axis=1)

    def inverse(self) -> Any:
        """Return the inverse matrices, shape (rows, rows, batch)."""
        return self.matrix


def factor_type(lanes: int) -> type[DenseFactor] | type[InverseFactor]:
    """Return the solver for programs on a batch that may run in several threads: LAPACK is the quicker for one."""
    return DenseFactor if lanes == 1 else InverseFactor
