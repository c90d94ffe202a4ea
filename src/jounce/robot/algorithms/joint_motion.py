"""Joint motion from the motion of a link, order by order, with one pseudo-inverse. Negrean 2025, equation 60."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Float

from jounce.base.shapes import Array, ArrayLike, Numbers
from jounce.errors import RobotError, SingularityError, check_choice
from jounce.jet.algebra import stacked
from jounce.linear_algebra.linear import singular_values
from jounce.rigid.inertia import finite_numbers
from jounce.robot.algorithms.jacobian import jacobian_jet, twist
from jounce.robot.model.arguments import checked_position, floats
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.kinematics import frame_at
from jounce.robot.robot import Robot

TASKS = {"pose": (0, 1, 2, 3, 4, 5), "position": (0, 1, 2), "orientation": (3, 4, 5)}


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True, eq=False)
class JointMotion:
    """Joint coordinates of a prescribed motion of a link.

    Parameters
    ----------
    q : array of shape (..., order + 1, n)
        Coordinates and their derivatives.
    singular_values : array of shape (..., k)
        Singular values of the Jacobian of the task, the largest first.
    singular : array of bool, shape (...)
        Whether the configuration is singular: its motion is damped, or NaN without damping.
    residual : array of shape (..., order, task)
        Prescribed motion minus that of the joints: zero to rounding, unless damped or with too few joints.
    """

    q: Array[Numbers, "*batch derivative joint"]
    singular_values: Array[Numbers, "*batch value"]
    singular: Bool[Numbers, "*batch"] | np.bool
    residual: Array[Numbers, "*batch derivative-1 row"]


@Batched
def _solved(
    tree: Tree,
    arrays: tuple[Float[Numbers, "1 coordinate batch"], Float[Numbers, "order row batch"]],
    constants: Any,
    rows: tuple[int, ...],
) -> Any:
    position, target = arrays
    frame, damping, threshold = constants
    rows_ = np.array(rows)

    def task_twist(q: Any) -> Any:
        return stacked(twist(tree, q, frame))[:, rows_]

    u, s, v = singular_values(jacobian_jet(tree, position, frame).coefficients[0][rows_])
    limit = threshold * s[:1]
    is_singular = s <= limit  # also where all are zero, and no motion is possible
    squares = jnp.where(is_singular, damping**2 * (1 - (s / jnp.where(limit == 0, 1.0, limit)) ** 2), 0.0)
    inverse = jnp.where(is_singular & (damping == 0), jnp.nan, s / jnp.where(squares + s == 0, 1.0, s**2 + squares))
    pseudo = jnp.sum(v[:, None] * (u * inverse[None])[None], axis=2)
    q = position
    for k in range(target.shape[0]):
        trial = jnp.concatenate([q, jnp.zeros_like(position)])
        deficit = target[k] - task_twist(trial)[k]
        q = jnp.concatenate([q, jnp.sum(pseudo * deficit[None], axis=1)[None] / (k + 1)])
    residual = target - task_twist(q)
    return q, s[None], is_singular.any(axis=0).astype(float)[None, None], residual


def joint_motion(
    robot: Robot,
    position: ArrayLike,
    operational: ArrayLike,
    link: str,
    point: ArrayLike = (0.0, 0.0, 0.0),
    *,
    task: str | Sequence[int] = "pose",
    damping: float = 0.0,
    threshold: float = 1e-3,
    strict: bool = True,
) -> JointMotion:
    """Return the joint motion that gives a link a prescribed motion, order by order: Negrean 2025, equation 60.

    One pseudo-inverse of the Jacobian, from its singular values, serves all orders. For a redundant robot, each
    derivative in turn has the least norm.

    Parameters
    ----------
    robot : Robot
        The robot.
    position : array_like of shape (..., n)
        Coordinates, rad or m.
    operational : array_like of shape (..., order, 6) or (..., order, rows)
        ``X', X'', ...`` as `operational_accelerations` returns them, or the rows of the task only.
    link, point
        As for `jacobian`.
    task : {"pose", "position", "orientation"} or sequence of int, default "pose"
        Rows of the Jacobian to fulfill, by name or by numbers from 0 to 5, such as ``(0, 1)`` for a position in the x-y
        plane.
    damping : float, default 0
        Damping factor of damped least squares, in the units of the Jacobian, which fades in below the threshold.
        Without damping, singular configurations are errors.
    threshold : float, default 1e-3
        Ratio of the smallest to the largest singular value at or below which a configuration is singular.
    strict : bool, default True
        Raise at singular configurations without damping; otherwise they are NaN.

    Returns
    -------
    JointMotion
        Coordinates with their derivatives, singular values, and the residual.

    Raises
    ------
    RobotError
        If an argument does not fit the robot.
    SingularityError
        If a configuration is singular, there is no damping, and `strict` is True.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod")
    >>> robot = jn.Robot("one", links, [pin])
    >>> tip = [[0.0, 2.0, 0.0], [-4.0, 0.0, 0.0]]  # its velocity and acceleration
    >>> jn.robot.joint_motion(robot, [0.0], tip, "rod", [1, 0, 0], task="position").q.tolist()
    [[0.0], [2.0], [0.0]]
    """
    rows = _rows(task)
    for name, value, lower_bound in (("damping", damping, 0.0), ("threshold", threshold, 1e-15)):
        if finite_numbers(name, value, ()) < lower_bound:
            raise RobotError(f"must be {lower_bound:g} or greater", name=name, value=value)
    start, target = checked_position(robot, position, "position"), floats("operational", operational)
    lead = start.shape[:-2]
    if target.ndim < 2 or target.shape[:-2] != lead or target.shape[-1] not in (6, len(rows)) or target.shape[-2] < 1:
        shape = f"{(*lead, 'order', len(rows))}".replace("'", "")
        raise RobotError(f"must have the shape {shape}, order 1 or more, not {target.shape}", name="operational")
    if target.shape[-1] == 6:
        target = target[..., np.array(rows)]
    constants = (frame_at(robot, link, point), np.float64(damping), np.float64(threshold))
    q, values, singular, residual = _solved(robot, (start, target), constants, (rows,))
    values, singular = values[..., 0, :], singular[..., 0, 0] > 0
    if strict and damping == 0 and not isinstance(singular, Tracer) and np.any(singular):
        sample = tuple(int(i) for i in np.argwhere(np.atleast_1d(singular))[0])
        smallest, largest = (float(values[sample if lead else ()][k]) for k in (-1, 0))
        sample_text = "" if not lead else f" at sample {sample[0] if len(sample) == 1 else sample}"
        message = (
            f"the configuration is singular for this task{sample_text}: the singular values of the Jacobian reach from "
            f"{largest:.2g} down to {smallest:.2g}; give a damping, or take another task or path"
        )
        raise SingularityError(message, name=link)
    return JointMotion(q, values, singular, residual)


def _rows(task: str | Sequence[int]) -> tuple[int, ...]:
    """Return the rows of the Jacobian in a task."""
    if isinstance(task, str):
        check_choice("task", task, TASKS, RobotError)
        return TASKS[task]
    rows = tuple(task)
    are_valid = all(isinstance(row, int | np.integer) and 0 <= row <= 5 for row in rows)
    if not are_valid or not rows or len(set(rows)) < len(rows):
        raise RobotError("must be a name or different rows from 0 to 5", name="task", value=list(rows))
    return tuple(int(row) for row in rows)
