"""Equations that make joint coordinates a function of the path: the task, joints held, and the nearest posture."""

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
CLOSE = 1e-7  # of a correction, rad, or sizes of the robot: the next one leaves rounding only

Unknowns = Float[Numbers, "order unknown batch"]
"""Series of the coordinates in their scale, then of the multipliers of the task where a posture is held."""


class PathEquations(Module):
    """The equations of the coordinates along a path.

    With fewer rows than joints, the coordinates are those of the task that are nearest to a posture: multipliers of the
    rows, as many further unknowns, balance the gradient of the squared distance. So they depend only on the instant of
    the path, not on the way there, and have all its derivatives.

    Attributes
    ----------
    tree : Tree
        Of the robot.
    tool : Tool
        What follows the path.
    basis : array of shape (rows, independent)
        The rows that the joints can move, including those of held joints.
    scale, weights : array of shape (n,)
        Scale of each coordinate, and the weight of its distance from the posture.
    fixed_joints : tuple of int
        Joints that have laws of their own.
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
        """How many rows the task has."""
        return self.basis.shape[1]

    @property
    def has_posture(self) -> bool:
        """Whether joints are left that a posture decides."""
        return self.rows < self.count

    @property
    def size(self) -> int:
        """How many unknowns there are."""
        return self.count + (self.rows if self.has_posture else 0)

    def task(self, x: Any, target: dict[str, Any]) -> Any:
        """Return the rows of the task at coordinates in their scale, as series."""
        goal = {kind: target[kind] for kind in self.kinds}
        rows = task_rows(self.tree, self.tool, x * jnp.asarray(self.scale)[None, :, None], goal)
        if self.fixed_joints:
            rows = jnp.concatenate([rows, x[:, jnp.asarray(self.fixed_joints)] - target["held"]], axis=1)
        return jnp.sum(jnp.asarray(self.basis)[None, :, :, None] * rows[:, :, None], axis=1)

    def residual(self, u: Unknowns, target: dict[str, Any]) -> Float[Numbers, "order row batch"]:
        """Return what vanishes along the path, as series."""
        x, multipliers = u[:, : self.count], u[:, self.count :]
        if not self.has_posture:
            return self.task(x, target)
        # coefficients of J^T l are a convolution, which is what the transposed map does with l in reverse
        rows, back = jax.vjp(lambda x: self.task(x, target), x)
        balance = back(multipliers[::-1])[0][::-1]
        pull = jnp.asarray(self.weights)[None, :, None] * (x - target["posture"])
        return jnp.concatenate([rows, pull + balance], axis=1)

    def matrix(self, u: Float[Numbers, "unknown batch"], target: dict[str, Any]) -> Float[Numbers, "row unknown batch"]:
        """Return the Jacobian of the residual."""
        first = {kind: series[:1] for kind, series in target.items()}
        return columns_of(lambda u: self.residual(u[None], first)[0], u)

    def corrected(self, u: Float[Numbers, "unknown batch"], target: dict[str, Any]) -> "Corrected":
        """Return the unknowns after Newton's corrections, all lanes until the last one is there.

        The last matrix is made where the correction before has led, so that it is that of the result to rounding.
        """
        first = {kind: series[:1] for kind, series in target.items()}

        def correct(carry: tuple[Corrected, Any, Any]) -> Any:
            x, _, count = carry
            factor = PathFactor.of(self.matrix(x.u, first))
            step = -factor.solve(self.residual(x.u[None], first)[0])
            size = jnp.max(jnp.abs(step), axis=0)
            begun = jnp.where(count > 0, x.first, size)
            return Corrected(x.u + step, factor, begun, size), x.last, count + 1

        def open_(carry: tuple[Corrected, Any, Any]) -> Any:
            return ~(jnp.all(carry[1] <= CLOSE)) & (carry[2] < MOST)

        far, rows = jnp.full(u.shape[1:], jnp.inf), self.rows + (self.count if self.has_posture else 0)
        blank = PathFactor(jnp.zeros((rows, *u.shape)), jnp.zeros((len(u), rows, u.shape[1])))
        start = Corrected(u, blank, far, far), far, jnp.zeros((), int)
        return jax.lax.while_loop(open_, correct, start)[0]

    def series(
        self, u: Float[Numbers, "unknown batch"], factor: "PathFactor", target: dict[str, Any], order: int
    ) -> Unknowns:
        """Return the series of the unknowns, order after order by one factorization."""

        def level(k: Any, series: Any) -> Any:
            missing = jax.lax.dynamic_index_in_dim(self.residual(series, target), k, 0, keepdims=False)
            return jax.lax.dynamic_update_index_in_dim(series, -factor.solve(missing), k, 0)

        start = jnp.zeros((order + 1, *u.shape)).at[0].set(u)
        return jax.lax.fori_loop(1, order + 1, level, start)


class PathFactor(Module):
    """The factored Jacobian: square, or with more rows than unknowns, which agree where the path can be followed."""

    matrix: Float[Numbers, "row column batch"]
    inverse: Float[Numbers, "column row batch"]

    @classmethod
    def of(cls, matrix: Float[Numbers, "row column batch"]) -> "PathFactor":
        """Factor matrices of full column rank."""
        rows, columns, lanes = matrix.shape
        if rows == columns:
            return cls(matrix, DenseFactor.of(matrix).inverse())
        # least squares by the augmented matrix, whose condition is not squared (Bjorck 1967)
        whole = jnp.zeros((rows + columns, rows + columns, lanes))
        whole = whole.at[:rows, :rows].set(jnp.eye(rows)[..., None])
        whole = whole.at[:rows, rows:].set(matrix).at[rows:, :rows].set(jnp.swapaxes(matrix, 0, 1))
        return cls(matrix, DenseFactor.of(whole).inverse()[rows:, :rows])

    def solve(self, right: Float[Numbers, "row batch"]) -> Float[Numbers, "column batch"]:
        """Return the solution, refined once."""

        def product(right: Any) -> Any:
            return jnp.sum(self.inverse * right[None], axis=1)

        solution = product(right)
        return solution + product(right - jnp.sum(self.matrix * solution[None], axis=1))


class Corrected(NamedTuple):
    """Unknowns after corrections, the factored matrix there, and the sizes of the first correction and the last."""

    u: Any
    factor: PathFactor
    first: Any
    last: Any
