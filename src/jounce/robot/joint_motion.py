"""Joint motion from the motion of a link, order by order, by one pseudo-inverse. Negrean 2025, equation 60."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jounce.errors import RobotError, SingularityError, did_you_mean
from jounce.robot.batches import Batched, checked
from jounce.robot.jacobian import jacobian_jet, twist
from jounce.robot.kinematics import frame_constants
from jounce.robot.robot import Robot
from jounce.robot.scan import stacked
from jounce.robot.tree import Tree

TASKS = {"pose": (0, 1, 2, 3, 4, 5), "position": (0, 1, 2), "orientation": (3, 4, 5)}


@dataclasses.dataclass(frozen=True, eq=False)
class JointMotion:
    """Joint coordinates of a prescribed motion of a link.

    Parameters
    ----------
    q : array of shape (..., order + 1, n)
        Coordinates and their derivatives.
    singular_values : array of shape (..., k)
        Of the Jacobian of the task, the largest first.
    singular : array of bool, shape (...)
        Whether the configuration is singular: the motion is damped there, or NaN where no damping was asked for.
    residual : array of shape (..., order, task)
        What the motion lacks of the one prescribed: zero to rounding, unless damped or where joints are too few.
    """

    q: Any
    singular_values: Any
    singular: Any
    residual: Any


@Batched
def _solved(tree: Tree, arrays: Any, constants: Any, rows: tuple[int, ...]) -> Any:
    position, wanted = arrays
    frame, damping, threshold = constants
    rows_ = np.array(rows)

    def task_twist(q: Any) -> Any:
        return stacked(twist(tree, q, frame))[:, rows_]

    matrix = jnp.moveaxis(jacobian_jet(tree, position, frame).coefficients[0][rows_], -1, 0)
    u, s, v = jnp.linalg.svd(matrix, full_matrices=False)
    near = s < threshold * s[:, :1]
    squares = jnp.where(near, damping**2 * (1 - (s / (threshold * s[:, :1])) ** 2), 0.0)
    inverse = jnp.where(near & (damping == 0), jnp.nan, s / jnp.where(squares + s == 0, 1.0, s**2 + squares))
    # the pseudo-inverse is made once, and serves all orders
    pseudo = jnp.einsum("bji,bj,bkj->bik", v, inverse, u)
    q = position
    for k in range(wanted.shape[0]):
        trial = jnp.concatenate([q, jnp.zeros_like(position)])
        missing = wanted[k] - task_twist(trial)[k]
        q = jnp.concatenate([q, jnp.einsum("bik,kb->ib", pseudo, missing)[None] / (k + 1)])
    residual = wanted - task_twist(q)
    return q, jnp.swapaxes(s, 0, 1)[None], jnp.swapaxes(near.any(axis=1)[:, None], 0, 1)[None] * 1.0, residual


def joint_motion(
    robot: Robot,
    position: Any,
    operational: Any,
    link: str,
    point: Any = (0.0, 0.0, 0.0),
    *,
    task: str = "pose",
    damping: float = 0.0,
    threshold: float = 1e-3,
    strict: bool = True,
) -> JointMotion:
    """Return the joint motion that gives a link a prescribed motion, order by order: Negrean 2025, equation 60.

    One pseudo-inverse of the Jacobian, from its singular values, serves all orders. A redundant robot moves with the
    least norm of each derivative in turn.

    Parameters
    ----------
    robot : Robot
        The robot.
    position : array_like of shape (..., n)
        Coordinates, rad or m.
    operational : array_like of shape (..., order, 6) or (..., order, 3)
        ``X', X'', ...`` as `operational_accelerations` gives them; three components where the task has three.
    link, point
        As for `jacobian`.
    task : {"pose", "position", "orientation"}, default "pose"
        Which rows count.
    damping : float, default 0
        Damped least squares: how strongly directions near singularity are held back, in the units of the Jacobian; it
        fades in below the threshold. Zero is no damping: singular configurations are errors.
    threshold : float, default 1e-3
        A configuration is singular where the smallest singular value is below this part of the largest.
    strict : bool, default True
        Raise at singular configurations without damping; otherwise they are NaN.

    Returns
    -------
    JointMotion
        Coordinates with their derivatives, singular values, and what is lacking.

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
    >>> jn.joint_motion(robot, [0.0], [[0.0, 2.0, 0.0], [-4.0, 0.0, 0.0]], "rod", [1, 0, 0], task="position").q.tolist()
    [[0.0], [2.0], [0.0]]
    """
    if task not in TASKS:
        raise RobotError(f"no such task; {did_you_mean(task, TASKS)}", name="task", value=task)
    rows = TASKS[task]
    for name, value, least in (("damping", damping, 0.0), ("threshold", threshold, 1e-15)):
        if not (np.isfinite(value) and value >= least):
            raise RobotError(f"must be a finite number, {least:g} or greater", name=name, value=value)
    start = checked(robot, jnp.asarray(position, float)[..., None, :], 0)
    wanted = operational if isinstance(operational, jax.Array) else np.asarray(operational, float)
    lead = start.shape[:-2]
    if wanted.ndim < 2 or wanted.shape[:-2] != lead or wanted.shape[-1] not in (6, len(rows)) or wanted.shape[-2] < 1:
        shape = f"{(*lead, 'order', len(rows))}".replace("'", "")
        raise RobotError(f"must have the shape {shape}, order 1 or more", name="operational", value=wanted.shape)
    if wanted.shape[-1] == 6:
        wanted = wanted[..., np.array(rows)]
    constants = (frame_constants(robot, link, point), np.float64(damping), np.float64(threshold))
    q, values, singular, residual = _solved(robot, (start, wanted), constants, (rows,))
    values, singular = values[..., 0, :], singular[..., 0, 0] > 0
    if strict and damping == 0 and not isinstance(singular, Tracer) and np.any(singular):
        first = tuple(int(i) for i in np.argwhere(np.atleast_1d(singular))[0])
        ratio = float(np.min(np.reshape(values, (-1, values.shape[-1])).min(axis=1)))
        where = "" if not lead else f" at sample {first[0] if len(first) == 1 else first}"
        message = (
            f"the configuration is singular for this task{where}: the smallest singular value of the Jacobian is "
            f"{ratio:.2g}; give a damping, or take another task or path"
        )
        raise SingularityError(message, name=link)
    return JointMotion(q, values, singular, residual)
