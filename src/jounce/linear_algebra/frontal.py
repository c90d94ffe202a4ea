"""Multifrontal QR factorization of large sparse matrices, a batch side by side; the batch is the last axis."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import Module
from jounce.base.shapes import Numbers
from jounce.linear_algebra.fronts import Fronts
from jounce.linear_algebra.linear import Columns
from jounce.linear_algebra.reflections import reflection


class FrontalFactor(Module):
    """A batch of matrices, factored front by front into Householder reflections and triangles.

    Reflections preserve lengths, so that solutions need no refinement. If there are more rows than columns, they are
    least-squares solutions.
    """

    fronts: Fronts
    vectors: Float[Numbers, "front width row batch"]  # reflection vectors of each front
    factors: Float[Numbers, "front width batch"]  # two over the squared lengths of the vectors
    triangle: Float[Numbers, "front width column batch"]  # finished rows
    inverted: Float[Numbers, "front width batch"]  # inverse diagonal, infinite where singular

    @classmethod
    def of(
        cls, fronts: Fronts, entries: Float[Numbers, "entry batch"], scale: Float[Numbers, "row 1"]
    ) -> "FrontalFactor":
        """Factor matrices with given entries, (entries, batch), rows multiplied by a scale, (rows, 1)."""
        count, height, columns = fronts.shape
        width, lanes = fronts.width, entries.shape[-1]
        entries = jnp.concatenate([entries, jnp.zeros((1, lanes))])
        scale = jnp.concatenate([scale, jnp.zeros((1, 1))])

        def step(left: Any, plan: Any) -> Any:
            front, indices, rights, rows, taken = plan
            previous = left.reshape(count * (height - width), columns - width, lanes)
            inherited = previous.at[rows[:, None], taken].get(mode="fill", fill_value=0.0)
            *factors, remainder = _eliminated(entries[indices] * scale[rights][:, :, None] + inherited, width)
            return _put(left, remainder, front), tuple(factors)

        left = jnp.zeros((count, height - width, columns - width, lanes))
        plans = (np.arange(count), fronts.entries, fronts.rights, fronts.left_rows, fronts.left_columns)
        return cls(fronts, *jax.lax.scan(step, left, plans)[1])

    @classmethod
    def blank(cls, fronts: Fronts, lanes: int) -> "FrontalFactor":
        """Return placeholder factors of a batch, to start a loop."""
        (count, height, columns), width = fronts.shape, fronts.width
        sizes = ((count, width, height, lanes), (count, width, lanes), (count, width, columns, lanes))
        return cls(fronts, *map(np.zeros, (*sizes, sizes[1])))

    @property
    def arrays(self) -> tuple[Numbers, Numbers, Numbers, Numbers]:
        """Reflections, their factors, triangle and inverse diagonal; the batch is the last axis of each."""
        return self.vectors, self.factors, self.triangle, self.inverted

    def solve(self, right: Columns, *, refined: bool = True) -> Float[Numbers, "column batch"]:
        """Return the solutions, shape (columns, batch), for right-hand sides of shape (rows, batch)."""
        del refined  # refinement would not improve them
        _, height, columns = self.fronts.shape
        width, lanes, plan = self.fronts.width, right.shape[-1], self.fronts
        right = jnp.concatenate([right, jnp.zeros((1, lanes))])

        def forward(left: Any, level: Any) -> Any:
            front, indices, rows, vectors, factors = level
            y = right[indices] + left.reshape(-1, lanes).at[rows].get(mode="fill", fill_value=0.0)
            y = _reflected(y, zip(vectors, factors, strict=True))
            return _put(left, y[width:], front), y[:width]

        def backward(solution: Any, level: Any) -> Any:
            front, neighbors, triangle, inverted, y = level
            y = y - jnp.sum(triangle[:, width:] * solution[neighbors].reshape(1, columns - width, lanes), axis=1)
            x: list[Any] = [None] * width
            for i in reversed(range(width)):
                x[i] = (y[i] - sum(triangle[i, j] * x[j] for j in range(i + 1, width))) * inverted[i]
            return _put(solution, jnp.stack(x), front), None

        count = np.arange(len(plan.entries))
        left = jnp.zeros((len(count), height - width, lanes))
        _, y = jax.lax.scan(forward, left, (count, plan.rights, plan.left_rows, self.vectors, self.factors))
        solution = jnp.zeros((len(count) + 1, width, lanes))
        levels = (count, plan.neighbors, self.triangle, self.inverted, y)
        solution, _ = jax.lax.scan(backward, solution, levels, reverse=True)
        return solution[plan.of_body].reshape(-1, lanes)

    def solve_transposed(self, right: Float[Numbers, "column batch"]) -> Columns:
        """Return the solutions of the transposed systems, shape (rows, batch), of least norm if underdetermined."""
        height, width = self.fronts.shape[1], self.fronts.width
        lanes, plan = right.shape[-1], self.fronts
        count = np.arange(len(plan.entries))
        blocks = jnp.asarray(right).reshape(len(count), width, lanes)
        order = jnp.zeros_like(plan.of_body).at[plan.of_body].set(count.astype(np.int32))  # body of each front

        def forward(contributions: Any, level: Any) -> Any:
            front, neighbors, body, triangle, inverted = level
            w = blocks[body] - contributions[front]
            u: list[Any] = []
            for i in range(width):
                u.append((w[i] - sum(triangle[j, i] * u[j] for j in range(i))) * inverted[i])
            solved = jnp.stack(u)
            update = jnp.sum(triangle[:, width:] * solved[:, None], axis=0).reshape(-1, width, lanes)
            return contributions.at[neighbors].add(update, mode="drop"), solved

        contributions = jnp.zeros((len(count), width, lanes))
        _, u = jax.lax.scan(forward, contributions, (count, plan.neighbors, order, self.triangle, self.inverted))

        def backward(carry: Any, level: Any) -> Any:
            left, solution = carry
            front, indices, rows, vectors, factors, top = level
            y = jnp.concatenate([top, left[front]])
            y = _reflected(y, zip(vectors[::-1], factors[::-1], strict=True))
            flat = left.reshape(-1, lanes).at[rows].set(y, mode="drop")
            return (flat.reshape(left.shape), solution.at[indices].set(y, mode="drop")), None

        blank = jnp.zeros((len(count), height - width, lanes)), jnp.zeros((plan.row_count, lanes))
        levels = (count, plan.rights, plan.left_rows, self.vectors, self.factors, u)
        return jax.lax.scan(backward, blank, levels, reverse=True)[0][1]

    def applied_inverse(self, matrix: Float[Numbers, "row k"]) -> Float[Numbers, "column k"]:
        """Return the products of the inverse of the first matrix with the columns of another, shape (columns, k)."""
        return FrontalFactor(self.fronts, *(x[..., :1] for x in self.arrays)).solve(matrix)

    def pivot_ratio(self) -> Float[Numbers, " batch"]:
        """Return the ratio of smallest to largest pivot, shape (batch,): near zero at a singular position."""
        sizes = 1 / jnp.abs(self.inverted.reshape(-1, self.inverted.shape[-1]))
        return jnp.min(sizes, axis=0) / jnp.max(sizes, axis=0)

    def sign(self) -> Float[Numbers, " batch"]:
        """Return the signs of the determinants up to a common sign, shape (batch,): 0 where singular.

        The common sign is that of the order of rows and columns, which all matrices of a pattern share.
        """
        return jnp.prod(jnp.sign(jnp.where(jnp.isinf(self.inverted), 0.0, self.inverted)), axis=(0, 1))


def _put(array: Any, part: Any, index: Any) -> Any:
    return jax.lax.dynamic_update_index_in_dim(array, part, index, 0)


def _reflected(y: Any, reflections: Any) -> Any:
    for vector, factor in reflections:
        y = y - vector * (factor[None] * jnp.sum(vector * y, axis=0, keepdims=True))
        y = jax.lax.optimization_barrier(y)  # otherwise XLA recomputes the chain for each use
    return y


def _eliminated(front: Any, width: int) -> tuple[Any, Any, Any, Any, Any]:
    """Return the reflections that clear the first columns, the finished rows, and the remaining front.

    The first four are vectors, factors, triangle and inverted, as in `FrontalFactor`.
    """
    vectors, factors, rows, inverted = [], [], [], []
    for k in range(width):
        vector, pivot, factor = reflection(front[:, 0])
        products = jnp.sum(vector[:, None] * front[:, 1:], axis=0, keepdims=True)
        remainder = front[:, 1:] - vector[:, None] * (factor[None, None] * products)
        padding = jnp.zeros((k, *pivot.shape))
        vectors.append(jnp.concatenate([padding, vector]))
        factors.append(factor)
        rows.append(jnp.concatenate([padding, pivot[None], remainder[0]]))
        inverted.append(1.0 / pivot)
        front = jax.lax.optimization_barrier(remainder[1:])
    return jnp.stack(vectors), jnp.stack(factors), jnp.stack(rows), jnp.stack(inverted), front
