"""Forward dynamics of a robot: accelerations and their rates, to any order, from torques."""

import math
from collections.abc import Sequence
from typing import Any, overload

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Array, ArrayLike, Numbers, is_traced
from jounce.errors import RobotError, SingularityError, check_name, flag
from jounce.robot.algorithms.base_motion import BaseMotion, base_arrays, base_body
from jounce.robot.algorithms.motion_series import MotionSeries, motion_series
from jounce.robot.algorithms.wrenches import Wrench, wrench_arrays
from jounce.robot.model.arguments import checked_state, floats, joints_of, stacked_arguments
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.articulated_bodies import LEAST_INERTIA
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.kinematics import frame_at
from jounce.robot.recursions.tree_equations import TreeEquations, Unknowns, free_base
from jounce.robot.robot import Robot
from jounce.trajectory.labels import in_order

MOST_UNROLLED = 5  # levels with code of their own
WIDE = 32  # samples side by side where rates are computed: their histories fit in the cache


@overload
def forward_dynamics(
    robot: Robot,
    state: ArrayLike,
    tau: ArrayLike,
    *,
    driven: Sequence[str] = (),
    wrenches: Sequence[Wrench] = (),
    time: ArrayLike | None = None,
    drives: bool = True,
    base: None = None,
    strict: bool = True,
) -> Array[Numbers, "*batch derivative joint"]: ...
@overload
def forward_dynamics(
    robot: Robot,
    state: ArrayLike,
    tau: ArrayLike,
    *,
    driven: Sequence[str] = (),
    wrenches: Sequence[Wrench] = (),
    time: ArrayLike | None = None,
    drives: bool = True,
    base: BaseMotion,
    strict: bool = True,
) -> tuple[BaseMotion, Array[Numbers, "*batch derivative joint"]]: ...
@stacked_arguments(3, "jn.forward_dynamics(robot, np.stack([q, v]), tau[None])[2] for pin.aba(model, data, q, v, tau)")
def forward_dynamics(
    robot: Robot,
    state: ArrayLike,
    tau: ArrayLike,
    *,
    driven: Sequence[str] = (),
    wrenches: Sequence[Wrench] = (),
    time: ArrayLike | None = None,
    drives: bool = True,
    base: BaseMotion | None = None,
    strict: bool = True,
) -> Array[Numbers, "*batch derivative joint"] | tuple[BaseMotion, Array[Numbers, "*batch derivative joint"]]:
    """Return the motion that joint torques or forces cause, to any order: the inverse of `inverse_dynamics`.

    The articulated-body algorithm (Featherstone 2008, Rigid Body Dynamics Algorithms, chapter 7) takes a time linear in
    the number of joints; articulated inertias are computed once and serve all orders. Robots with joints that follow
    others use a dense mass matrix.

    Parameters
    ----------
    robot : Robot
        The robot, with its payload (`Robot.with_payload`) and gravity.
    state : array_like of shape (..., 2, n)
        Coordinates and velocities in the order of `robot.joint_names`, rad or m, by s.
    tau : array_like of shape (..., order + 1, n)
        Torques or forces ``tau, tau', ...`` in N m or N, by s. Columns of driven joints hold their accelerations
        ``q'', q''', ...`` instead. With `base`, the shape may be (..., order + 1, 6 + n), as `inverse_dynamics` returns
        it: first the force on the base and the moment about its origin, in base axes.
    driven : sequence of str, optional
        Joints with prescribed accelerations; `inverse_dynamics` of the result gives their torques.
    wrenches : sequence of Wrench, optional
        External forces and torques; their arrays have order + 1 levels.
    time : array_like of shape (...), optional
        Instants of the samples, s; needed where a wrench is a function of time.
    drives : bool, default True
        Include the drives: armature inertia, viscous damping and Coulomb friction of the joints. Friction has the sign
        of the velocity and is zero at rest.
    base : BaseMotion, optional
        Pose and twist, without derivatives, of a free base; the base is fixed unless given.
    strict : bool, default True
        Raise where a joint moves no inertia; otherwise such samples are NaN.

    Returns
    -------
    array of shape (..., order + 3, n)
        ``q, q', q'', ...`` to the derivative order + 2, rad or m, by s.
    base : BaseMotion
        Only with `base`, and then first: its motion with the rates of its twist to order + 1.

    Raises
    ------
    RobotError
        If an argument does not fit the robot, or the robot has closed loops: use `jounce.simulate` or
        `jounce.constraint_equations` with its mechanism (`Robot.mechanism`).
    SingularityError
        If a joint moves no inertia, so that nothing determines its acceleration (with `strict`).

    Notes
    -----
    Derivatives of free motion grow fast with the order, and rounding errors with them: `inverse_dynamics` of the result
    returns the torques to rounding of their largest term, the inertia times the highest derivative.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    >>> pendulum = jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    >>> state = [[0.0], [1.0]]
    >>> jn.forward_dynamics(pendulum, state, [[5.905], [2.0]]).round(12).tolist()  # torque and torque rate
    [[0.0], [1.0], [3.0], [6.0]]
    """
    joints_of(robot)
    if robot.closures:
        message = (
            "the loops of this robot make its coordinates depend on one another; jn.simulate(robot.mechanism(...)) "
            "gives its motion under forces, robot.opened() the tree without closures"
        )
        raise RobotError(message, name=robot.name, value=list(robot.closures))
    drives, strict = flag("drives", drives, error=RobotError), flag("strict", strict, error=RobotError)
    state = checked_state(robot, state)
    forces, at_base = _checked_forces(robot, tau, state.shape[:-2], base is not None)
    lead, levels, count = state.shape[:-2], forces.shape[-2], len(robot.joint_names)
    mask = np.zeros(count)
    for name in (driven,) if isinstance(driven, str) else driven:
        check_name("moving joint", name, robot.joint_names, RobotError, name="driven")
        mask[robot.joint_names.index(name)] = 1.0
    pushes = wrench_arrays(robot, wrenches, lead, levels, time, free=base is not None)
    frames = tuple(frame_at(robot, wrench.link, wrench.point) for wrench in wrenches)
    base_values = () if base is None else (*base_arrays(base, lead, 1), at_base)
    arrays = (state, forces, *base_values, *pushes)
    constants = (mask, frames, None if base is None else base_body(robot))
    traced = is_traced((arrays, robot.tree, constants))
    static = (tuple(wrench.frame == "base" for wrench in wrenches), drives, traced)
    q, margin, *base_twist = _forward_dynamics(robot, arrays, constants, static)
    if strict and not traced:
        _check_margins(robot, margin, mask)
    return q if base is None else (BaseMotion(base.position, base.quaternion, base_twist[0]), q)


def _checked_forces(robot: Robot, tau: Any, lead: tuple[int, ...], free: bool) -> tuple[Any, Any]:
    """Return the checked forces of the joints, and the forces on a free base, with as many levels."""
    tau, n = floats("tau", in_order("tau", tau, robot.joint_names, RobotError)), len(robot.joint_names)
    columns = (n, 6 + n) if free else (n,)
    if tau.ndim != len(lead) + 2 or tau.shape[:-2] != lead or tau.shape[-1] not in columns or not tau.shape[-2]:
        expected = " or ".join(f"({', '.join([*map(str, lead), 'order + 1', str(c)])})" for c in columns)
        raise RobotError(f"must have the shape {expected}, as the state has, not {tau.shape}", name="tau")
    if tau.shape[-1] == n:
        return tau, np.zeros((*tau.shape[:-1], 6))
    return tau[..., 6:], tau[..., :6]


@Batched
def _forward_dynamics(
    tree: Tree,
    arrays: tuple[Any, ...],
    constants: Any,
    global_axes: tuple[bool, ...],
    drives: bool,
    reversible: bool,
) -> Any:
    """Return Taylor coefficients of the coordinates, the margins of the joints, and those of the twist of the base."""
    driven, frames, body = constants
    equations = TreeEquations(tree, driven, body, frames, global_axes, drives)
    levels, lanes = len(arrays[1]), arrays[0].shape[-1]

    def coefficients_of(arrays: tuple[Any, ...]) -> Any:
        return _coefficients(equations, arrays, reversible)

    if levels == 1 or lanes % WIDE or lanes == WIDE:
        return coefficients_of(arrays)
    wide_batches = tuple(jnp.moveaxis(x.reshape(*x.shape[:-1], lanes // WIDE, WIDE), -2, 0) for x in arrays)
    results = jax.lax.map(coefficients_of, wide_batches)
    return jax.tree.map(lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], lanes), results)


def _coefficients(equations: TreeEquations, arrays: tuple[Any, ...], reversible: bool) -> Any:
    state, forces, *extras = arrays
    has_base = equations.base is not None
    base = free_base(extras[0][0, :3], extras[0][0, 3:], extras[1][0]) if has_base else None
    at_base, pushes = (extras[2], tuple(extras[3:])) if has_base else (None, tuple(extras))
    mask = jnp.asarray(equations.driven)[None, :, None]
    driven = mask * forces

    def applied(_: Any, inputs: Any) -> Any:
        forces, at_base, pushes = inputs
        return Unknowns(forces, at_base), pushes

    order = len(forces) - 1
    # forces of driven joints follow from their accelerations: they have no force residual
    inputs = ((1.0 - mask) * forces, at_base, pushes)
    # only the program of one sample is unrolled, as it becomes machine code; unrolled long histories would be too long
    unrolled = state.shape[-1] == 1 and not reversible and len(forces) <= MOST_UNROLLED
    motion = equations.motion(state[0], state[1], base)
    series = motion_series(equations, motion, applied, inputs, driven, order, reversible=reversible, unrolled=unrolled)
    q, margin = coordinates_of(series, order), series.factor.margin[None]
    rates = series.accelerations.base
    if series.twist is None or rates is None:
        return q, margin
    return q, margin, jnp.concatenate([series.twist[: order + 1], rates[order:] / (order + 1)])


def coordinates_of(series: MotionSeries, order: int) -> Float[Numbers, "level coordinate batch"]:
    """Return the coefficients of the coordinates, two levels more than those of the accelerations."""
    top_levels = series.accelerations.joints[order:] / ((order + 1) * (order + 2))
    return jnp.concatenate([series.coordinates[: order + 2], top_levels])


def _check_margins(robot: Robot, margin: Any, driven: np.ndarray) -> None:
    """Raise SingularityError, naming the joint, if a free joint moves no inertia."""
    margin = np.reshape(margin, (math.prod(margin.shape[:-1]), margin.shape[-1]))  # a lone body has no joints
    is_free = np.ones(margin.shape[1])
    by_joint = robot.tree.shape.direct and not robot.tree.shape.armed
    if by_joint:
        is_free[: len(driven)] = 1.0 - driven
    is_undetermined = ~(margin > LEAST_INERTIA) & (is_free > 0)
    if not is_undetermined.any():
        return
    sample = int(np.argwhere(is_undetermined)[0, 0])
    at_sample = f" at sample {sample}" if len(margin) > 1 else ""
    names = [joint.name for joint in robot.moving_joints] if by_joint else []
    joints = np.flatnonzero(is_undetermined[sample, : len(names)])
    if not joints.size:
        message = f"some motion of the joints or of the free base has no inertia{at_sample}: it has no acceleration"
        raise SingularityError(f"{message}; give the links and the base inertias", name=robot.name)
    message = (
        f"the bodies that this joint moves have no inertia about its axis{at_sample}, so that its acceleration is not "
        "determined; give the link an inertia, or the joint an armature, or drive it"
    )
    # name the outermost joint: the accelerations of the joints that carry it are undetermined as well
    raise SingularityError(message, name=names[int(joints[-1])])
