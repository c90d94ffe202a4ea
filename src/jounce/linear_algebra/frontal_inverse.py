"""Inverses of large sparse matrices, as one product with a small matrix per front and direction.

`FrontalFactor.solve` applies reflections one after another. If right-hand sides come one by one, as with the orders of
a Taylor series, the map of each front is assembled once instead. Time and memory grow with the number of fronts, while
those of a dense inverse grow with its square.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jounce.base.modules import Module
from jounce.base.shapes import Numbers
from jounce.jet.coefficients import total
from jounce.linear_algebra.frontal import FrontalFactor
from jounce.linear_algebra.fronts import Fronts
from jounce.linear_algebra.linear import Columns


class InversePlan(Module):
    """Index arrays of the fronts for products with the inverse.

    Attributes
    ----------
    fronts : Fronts
        Fronts of square matrices.
    sources : array of int, shape (fronts, rows)
        Index of each row of a front in the concatenation of the right-hand sides, a zero, and the rows left over by all
        fronts.
    responses : array of int, shape (fronts, columns, left rows)
        For the columns of neighbors and the left-over rows of a front: index of the response of the column among the
        entries of all blocks of the inverse, by front, column and row; one beyond the last if there is none.
    diagonal : array of int, shape (rows of the matrix,)
        Index, among these entries, of each diagonal entry of the inverse.
    """

    fronts: Fronts
    sources: Int[Numbers, "front row"]
    responses: Int[Numbers, "front column left"]
    diagonal: Int[Numbers, " size"]

    @classmethod
    def of(cls, fronts: Fronts) -> "InversePlan":
        """Plan products from fronts with NumPy arrays; row and column of equal number belong together."""
        (count, height, columns), width, size = fronts.shape, fronts.width, fronts.row_count
        left_height, unused = height - width, count * height * columns
        inherited = fronts.left_rows < count * left_height
        sources = np.where(inherited, size + 1 + fronts.left_rows, fronts.rights).astype(np.int32)
        bodies = np.concatenate([np.arange(count)[:, None], fronts.neighbors], axis=1)  # bodies of each block
        responses = np.full((count, columns - width, left_height), unused, np.int32)
        for front, line in np.argwhere(inherited).tolist():
            child, row = divmod(int(fronts.left_rows[front, line]), left_height)
            for slot, body in enumerate(fronts.neighbors[child].tolist()):
                if body < count:
                    column = int(np.flatnonzero(bodies[front] == body)[0]) * width + np.arange(width)
                    responses[child, slot * width : (slot + 1) * width, row] = (
                        front * columns + column
                    ) * height + line
        diagonal = np.full(size, unused, np.int32)
        for front, line in np.argwhere(fronts.rights < size).tolist():
            row = int(fronts.rights[front, line])
            body, offset = divmod(row, width)
            column = int(np.flatnonzero(bodies[front] == fronts.of_body[body])[0]) * width + offset
            diagonal[row] = (front * columns + column) * height + line
        return cls(fronts, sources, responses, diagonal)


class FrontalInverse(Module):
    """The inverses of a batch of square matrices.

    Attributes
    ----------
    plan : InversePlan
        Plan of their pattern.
    inward : array of shape (fronts, rows, rows, batch)
        Contribution of a right-hand side to the columns of the front, followed by that to the left-over rows.
    outward : array of shape (fronts, columns of neighbors, width, batch)
        Coefficients by which unknowns of neighbors are subtracted from the columns of the front.
    """

    plan: InversePlan
    inward: Float[Numbers, "front row row batch"]
    outward: Float[Numbers, "front column width batch"]

    @classmethod
    def of(cls, plan: InversePlan, factor: FrontalFactor) -> "FrontalInverse":
        """Assemble the maps of factored matrices, all fronts side by side."""
        (count, height, _), width = plan.fronts.shape, plan.fronts.width
        lanes = factor.inverted.shape[-1]
        rotation = jnp.broadcast_to(np.eye(height)[None, :, :, None], (count, height, height, lanes))
        for i in range(width):
            vector = factor.vectors[:, i, :, None]
            products = jnp.sum(vector * rotation, axis=1, keepdims=True)
            rotation = jax.lax.optimization_barrier(rotation - vector * (factor.factors[:, i, None, None] * products))
        right = jnp.concatenate([rotation[:, :width], factor.triangle[:, :, width:]], axis=2)
        rows: list[Any] = [None] * width
        for i in reversed(range(width)):
            row = right[:, i]
            for j in range(i + 1, width):
                row = row - factor.triangle[:, i, j, None] * rows[j]
            rows[i] = jax.lax.optimization_barrier(row * factor.inverted[:, i, None])
        inverse = jnp.stack(rows, axis=2)
        inward = jnp.concatenate([inverse[:, :height], jnp.swapaxes(rotation[:, width:], 1, 2)], axis=2)
        return cls(plan, inward, inverse[:, height:])

    def solve(self, right: Columns) -> Float[Numbers, "column batch"]:
        """Return the solutions, shape (columns, batch), for right-hand sides of shape (rows, batch)."""
        plan, width, lanes = self.plan, self.plan.fronts.width, right.shape[-1]
        (count, height, _), numbers = plan.fronts.shape, np.arange(plan.fronts.shape[0])
        size, left = len(right), height - width

        def inwards(values: Any, level: Any) -> tuple[Any, Any]:
            front, sources, inward = level
            y = values.at[sources].get(mode="promise_in_bounds")
            updates = total(inward[j] * y[j][None] for j in range(height))
            return jax.lax.dynamic_update_slice_in_dim(values, updates[width:], size + 1 + front * left, 0), updates[
                :width
            ]

        values = jnp.concatenate([right, jnp.zeros((1 + count * left, lanes))])
        _, partial = jax.lax.scan(inwards, values, (numbers, plan.sources, self.inward))

        def outwards(values: Any, level: Any) -> tuple[Any, None]:
            front, neighbors, outward, block = level
            at_neighbors = values.at[neighbors].get(mode="promise_in_bounds").reshape(-1, lanes)
            block = block - total(outward[j] * at_neighbors[j][None] for j in range(len(outward)))
            return jax.lax.dynamic_update_index_in_dim(values, block, front, 0), None

        values = jnp.zeros((count + 1, width, lanes))
        levels = (numbers, plan.fronts.neighbors, self.outward, partial)
        values, _ = jax.lax.scan(outwards, values, levels, reverse=True)
        return values[plan.fronts.of_body].reshape(-1, lanes)

    def diagonal(self) -> Float[Numbers, "row batch"]:
        """Return the diagonals of the inverses, computed from the blocks of the fronts only."""
        plan, width, lanes = self.plan, self.plan.fronts.width, self.inward.shape[-1]
        count, height, columns = plan.fronts.shape
        size = height * columns

        def step(blocks: Any, level: Any) -> tuple[Any, None]:
            front, responses, inward, outward = level
            at_neighbors = blocks.at[responses].get(mode="promise_in_bounds")  # responses to left-over rows
            given = inward[:, width:]
            coupled = total(at_neighbors[:, k, None] * given[None, :, k] for k in range(height - width))
            square = jnp.swapaxes(inward[:, :width], 0, 1)
            square = square - total(outward[j][:, None] * coupled[j][None] for j in range(columns - width))
            block = jnp.concatenate([square, coupled]).reshape(size, lanes)
            return jax.lax.dynamic_update_slice_in_dim(blocks, block, front * size, 0), None

        levels = (np.arange(count), plan.responses, self.inward, self.outward)
        blocks, _ = jax.lax.scan(step, jnp.zeros((count * size + 1, lanes)), levels, reverse=True)
        return blocks[plan.diagonal]
