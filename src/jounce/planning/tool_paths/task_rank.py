"""The number of motions of a tool that joints can cause, and the joints that lose one at a singular position."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.planning.tool_paths.tool_tasks import Goal, Tool, columns_of, task_rows
from jounce.robot.model.abstract_robot import AbstractRobot
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.kinematics import link_frame

CONFIGURATIONS = 16  # random configurations that show the general rank
RANK = 1e-9  # fraction of the largest singular value: smaller values are zero
SINGULAR = 1e-3  # fraction of the largest singular value: a position with a smaller least value is singular
NOTABLE = 0.1  # fraction of the largest share: joints with smaller shares take no part in a lost motion


@Batched
def _columns(tree: Tree, arrays: tuple[Any, ...], constants: Any, kinds: tuple[str, ...]) -> Any:
    """Return the Jacobian of a task by scaled coordinates, with the present pose as its goal."""
    tool, scale = constants
    q = arrays[0][0]
    frame = link_frame(tree, q[None], tool.frame)
    goals = {
        "position": frame.position.coefficients[0][None],
        "rotation": jnp.stack([axis.coefficients[0] for axis in frame.axes], axis=1)[None],
        "direction": frame.direction(tool.axes[:, 2]).coefficients[0][None],
    }
    goal: Goal = {kind: goals[kind] for kind in kinds}
    scale = scale[:, None]
    return columns_of(lambda x: task_rows(tree, tool, (x * scale)[None], goal)[0], q / scale)[None]


def task_columns(
    robot: AbstractRobot, tool: Tool, q: Any, kinds: tuple[str, ...], scale: Any
) -> Float[np.ndarray, "samples row column"]:
    """Return the Jacobians of a task at coordinates, (samples, n), with their poses as goals."""
    return np.asarray(_columns(robot, (np.asarray(q)[:, None],), (tool, scale), (kinds,)))[:, 0]


def random_coordinates(lower: Any, upper: Any, scale: Any, count: int, seed: int) -> Float[np.ndarray, "count n"]:
    """Return a Halton sequence of coordinates over the ranges of joints; ranges without limits span one turn."""
    from scipy.stats import qmc

    turn = 2 * np.pi * scale
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - turn, -0.5 * turn))
    high = np.where(np.isfinite(upper), upper, low + turn)
    return low + (high - low) * qmc.Halton(len(low), rng=seed).random(count)


def reachable_rows(columns: Float[np.ndarray, "samples row column"]) -> tuple[Float[np.ndarray, "row some"], int]:
    """Return a basis of the rows that joints can move in any sample, and the general rank of the task."""
    wide = np.concatenate(list(columns), axis=1)
    u, s, _ = np.linalg.svd(wide, full_matrices=False)
    basis = u[:, s > RANK * s[0]]
    singular_values = np.linalg.svd(columns, compute_uv=False)
    return basis, int((singular_values > RANK * singular_values[:, :1]).sum(axis=1).max())


def losing_joints(names: tuple[str, ...], shares: Float[np.ndarray, " n"]) -> list[str]:
    """Return the joints whose motions cancel at the tool, the largest shares first."""
    sizes = np.abs(shares)
    order = np.argsort(-sizes, kind="stable")
    return [names[k] for k in order if sizes[k] >= NOTABLE * sizes.max()] if sizes.any() else []
