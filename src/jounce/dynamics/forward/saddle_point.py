"""The saddle-point matrix of constrained motion, ``[[M, Phi_q^T], [Phi_q, 0]]``, with columns ordered by body.

The coordinates of a body are shifts, then rotations; the ground has none.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import Module
from jounce.base.shapes import Numbers
from jounce.jet.algebra import total
from jounce.linear_algebra.linear import DenseFactor

ByBody = Float[Numbers, "coordinate body batch"]
"""One number for each coordinate of each body."""

BodyMatrices = Float[Numbers, "coordinate coordinate body batch"]
MassMatrix = Float[Numbers, "column column #batch"]
Jacobian = Float[Numbers, "row column batch"]
Column = Float[Numbers, "column batch"]


def saddle_point(mass: MassMatrix, jacobian: Jacobian) -> Float[Numbers, "size size batch"]:
    """Return the mass matrix bordered by the Jacobian and its transpose."""
    rows, columns, lanes = jacobian.shape
    mass = jnp.broadcast_to(mass, (columns, columns, lanes))
    upper = jnp.concatenate([mass, jnp.swapaxes(jacobian, 0, 1)], axis=1)
    lower = jnp.concatenate([jacobian, jnp.zeros((rows, rows, lanes))], axis=1)
    return jnp.concatenate([upper, lower])


def even_scale(matrix: Float[np.ndarray, "size size"], columns: int) -> Float[np.ndarray, " size"]:
    """Return the scales of rows and columns of a saddle-point matrix for a test of its rank.

    Each coordinate is scaled by its own mass or moment of inertia, and each row of the Jacobian by its norm in scaled
    coordinates, so that a small mass among large ones does not count as zero.
    """
    mass = np.abs(np.diag(matrix))[:columns]
    scale = np.ones(len(matrix))
    scale[:columns] = 1 / np.sqrt(np.where(mass > 0, mass, 1.0))
    rows = np.linalg.norm(matrix[columns:, :columns] * scale[:columns], axis=1)
    scale[columns:] = 1 / np.where(rows > 0, rows, 1.0)
    return scale


def block_diagonal(blocks: BodyMatrices, scale: Float[Numbers, " coordinate"]) -> MassMatrix:
    """Return the mass matrix of all bodies, rows and columns scaled, from those of each body."""
    size, _, bodies, lanes = blocks.shape
    blocks = blocks * (scale[:, None] * scale[None])[:, :, None, None]
    matrix = jnp.eye(bodies)[:, None, :, None, None] * jnp.moveaxis(blocks, 2, 0)[:, :, None]
    return matrix.reshape(bodies * size, bodies * size, lanes)


def as_column(forces: ByBody, scale: Float[Numbers, " coordinate"]) -> Column:
    """Return generalized forces on the bodies as a scaled column."""
    return jnp.swapaxes(forces * scale[:, None, None], 0, 1).reshape(-1, forces.shape[-1])


def by_body(column: Column, scale: Float[Numbers, " coordinate"]) -> ByBody:
    """Return the coordinates of each body from a scaled column."""
    return jnp.swapaxes(column.reshape(-1, len(scale), column.shape[-1]), 0, 1) * scale[:, None, None]


class ReducedFactor(Module):
    """The factors of saddle-point matrices with redundant rows, reduced to independent combinations of the rows.

    Right-hand sides and solutions have all rows. The multipliers, which are not unique, are those of least norm.
    """

    factor: DenseFactor
    basis: Float[Numbers, "row rank batch"]  # orthonormal, of the range of the Jacobian

    @classmethod
    def of(cls, mass: MassMatrix, jacobian: Jacobian, basis: Float[Numbers, "row rank batch"]) -> "ReducedFactor":
        """Return the factors for a mass matrix, a Jacobian, and an orthonormal basis of the range of the Jacobian."""
        return cls(DenseFactor.of(saddle_point(mass, in_basis(basis, jacobian))), basis)

    @classmethod
    def blank(cls, shape: tuple[int, int], rank: int, lanes: int) -> "ReducedFactor":
        """Return a placeholder for the factors of a batch, as the initial value of a loop."""
        rows, columns = shape
        size = columns + rank
        return cls(DenseFactor.blank((size, size), lanes), np.zeros((rows, rank, lanes)))

    def solve(self, right: Float[Numbers, "size batch"]) -> Float[Numbers, "size batch"]:
        """Return the solutions for right-hand sides of all coordinates and rows."""
        columns = len(right) - len(self.basis)
        row_values = jnp.sum(self.basis * right[columns:][:, None], axis=0)
        solution = self.factor.solve(jnp.concatenate([right[:columns], row_values]))
        return jnp.concatenate([solution[:columns], jnp.sum(self.basis * solution[columns:][None], axis=1)])

    def inverse(self) -> Float[Numbers, "size size batch"]:
        """Return the matrix from right-hand sides of all coordinates and rows to solutions."""
        inverse, (_, rank, _) = self.factor.inverse(), self.basis.shape
        columns = len(inverse) - rank
        rows = jnp.sum(self.basis[:, :, None] * inverse[columns:][None], axis=1)
        wide = jnp.concatenate([inverse[:columns], rows])
        right = jnp.sum(self.basis[None] * wide[:, None, columns:], axis=2)
        return jnp.concatenate([wide[:, :columns], right], axis=1)


class DenseInverse(Module):
    """The dense inverses of a batch of saddle-point matrices."""

    matrix: Float[Numbers, "size size batch"]

    def solve(self, right: Float[Numbers, "size batch"]) -> Float[Numbers, "size batch"]:
        """Return the solutions for right-hand sides of all coordinates and rows."""
        return multiplied(self.matrix, right)

    def responses(self, columns: int) -> tuple[Float[Numbers, "column batch"], Float[Numbers, " batch"]]:
        """Return the largest response to a force on each coordinate, and to a gap of the rows."""
        forces = jnp.max(jnp.abs(self.matrix[:columns, :columns]), axis=0)
        return forces, jnp.max(jnp.abs(self.matrix[columns:, columns:]), axis=(0, 1), initial=0.0)


def in_basis(basis: Float[Numbers, "row rank batch"], jacobian: Jacobian) -> Float[Numbers, "rank column batch"]:
    """Return the rows of a Jacobian combined by the vectors of a basis."""
    return jnp.sum(basis[:, :, None] * jacobian[:, None], axis=0)


def multiplied(
    matrix: Float[Numbers, "row size batch"], column: Float[Numbers, "size batch"]
) -> Float[Numbers, "row batch"]:
    """Return the product of matrices and columns, by a loop over the size.

    The arguments of a loop are evaluated before it starts. Without the loop, XLA would fuse the computation of the
    column into every row and repeat it.
    """
    rows, size, lanes = matrix.shape
    block = min(8, (size + 1) // 2)
    count = -(-size // block)
    matrix = jnp.pad(matrix, ((0, 0), (0, count * block - size), (0, 0)))
    column = jnp.pad(column, ((0, count * block - size), (0, 0)))

    def with_block(i: Any, product: Any) -> Any:
        a = jax.lax.dynamic_slice_in_dim(matrix, i * block, block, 1)
        b = jax.lax.dynamic_slice_in_dim(column, i * block, block)
        return product + total(a[:, j] * b[j][None] for j in range(block))

    return jax.lax.fori_loop(0, count, with_block, jnp.zeros((rows, lanes)))
