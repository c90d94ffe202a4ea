"""The mass matrix and the bias forces of a robot with their rates: ``tau = M q'' + bias``, on jets.

Everything follows from the partial velocities of the bodies, their velocities for a joint rate of one. The mass matrix
consists of their products, weighted by the masses; the work along them is the force of a joint. Their rates times the
joint rates are the accelerations of the bodies for zero joint accelerations.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Array, ArrayLike, Numbers
from jounce.errors import RobotError, check_choice, flag
from jounce.jet import Jet, components, cross, dot
from jounce.jet.algebra import stacked, total
from jounce.rigid.frames import Frames
from jounce.robot.model.arguments import checked_coordinates, checked_position, stacked_arguments
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.batches import Batched
from jounce.robot.recursions.drive_forces import armature_matrix, inertial_forces, passive_forces
from jounce.robot.recursions.kinematics import body_frames
from jounce.robot.recursions.tree_scan import BodySeries, Series, joint_coordinates, to_coordinates
from jounce.robot.robot import Robot

PARTS = ("coriolis", "centrifugal", "gravity")
ABREAST = 8  # coordinates for which the mass matrix is differentiated together


def centers_of(tree: Tree, frames: Frames) -> Jet:
    """Return the centers of mass of the bodies, shape (3, bodies, batch)."""
    return frames.point(jnp.swapaxes(jnp.asarray(tree.center), 0, 1)[:, :, None])


def times_inertia(tree: Tree, frames: Frames, vector: Jet) -> Jet:
    """Return the inertia tensors of the bodies about their centers times a vector of each body.

    The shape is (3, ..., bodies, batch).
    """
    inserted_axes = (1,) * (len(vector.shape) - 3)
    frames = jax.tree.map(lambda c: jnp.reshape(c, (3, *inserted_axes, *c.shape[1:])), frames)
    tensor = jnp.moveaxis(jnp.asarray(tree.inertia), 0, -1)
    tensor = jnp.reshape(tensor, (3, 3, *inserted_axes, tensor.shape[-1], 1))
    local = components(frames.to_body(vector))
    return frames.direction(total(tensor[:, i] * component for i, component in enumerate(local)))


def partial_velocities(tree: Tree, frames: Frames) -> tuple[Jet, Jet]:
    """Return the velocities of the centers of mass and the angular velocities for a rate of one of each joint.

    Both have the shape (3, joints, bodies, batch); they are zero for bodies that the joint does not move.
    """
    axis, origin = (jet.map(lambda c: c[:, :, None]) for jet in (frames.axes[2], frames.position))
    center = centers_of(tree, frames).map(lambda c: c[:, None])
    turning = jnp.asarray(tree.turning)[:, None, None]
    is_moved = jnp.swapaxes(jnp.asarray(tree.ancestors)[:-1], 0, 1)[:, :, None]
    linear = cross(axis, center - origin) * turning + axis * (1 - turning)
    return linear * is_moved, axis * (turning * is_moved)


def work(partial: tuple[Jet, Jet], force: Jet, moment: Jet | None = None) -> BodySeries:
    """Return the joint forces that do the work of forces on all bodies.

    Forces at the centers of mass, and moments, have the shape (3, bodies, batch), in the axes of the base.
    """
    dots = [dot(p, f.map(lambda c: c[:, None])) for p, f in zip(partial, (force, moment), strict=True) if f is not None]
    return stacked(total(dots).map(lambda c: jnp.sum(c, axis=1)))


def work_of_weight(tree: Tree, frames: Frames) -> BodySeries:
    """Return the joint forces that hold the bodies against gravity."""
    weight = jnp.asarray(tree.gravity)[:, None, None] * jnp.asarray(tree.mass)[None, :, None]
    order = frames.position.order
    partial = partial_velocities(tree, frames)
    if not tree.shape.lifted:
        return work(partial, Jet.constant(-weight, order))
    lift, moment = jnp.asarray(tree.lift)[:-1], jnp.asarray(tree.lift_moment)[:-1]
    gravity = jnp.broadcast_to(jnp.asarray(tree.gravity)[:, None, None], weight.shape)
    excess = moment - lift[:, None] * jnp.asarray(tree.center)  # moment of the lifted mass about the center of mass
    arm = frames.direction(jnp.swapaxes(excess, 0, 1)[:, :, None])
    return work(partial, Jet.constant(lift[None, :, None] * gravity - weight, order), cross(arm, gravity))


def work_of_motion(tree: Tree, q: Series, frames: Frames) -> Float[Numbers, "order-1 body batch"]:
    """Return the joint forces from velocities alone.

    They belong to the inertia of the bodies at constant joint rates.
    """
    partial = partial_velocities(tree, frames)
    rate = Jet(tuple(joint_coordinates(tree, q)[:, :, None])).differentiate()
    remainders = [(p.differentiate() * rate).map(lambda c: jnp.sum(c, axis=1)) for p in partial]
    spin = frames.angular_velocity
    assert spin is not None  # there are velocities
    moment = times_inertia(tree, frames, remainders[1]) + cross(spin, times_inertia(tree, frames, spin))
    return work(partial, remainders[0] * jnp.asarray(tree.mass)[:, None], moment)


def mass_jet(tree: Tree, q: Series) -> Float[jax.Array, "order coordinate coordinate batch"]:
    """Return the mass matrix as Taylor coefficients.

    The element of two joints is the work, along the joint nearer to the base, of the momentum of all bodies that the
    other joint moves at a rate of one (composite bodies: Featherstone 2008, Rigid Body Dynamics Algorithms, 6.2).
    """
    frames = body_frames(tree, q).without_base()
    linear, angular = partial_velocities(tree, frames)
    axis, origin = frames.axes[2], frames.position
    momentum = linear * jnp.asarray(tree.mass)[:, None]
    arm = centers_of(tree, frames).map(lambda c: c[:, None]) - origin.map(lambda c: c[:, :, None])
    angular_momentum = times_inertia(tree, frames, angular) + cross(arm, momentum)
    momentum, angular_momentum = (
        jet.map(lambda c: jnp.sum(c, axis=2)[:, None]) for jet in (momentum, angular_momentum)
    )
    nearer, from_nearer = (jet.map(lambda c: c[:, :, None]) for jet in (axis, origin))
    turning = jnp.asarray(tree.turning)[:, None, None]
    lever = origin.map(lambda c: c[:, None]) - from_nearer
    moment = (angular_momentum + cross(lever, momentum)) * turning
    is_moved = jnp.swapaxes(jnp.asarray(tree.ancestors)[:-1], 0, 1)[:, :, None]
    half = stacked(dot(nearer, moment + momentum * (1 - turning)) * is_moved)
    matrix = half + jnp.swapaxes(half, 1, 2) * (1 - np.eye(tree.shape.bodies))[None, :, :, None]
    if tree.shape.direct:
        return matrix
    weights = to_coordinates(tree, jnp.eye(tree.shape.bodies)[:, :, None])[:, :, 0]
    return jnp.einsum("lijs,ia,jb->labs", matrix, weights, weights)


def centrifugal(tree: Tree, q: Series) -> Float[Numbers, "order-1 coordinate batch"]:
    """Return the part of the forces with squares of rates of single coordinates.

    By Christoffel's symbols: ``(dM_ij/dq_j - 1/2 dM_jj/dq_i) q_j'^2``, summed over j.
    """
    rate = Jet(tuple(q)).differentiate()
    q = q[:-1]
    _, slope = jax.linearize(lambda q: mass_jet(tree, q), q)

    def by_coordinate(k: Any) -> Any:
        """Return the derivatives of column k and of the diagonal of the matrix with respect to coordinate k."""
        change = slope(jnp.zeros_like(q).at[0, k].set(1.0))
        return change[:, :, k], jnp.einsum("ljjs->ljs", change)

    # a few at a time: the memory for all derivatives at once is cubic in the number of coordinates, 4 GB for 150
    columns, diagonals = jax.lax.map(by_coordinate, jnp.arange(tree.shape.coordinates), batch_size=ABREAST)
    symbols = jnp.moveaxis(columns, 0, 2) - 0.5 * jnp.moveaxis(diagonals, 0, 1)  # levels, i, j, batch
    forces = Jet(tuple(symbols)) * (rate * rate)[None]
    return stacked(forces.map(lambda c: jnp.sum(c, axis=1)))


@Batched
def mass_matrix_of_tree(tree: Tree, arrays: tuple[Series], _: Any, drives: bool) -> Any:
    """Return the mass matrix, with the armature of drives, on Taylor coefficients."""
    matrix = mass_jet(tree, arrays[0])
    return matrix + armature_matrix(tree, Jet(tuple(arrays[0]))) if drives else matrix


@Batched
def _bias(tree: Tree, arrays: tuple[Series], _: Any, parts: frozenset[str], drives: bool) -> Any:
    (q,) = arrays
    levels = q.shape[0] - 1
    frames = body_frames(tree, q).without_base()
    forces = jnp.zeros((levels, *q.shape[1:]))
    if "gravity" in parts:
        forces = forces + to_coordinates(tree, work_of_weight(tree, frames)[:levels])
    if "coriolis" in parts:
        forces = forces + to_coordinates(tree, work_of_motion(tree, q, frames))
    if ("coriolis" in parts) != ("centrifugal" in parts):
        sign = 1.0 if "centrifugal" in parts else -1.0
        forces = forces + sign * centrifugal(tree, q)
    if not drives:
        return forces
    coordinates = Jet(tuple(q))
    rate = coordinates.differentiate()
    forces = forces + stacked(passive_forces(tree, coordinates, rate, levels - 1))
    if not tree.shape.armed:
        return forces
    zeros = Jet.constant(jnp.zeros(q.shape[1:]), levels - 1)  # constant rates of a ball still accelerate its drive
    return forces + stacked(inertial_forces(tree, coordinates, rate, zeros))


@stacked_arguments(2, "jn.mass_matrix(robot, q) for pin.crba(model, data, q)")
def mass_matrix(
    robot: Robot, q: ArrayLike, *, rates: bool = False, drives: bool = True
) -> Array[Numbers, "*batch joint joint"]:
    """Return the mass matrix of a robot, and on request its time derivatives to any order, exact to rounding.

    ``tau = M q'' + bias``, with `bias_forces`; and by Leibniz's rule ``tau^(k) = sum_j C(k, j) M^(j) q^(2 + k - j) +
    bias^(k)`` are the rates of `inverse_dynamics`.

    Parameters
    ----------
    robot : Robot
        The robot, with its payload (`Robot.with_payload`), without closed loops.
    q : array_like of shape (..., n)
        Coordinates in the order of `robot.joint_names`, rad or m, for any number of positions. Unlike the argument of
        `inverse_dynamics`, they must not include derivatives, which look like further positions; give
        ``q[..., 0, :]``. With `rates`, of shape (..., order + 1, n): the coordinates and their derivatives.
    rates : bool, default False
        Whether `q` has derivatives and the result has rates of the matrix.
    drives : bool, default True
        Whether to add the armature inertia of the joints, as in `inverse_dynamics`.

    Returns
    -------
    array of shape (..., n, n), or (..., order + 1, n, n) with rates
        Symmetric mass matrix, kg m^2, kg m or kg, by s. A joint includes the inertia of its followers.

    Raises
    ------
    RobotError
        If q does not fit the robot, or the robot has closed loops.

    Notes
    -----
    The method is composite bodies on jets (Featherstone 2008, Rigid Body Dynamics Algorithms, section 6.2). The matrix
    is that of the kinetic energy ``1/2 q'^T M q'`` of Negrean 2025, equations 75-77.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> joints = [jn.Joint("pin", "base", "arm"), jn.Joint("slide", "arm", "rod", "prismatic", axis=[1, 0, 0])]
    >>> robot = jn.Robot("ram", [jn.Link("base"), jn.Link("arm"), jn.Link("rod", rod)], joints)
    >>> jn.mass_matrix(robot, [0.3, 0.5]).round(12).tolist()  # 1/12 + 1^2 about the pin
    [[1.083333333333, 0.0], [0.0, 1.0]]
    >>> jn.mass_matrix(robot, [[0.3, 0.5], [0.0, 2.0]], rates=True)[1].round(12).tolist()  # 2 * 1 * 2
    [[4.0, 0.0], [0.0, 0.0]]
    """
    rates, drives = flag("rates", rates, error=RobotError), flag("drives", drives, error=RobotError)
    q = checked_coordinates(robot, q) if rates else checked_position(robot, q)
    matrix = mass_matrix_of_tree(robot, (q,), (), (drives,))
    return matrix if rates else matrix[..., 0, :, :]


@stacked_arguments(2, "jn.bias_forces(robot, np.stack([q, v])) for pin.nonLinearEffects(model, data, q, v)")
def bias_forces(
    robot: Robot, q: ArrayLike, *, rates: bool = False, parts: str | Sequence[str] = PARTS, drives: bool | None = None
) -> Array[Numbers, "*batch joint"]:
    """Return the joint torques or forces from velocities and gravity, and on request their rates.

    They equal `inverse_dynamics` at zero accelerations: ``tau = M q'' + bias``, with `mass_matrix`.

    Parameters
    ----------
    robot : Robot
        The robot, with its payload (`Robot.with_payload`) and its gravity, without closed loops.
    q : array_like of shape (..., 2, n)
        Coordinates and velocities, in the order of `robot.joint_names`; higher derivatives have no effect. With `rates`
        of shape (..., order + 1, n), order 1 or more.
    rates : bool, default False
        Whether to return rates of the forces, one for each derivative above the velocities.
    parts : {"coriolis", "centrifugal", "gravity"} or a sequence of them, default all
        Parts to add up. Centrifugal forces are proportional to squares of the velocities of single coordinates,
        Coriolis forces to products of two; the split depends on the choice of coordinates, and the sum is
        ``C(q, q') q'``.
    drives : bool, optional
        Whether to add viscous damping and Coulomb friction of the joints, as in `inverse_dynamics`. By default they
        are added to the sum of all parts only.

    Returns
    -------
    array of shape (..., n), or (..., order, n) with rates
        Torques, N m, or forces of prismatic joints, N, by s. A joint includes the forces of its followers.

    Raises
    ------
    RobotError
        If q does not fit the robot, a part does not exist, or the robot has closed loops.

    Notes
    -----
    The method is the virtual work of inertia and weight: Negrean 2025, equations 81, 124 and 125.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> joints = [jn.Joint("pin", "base", "arm"), jn.Joint("slide", "arm", "rod", "prismatic", axis=[1, 0, 0])]
    >>> robot = jn.Robot("ram", [jn.Link("base"), jn.Link("arm"), jn.Link("rod", rod)], joints)
    >>> q = [[0.0, 0.5], [3.0, 2.0]]  # the rod's center is 1 m from the pin
    >>> jn.bias_forces(robot, q, parts="coriolis").round(12).tolist()  # 2 * 3 * 2
    [12.0, 0.0]
    >>> jn.bias_forces(robot, q, parts="centrifugal").round(12).tolist()  # -3^2
    [0.0, -9.0]
    """
    chosen = (parts,) if isinstance(parts, str) or not isinstance(parts, Iterable) else tuple(parts)
    for part in chosen:
        check_choice("part", part, PARTS, RobotError, name="parts")
    rates = flag("rates", rates, error=RobotError)
    drives = set(chosen) == set(PARTS) if drives is None else flag("drives", drives, error=RobotError)
    q = checked_coordinates(robot, q, 1, most=None if rates else 1)
    forces = _bias(robot, (q,), (), (frozenset(chosen), drives))
    return forces if rates else forces[..., 0, :]
