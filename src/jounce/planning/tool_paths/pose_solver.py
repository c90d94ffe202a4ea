"""Projected Levenberg-Marquardt within the limits of joints, for batches of poses."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jounce.linear_algebra.linear import DenseFactor, singular_values
from jounce.planning.tool_paths.tool_tasks import Goal, columns_of, misses
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched

FIRST = 1e-3  # damping relative to the squared error: Fan and Yuan 2005, which keeps quadratic convergence
LEAST = 1e-15  # damping relative to the squared Jacobian, which keeps redundant joints in place
GROWTH = 4.0
STALLED = 1e-15  # rad: smallest step
FLAT = 1e-8  # relative slope of the error at a minimum
STIFF = 1e12  # damping beyond which no step is worth trying
FIRM = 100.0  # weight of the excess of a follower over its range, relative to errors of the tool


class FollowerRanges(NamedTuple):
    """Ranges of joints that follow several, in scaled coordinates: they follow at ``weights @ x + offset``."""

    weights: Any
    offset: Any
    lower: Any
    upper: Any

    def excess(self, x: Any) -> Any:
        """Return by how much they are beyond their ranges, (follower, batch)."""
        place = jnp.sum(self.weights[:, :, None] * x[None], axis=1) + self.offset[:, None]
        return place - jnp.clip(place, self.lower[:, None], self.upper[:, None])


class _Look(NamedTuple):
    """Error at coordinates, and its Jacobian."""

    x: Any
    rows: Any
    columns: Any
    square: Any


@Batched
def solve_poses(tree: Tree, arrays: tuple[Any, ...], constants: Any, kinds: tuple[str, ...]) -> Any:
    """Return coordinates nearest to a goal, the remaining error, and the singular values of the task.

    Projected Levenberg-Marquardt (Kanzow, Yamashita and Fukushima 2004): joints pushed outward at a limit are held, and
    the others take the damped step, clipped at the limits, if it brings the tool nearer. What a joint that follows
    several is beyond its range counts as an error: it vanishes where a pose is reached.

    Returns
    -------
    q : array of shape (1, coordinates, batch)
    square : array of shape (1, batch)
        Sum of squared errors, in rad or sizes of the robot, and of the excess of followers over their ranges.
    level : array of shape (1, batch)
        Relative slope of this sum; small at a local minimum.
    active : array of shape (1, batch)
        1 where more steps may help.
    values, shares : array of shape (1, k, batch) and (1, k, coordinates, batch)
        Singular values of the task, and its right singular vectors.
    """
    start, *targets = arrays
    tool, lower, upper, scale, followers, enough, max_steps = constants
    goal: Goal = dict(zip(kinds, targets, strict=True))
    lower, upper, scale = (jnp.asarray(x)[:, None] for x in (lower, upper, scale))

    def missed(x: Any) -> Any:
        return jnp.concatenate([misses(tree, tool, x * scale, goal), FIRM * followers.excess(x)])

    def evaluate(x: Any) -> _Look:
        rows = missed(x)
        return _Look(x, rows, columns_of(missed, x), jnp.sum(rows * rows, axis=0))

    def projected_slope(look: _Look) -> tuple[Any, Any]:
        slope = jnp.sum(look.columns * look.rows[:, None], axis=0)
        outward = ((look.x <= lower) & (slope > 0)) | ((look.x >= upper) & (slope < 0))
        slope = jnp.where(outward, 0.0, slope)
        size = jnp.sqrt(jnp.maximum(jnp.sum(look.columns**2, axis=(0, 1)) * look.square, np.finfo(float).tiny))
        return slope, jnp.max(jnp.abs(slope), axis=0) / size

    def next_point(look: _Look, damping: Any) -> Any:
        slope, _ = projected_slope(look)
        columns = look.columns * jnp.where(slope == 0, 0.0, 1.0)[None]
        normal = jnp.sum(columns[:, :, None] * columns[:, None], axis=0)
        size = jnp.max(jnp.sum(columns**2, axis=0), axis=0)
        shift = damping * look.square + LEAST * size + np.finfo(float).tiny
        step = -DenseFactor.of(normal + jnp.eye(len(slope))[..., None] * shift[None, None]).solve(slope, refined=False)
        return jnp.clip(look.x + step, lower, upper)

    def improved(carry: Any) -> Any:
        best, x, damping, is_active, count = carry
        trial = evaluate(x)  # in the first pass the start, which replaces the infinite error
        is_better = (trial.square < best.square) & is_active
        model = best.rows + jnp.sum(best.columns * (trial.x - best.x)[None], axis=1)
        is_good = best.square - trial.square > 0.25 * (best.square - jnp.sum(model * model, axis=0))
        changed = jnp.where(is_better & is_good, jnp.maximum(damping / GROWTH, FIRST * FIRST), damping * GROWTH)
        damping = jnp.where(is_active & (count > 0), changed, damping)
        best = jax.tree.map(
            lambda a, b: jnp.where(jnp.reshape(is_better, (1,) * (a.ndim - 1) + is_better.shape), a, b), trial, best
        )
        x = next_point(best, damping)
        step_size = jnp.max(jnp.abs(x - best.x), axis=0)
        is_active = is_active & (best.square > enough**2) & (step_size > STALLED) & (damping < STIFF)
        return best, x, damping, is_active & (projected_slope(best)[1] > FLAT), count + 1

    x = jnp.clip(start[0] / scale, lower, upper)
    rows = jax.eval_shape(missed, x).shape
    nothing = _Look(x, jnp.zeros(rows), jnp.zeros((rows[0], *x.shape)), jnp.full(x.shape[1:], jnp.inf))
    initial = nothing, x, jnp.full(x.shape[1:], FIRST), jnp.full(x.shape[1:], True), jnp.zeros((), int)
    state = jax.lax.while_loop(lambda carry: jnp.any(carry[3]) & (carry[4] <= max_steps), improved, initial)
    best, is_active = state[0], state[3]
    _, values, shares = singular_values(best.columns[: rows[0] - len(followers.offset)])
    outputs = (
        best.x * scale,
        best.square,
        projected_slope(best)[1],
        is_active.astype(float),
        values,
        jnp.swapaxes(shares, 0, 1),
    )
    return jax.tree.map(lambda output: output[None], outputs)
