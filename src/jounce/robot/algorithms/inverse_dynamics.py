"""Inverse dynamics of a robot: joint torques of a prescribed motion and joint wrenches, with rates of any order."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Array, ArrayLike, Numbers, is_traced
from jounce.errors import RobotError, check_choice, check_name, flag
from jounce.jet import Jet, concatenate, cross, matvec
from jounce.jet.algebra import stacked, total
from jounce.robot.algorithms.base_motion import (
    BaseMotion,
    base_arrays,
    base_body,
    free_fall_velocity,
    in_base,
    scene_axes,
)
from jounce.robot.algorithms.wrenches import FRAMES, Wrench, wrench_arrays
from jounce.robot.model.arguments import checked_coordinates, stacked_arguments
from jounce.robot.model.tree import Frame, Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.drive_forces import inertial_forces, passive_forces
from jounce.robot.recursions.kinematics import body_frames, frame_at
from jounce.robot.recursions.newton_euler import BodyWrenches, inertial_wrench, recursive_newton_euler
from jounce.robot.recursions.tree_scan import of_one_body, to_coordinates
from jounce.robot.robot import Robot


@stacked_arguments(2, "jn.inverse_dynamics(robot, np.stack([q, v, a])) for pin.rnea(model, data, q, v, a)")
def inverse_dynamics(
    robot: Robot,
    q: ArrayLike,
    *,
    wrenches: Sequence[Wrench] = (),
    time: ArrayLike | None = None,
    drives: bool = True,
    base: BaseMotion | None = None,
) -> Array[Numbers, "*batch derivative joint"]:
    """Return the joint torques or forces that a motion needs, and their rates, exact to rounding.

    Recursive Newton-Euler on jets: Negrean 2025, equations 123-125 and 144-146, to any order.

    Parameters
    ----------
    robot : Robot
        The robot, with its payload (`Robot.with_payload`) and gravity.
    q : array_like of shape (..., order + 1, n)
        Coordinates and their derivatives ``q, q', q'', ...`` in the order of `robot.joint_names`, rad or m; order 2 or
        more. Each derivative beyond the second gives one rate of the torques.
    wrenches : sequence of Wrench, optional
        External forces and torques.
    time : array_like of shape (...), optional
        Instants of the samples, s; needed where a wrench is a function of time.
    drives : bool, default True
        Include the drives: armature inertia, viscous damping and Coulomb friction of the joints. Friction has the sign
        of the velocity and is zero at rest; the rates do not include its jumps.
    base : BaseMotion, optional
        Motion of a free base, its twist with order - 1 derivatives; the base is fixed unless given. With it, gravity
        and wrenches with ``frame="base"`` are in the axes of the scene.

    Returns
    -------
    array of shape (..., order - 1, n), or (..., order - 1, 6 + n) with `base`
        ``tau, tau', tau'', ...`` in N m, or N for prismatic joints, by s. The torque of a joint that others follow
        includes theirs. With `base`, the first six columns are the external force on the base, N, and the moment about
        its origin, N m, in base axes: zero for a motion that the base can make unaided.

    Raises
    ------
    RobotError
        If q, a wrench or the motion of the base does not fit the robot.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    >>> pendulum = jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    >>> jn.inverse_dynamics(pendulum, [[0.0], [1.0], [3.0], [6.0]]).round(12).tolist()  # torque and torque rate
    [[5.905], [2.0]]
    """
    q = checked_coordinates(robot, q, 2)
    drives = flag("drives", drives, error=RobotError)
    arrays, static = _applied(robot, q, wrenches, time, free=base is not None)
    if base is None:
        return generalized_forces(robot, arrays[0], arrays[1], (*static, drives))
    base_values = base_arrays(base, q.shape[:-2], q.shape[-2] - 1)
    return _forces_of_free_tree(robot, (*arrays[0], *base_values), (arrays[1], base_body(robot)), (*static, drives))


def joint_wrenches(
    robot: Robot,
    q: ArrayLike,
    *,
    wrenches: Sequence[Wrench] = (),
    time: ArrayLike | None = None,
    frame: str = "link",
    fixed: Sequence[str] = (),
) -> Array[Numbers, "*batch derivative body 6"]:
    """Return the forces and moments that the joints transmit, as loads on bearings and flanges, and their rates.

    Parameters
    ----------
    robot, q, wrenches, time
        As for `inverse_dynamics`.
    frame : {"link", "base"}, default "link"
        Axes of the components: those of the moved link, where the rates are the rates of the components, or those of
        the base.
    fixed : sequence of str, optional
        Fixed joints to include, such as the joint of a force sensor between flange and tool, or that of a base bolted
        to the ground.

    Returns
    -------
    array of shape (..., order - 1, bodies, 6)
        Force, N, and moment about the origin of the link, N m, by s, that the parent exerts through the joint on each
        of `robot.moving_links`, then on the children of the `fixed` joints in their order.

    Raises
    ------
    RobotError
        If q or a wrench does not fit the robot, or `fixed` names a joint that is not fixed.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(2.0, center_of_mass=[0.5, 0, 0])
    >>> links, pin = [jn.Link("base"), jn.Link("rod", rod)], jn.Joint("pin", "base", "rod", axis=[0, -1, 0])
    >>> jn.robot.joint_wrenches(jn.Robot("pendulum", links, [pin]), [[0.0], [0.0], [0.0]])[0, 0].round(12).tolist()
    [0.0, 0.0, 19.62, 0.0, -9.81, 0.0]
    """
    check_choice("frame", frame, FRAMES, RobotError)
    q = checked_coordinates(robot, q, 2)
    links = [*robot.moving_links, *(robot.joints[name].child for name in _checked_fixed(robot, fixed))]
    if fixed:
        robot, q = _with_held_joints(robot, q, fixed)
    arrays, static = _applied(robot, q, wrenches, time)
    rotations = [robot.frames[link].rotation for link in robot.moving_links]
    aligned = np.moveaxis(np.array(rotations).reshape(-1, 3, 3), 0, -1)
    body_wrenches = _joint_wrenches(robot, arrays[0], (arrays[1], aligned), (*static, frame == "base"))
    return body_wrenches[..., [robot.moving_links.index(link) for link in links], :] if fixed else body_wrenches


def _checked_fixed(robot: Robot, names: Sequence[str]) -> Sequence[str]:
    """Return the names of fixed joints, or raise RobotError if one is unknown, not fixed or repeated."""
    if isinstance(names, str) or not isinstance(names, Sequence):
        raise RobotError("must be a list of names of fixed joints", name="fixed", value=names)
    fixed_joints = [name for name, joint in robot.joints.items() if not joint.moving]
    for name in names:
        check_name("fixed joint", name, fixed_joints, RobotError, name="fixed")
    if len(set(names)) < len(names):
        raise RobotError("a joint is there twice", name="fixed", value=list(names))
    return names


def _with_held_joints(robot: Robot, q: Any, names: Sequence[str]) -> tuple[Robot, Any]:
    """Return the robot with revolute joints, held at zero, in place of fixed joints, and its coordinates."""
    joints = [
        dataclasses.replace(joint, type="continuous", axis=(0, 0, 1)) if name in names else joint
        for name, joint in robot.joints.items()
    ]
    released = robot.changed(joints=joints, strict=False)  # a fixed link may be a frame without mass
    column = {name: k for k, name in enumerate(robot.joint_names)}
    library = jnp if is_traced(q) else np
    wider = library.concatenate(
        [q, library.zeros((*q.shape[:-1], 1))], axis=-1
    )  # the last column is that of all held joints
    return released, wider[..., [column.get(name, len(column)) for name in released.joint_names]]


def _applied(
    robot: Robot, q: Any, wrenches: Sequence[Wrench], time: ArrayLike | None, *, free: bool = False
) -> tuple[Any, Any]:
    """Return the arrays, the constants and the static arguments of a program with wrenches."""
    values = wrench_arrays(robot, wrenches, q.shape[:-2], q.shape[-2] - 2, time, free=free)
    frames = tuple(frame_at(robot, wrench.link, wrench.point) for wrench in wrenches)
    return ((q, *values), frames), (tuple(wrench.frame == "base" for wrench in wrenches),)


def _on_bodies(
    tree: Tree,
    arrays: tuple[Any, ...],
    link_frames: tuple[Frame, ...],
    global_axes: tuple[bool, ...],
    scene: tuple[Jet, Jet, Jet] | None = None,
) -> BodyWrenches | None:
    """Return external wrenches about the origins of bodies, in body frames, that of the base last; None without any.

    The lift of bodies that feel less than all of gravity counts as a wrench. For a base that turns, `scene` has the
    axes of the scene in base axes.
    """
    q, *wrenches = arrays
    lifted = tree.shape.lifted
    if not wrenches and not lifted:
        return None
    levels = q.shape[0] - 2
    frames: Any = body_frames(tree, q[:levels]) if any(global_axes) or lifted else None
    loads = jnp.zeros((levels, tree.shape.bodies + 1, 6, q.shape[-1]))
    if lifted:
        gravity = jnp.asarray(tree.gravity)[:, None]
        fall = Jet.constant(gravity, levels - 1) if scene is None else in_base(scene, gravity).truncate(levels - 1)
        local = frames.to_body(fall.map(lambda c: c[:, None]))
        force = local * (-jnp.asarray(tree.lift))[:, None]
        moment = cross(local, jnp.swapaxes(jnp.asarray(tree.lift_moment), 0, 1)[:, :, None])
        lifts = stacked(concatenate([force, moment]))  # levels, components, bodies, batch
        loads = loads + jnp.swapaxes(jnp.broadcast_to(lifts, (*lifts.shape[:-1], q.shape[-1])), 1, 2)
    for values, (body, point, rotation), in_scene in zip(wrenches, link_frames, global_axes, strict=True):
        force, torque = Jet(tuple(values[:, :3])), Jet(tuple(values[:, 3:]))
        if in_scene:
            frame = frames.take(body)
            if scene is not None:
                force, torque = (total(u * x[i : i + 1] for i, u in enumerate(scene)) for x in (force, torque))
            force, torque = frame.to_body(force), frame.to_body(torque)
        else:
            force, torque = (matvec(rotation[:, :, None], x) for x in (force, torque))
        moment = torque + cross(point[:, None], force)
        loads = loads + of_one_body(stacked(concatenate([force, moment])), body, tree.shape.bodies + 1)
    return loads


@Batched
def generalized_forces(
    tree: Tree, arrays: tuple[Any, ...], frames: tuple[Frame, ...], global_axes: tuple[bool, ...], drives: bool
) -> Float[Numbers, "levels coordinate batch"]:
    """Return the joint torques of `inverse_dynamics` as Taylor coefficients."""
    q = arrays[0]
    applied = _on_bodies(tree, arrays, frames, global_axes)
    applied = None if applied is None else applied[:, :-1]
    forces = to_coordinates(tree, recursive_newton_euler(tree, q, applied)[0])
    return forces + _of_drives(tree, q) if drives else forces


def _of_drives(tree: Tree, q: Any) -> Any:
    coordinates = Jet(tuple(q))
    rate = coordinates.differentiate()
    acceleration = rate.differentiate()
    inertial = inertial_forces(tree, coordinates, rate, acceleration)
    return stacked(inertial + passive_forces(tree, coordinates, rate, acceleration.order))


@Batched
def _forces_of_free_tree(
    tree: Tree, arrays: tuple[Any, ...], constants: Any, global_axes: tuple[bool, ...], drives: bool
) -> Float[Numbers, "levels row batch"]:
    q, *wrenches, pose, twist = arrays
    frames, body = constants
    scene = scene_axes(pose[0, 3:], twist)
    applied = _on_bodies(tree, (q, *wrenches), frames, global_axes, scene)
    base_velocity = twist[:, 3:], twist[:, :3] + free_fall_velocity(scene, tree.gravity, len(twist))
    on_bodies = None if applied is None else applied[:, :-1]
    joint_forces, _, _, transmitted = recursive_newton_euler(tree, q, on_bodies, base_velocity)
    forces = to_coordinates(tree, joint_forces)
    w, v = (Jet(tuple(x)) for x in base_velocity)
    of_base = inertial_wrench(jnp.asarray(body.mass), jnp.asarray(body.center), jnp.asarray(body.inertia), w, v)
    at_base = jnp.concatenate([stacked(a) + b for a, b in zip(of_base, transmitted, strict=True)], axis=1)
    at_base = at_base if applied is None else at_base - applied[:, -1]
    return jnp.concatenate([at_base, forces + _of_drives(tree, q) if drives else forces], axis=1)


@Batched
def _joint_wrenches(
    tree: Tree, arrays: tuple[Any, ...], constants: Any, global_axes: tuple[bool, ...], in_base: bool
) -> BodyWrenches:
    q = arrays[0]
    link_frames, aligned = constants
    applied = _on_bodies(tree, arrays, link_frames, global_axes)
    applied = None if applied is None else applied[:, :-1]
    _, force, moment, _ = recursive_newton_euler(tree, q, applied)
    vectors = [Jet(tuple(jnp.swapaxes(x, 1, 2))) for x in (force, moment)]  # components, bodies, batch
    if in_base:
        frames = body_frames(tree, q[:-2])
        rotated = [frames.without_base().direction(vector) for vector in vectors]
    else:
        rotated = [vector.map(lambda c: jnp.einsum("ijb,ibs->jbs", aligned, c)) for vector in vectors]
    return jnp.swapaxes(stacked(concatenate(rotated)), 1, 2)
