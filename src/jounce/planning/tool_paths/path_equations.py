"""Equations that determine joint coordinates along a path: the task, held joints, and the nearest posture."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.modules import Module, field
from jounce.base.shapes import Numbers
from jounce.linear_algebra.linear import DenseFactor
from jounce.planning.tool_paths.tool_tasks import Tool, columns_of, task_rows
from jounce.robot.model.tree import Tree

MOST = 12  # corrections
CLOSE = 1e-7  # rad, or sizes of the robot: after a correction this small, the next leaves only rounding

Unknowns = Float[Numbers, "order unknown batch"]
"""Series of the scaled coordinates, then of the multipliers of the task if a posture is given."""


class PathEquations(Module):
    """The equations of the coordinates along a path.

    With fewer rows than joints, the coordinates that fulfill the task are those nearest to a posture: Lagrange
    multipliers of the rows, as further unknowns, balance the gradient of the squared distance. The coordinates
    therefore depend only on the instant, not on the path before it, and have all derivatives of the path.

    Attributes
    ----------
    tree : Tree
        Arrays of the robot.
    tool : Tool
        The tool that follows the path.
    basis : array of shape (rows, independent)
        Basis of the rows that the joints can move, including those of held joints.
    scale, weights : array of shape (n,)
        Scale of each coordinate, and weight of its distance from the posture.
    fixed_joints : tuple of int
        Held joints, which have laws of their own.
    kinds : tuple of str
        Kinds of the goals.
    count : int
        Number of coordinates.
    """

    tree: Tree
    tool: Tool
    basis: Any
    scale: Any
    weights: Any
    fixed_joints: tuple[int, ...] = field(static=True)
    kinds: tuple[str, ...] = field(static=True)
    count: int = field(static=True)

    @property
    def rows(self) -> int:
        """Number of rows of the task."""
        return self.basis.shape[1]

    @property
    def has_posture(self) -> bool:
        """Whether the posture determines some coordinates."""
        return self.rows < self.count

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.count + (self.rows if self.has_posture else 0)

    def task(self, x: Any, target: dict[str, Any]) -> Any:
        """Return the series of the rows of the task at scaled coordinates."""
        goal = {kind: target[kind] for kind in self.kinds}
        rows = task_rows(self.tree, self.tool, x * jnp.asarray(self.scale)[None, :, None], goal)
        if self.fixed_joints:
            rows = jnp.concatenate([rows, x[:, jnp.asarray(self.fixed_joints)] - target["held"]], axis=1)
        return jnp.sum(jnp.asarray(self.basis)[None, :, :, None] * rows[:, :, None], axis=1)

    def residual(self, u: Unknowns, target: dict[str, Any]) -> Float[Numbers, "order row batch"]:
        """Return the series of the residual, which vanishes along the path."""
        x, multipliers = u[:, : self.count], u[:, self.count :]
        if not self.has_posture:
            return self.task(x, target)
        # coefficients of J^T l are a convolution: the transposed map applied to l in reverse order
        rows, transposed = jax.vjp(lambda x: self.task(x, target), x)
        balance = transposed(multipliers[::-1])[0][::-1]
        pull = jnp.asarray(self.weights)[None, :, None] * (x - target["posture"])
        return jnp.concatenate([rows, pull + balance], axis=1)

    def matrix(self, u: Float[Numbers, "unknown batch"], target: dict[str, Any]) -> Float[Numbers, "row unknown batch"]:
        """Return the Jacobian of the residual."""
        first = {kind: series[:1] for kind, series in target.items()}
        return columns_of(lambda u: self.residual(u[None], first)[0], u)

    def corrected(self, u: Float[Numbers, "unknown batch"], target: dict[str, Any]) -> "Corrected":
        """Return the unknowns after Newton corrections, in all lanes until the last one has converged.

        The last matrix is evaluated before the last correction, which is so small that it is that of the result.
        """
        first = {kind: series[:1] for kind, series in target.items()}

        def correct(carry: tuple[Corrected, Any, Any]) -> Any:
            x, _, count = carry
            factor = PathFactor.of(self.matrix(x.u, first))
            step = -factor.solve(self.residual(x.u[None], first)[0])
            size = jnp.max(jnp.abs(step), axis=0)
            first_size = jnp.where(count > 0, x.first, size)
            return Corrected(x.u + step, factor, first_size, size), x.last, count + 1

        def is_open(carry: tuple[Corrected, Any, Any]) -> Any:
            return ~(jnp.all(carry[1] <= CLOSE)) & (carry[2] < MOST)

        infinite, rows = jnp.full(u.shape[1:], jnp.inf), self.rows + (self.count if self.has_posture else 0)
        blank = PathFactor(jnp.zeros((rows, *u.shape)), jnp.zeros((len(u), rows, u.shape[1])))
        start = Corrected(u, blank, infinite, infinite), infinite, jnp.zeros((), int)
        return jax.lax.while_loop(is_open, correct, start)[0]

    def series(
        self, u: Float[Numbers, "unknown batch"], factor: "PathFactor", target: dict[str, Any], order: int
    ) -> Unknowns:
        """Return the series of the unknowns, order by order, with one factorization."""

        def level(k: Any, series: Any) -> Any:
            gap = jax.lax.dynamic_index_in_dim(self.residual(series, target), k, 0, keepdims=False)
            return jax.lax.dynamic_update_index_in_dim(series, -factor.solve(gap), k, 0)

        start = jnp.zeros((order + 1, *u.shape)).at[0].set(u)
        return jax.lax.fori_loop(1, order + 1, level, start)


class PathFactor(Module):
    """The factored Jacobian: square, or with more rows than unknowns, consistent where the path can be followed."""

    matrix: Float[Numbers, "row column batch"]
    inverse: Float[Numbers, "column row batch"]

    @classmethod
    def of(cls, matrix: Float[Numbers, "row column batch"]) -> "PathFactor":
        """Return the factors of matrices of full column rank."""
        rows, columns, lanes = matrix.shape
        if rows == columns:
            return cls(matrix, DenseFactor.of(matrix).inverse())
        # least squares by the augmented matrix, which does not square the condition number (Bjorck 1967)
        augmented = jnp.zeros((rows + columns, rows + columns, lanes))
        augmented = augmented.at[:rows, :rows].set(jnp.eye(rows)[..., None])
        augmented = augmented.at[:rows, rows:].set(matrix).at[rows:, :rows].set(jnp.swapaxes(matrix, 0, 1))
        return cls(matrix, DenseFactor.of(augmented).inverse()[rows:, :rows])

    def solve(self, right: Float[Numbers, "row batch"]) -> Float[Numbers, "column batch"]:
        """Return the solution with one step of iterative refinement."""

        def product(right: Any) -> Any:
            return jnp.sum(self.inverse * right[None], axis=1)

        solution = product(right)
        return solution + product(right - jnp.sum(self.matrix * solution[None], axis=1))


class Corrected(NamedTuple):
    """Unknowns after corrections, their factored matrix, and the sizes of the first and the last correction."""

    u: Any
    factor: PathFactor
    first: Any
    last: Any
