"""The mass matrix and the bias forces of a robot with their rates: ``tau = M q'' + bias``, on jets.

Everything follows from the partial velocities of the bodies, what the rate of a joint does to each of them. The mass
matrix is their products weighted by the masses, and the work along them is the force of a joint. Their own rates times
the rates of the joints are the accelerations that remain where those of the joints are zero.
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
ABREAST = 8  # coordinates by which the mass matrix is differentiated side by side


def centers_of(tree: Tree, frames: Frames) -> Jet:
    """Return the centers of mass of the bodies, shape (3, bodies, batch)."""
    return frames.point(jnp.swapaxes(jnp.asarray(tree.center), 0, 1)[:, :, None])


def times_inertia(tree: Tree, frames: Frames, vector: Jet) -> Jet:
    """Return the inertia tensors of the bodies about their centers times a vector of each, (3, ..., bodies, batch)."""
    between = (1,) * (len(vector.shape) - 3)
    frames = jax.tree.map(lambda c: jnp.reshape(c, (3, *between, *c.shape[1:])), frames)
    tensor = jnp.moveaxis(jnp.asarray(tree.inertia), 0, -1)
    tensor = jnp.reshape(tensor, (3, 3, *between, tensor.shape[-1], 1))
    local = components(frames.to_body(vector))
    return frames.direction(total(tensor[:, i] * part for i, part in enumerate(local)))


def partial_velocities(tree: Tree, frames: Frames) -> tuple[Jet, Jet]:
    """Return the velocities of the centers of mass and the angular velocities that the rate of each joint causes.

    Both for a rate of one, of shape (3, joints, bodies, batch); zero for bodies that the joint does not move.
    """
    axis, origin = (jet.map(lambda c: c[:, :, None]) for jet in (frames.axes[2], frames.position))
    center = centers_of(tree, frames).map(lambda c: c[:, None])
    turning = jnp.asarray(tree.turning)[:, None, None]
    moved = jnp.swapaxes(jnp.asarray(tree.ancestors)[:-1], 0, 1)[:, :, None]
    linear = cross(axis, center - origin) * turning + axis * (1 - turning)
    return linear * moved, axis * (turning * moved)


def work(partial: tuple[Jet, Jet], force: Jet, moment: Jet | None = None) -> BodySeries:
    """Return the forces of the joints that do the work of forces on all bodies.

    Forces at the centers of mass, and moments, are of shape (3, bodies, batch), in the axes of the base.
    """
    done = [dot(p, f.map(lambda c: c[:, None])) for p, f in zip(partial, (force, moment), strict=True) if f is not None]
    return stacked(total(done).map(lambda c: jnp.sum(c, axis=1)))


def work_of_weight(tree: Tree, frames: Frames) -> BodySeries:
    """Return the forces of the joints that hold the bodies against gravity."""
    weight = jnp.asarray(tree.gravity)[:, None, None] * jnp.asarray(tree.mass)[None, :, None]
    order = frames.position.order
    partial = partial_velocities(tree, frames)
    if not tree.shape.lifted:
        return work(partial, Jet.constant(-weight, order))
    lift, moment = jnp.asarray(tree.lift)[:-1], jnp.asarray(tree.lift_moment)[:-1]
    down = jnp.broadcast_to(jnp.asarray(tree.gravity)[:, None, None], weight.shape)
    off = moment - lift[:, None] * jnp.asarray(tree.center)  # of the mass that is lifted, about the center of all
    arm = frames.direction(jnp.swapaxes(off, 0, 1)[:, :, None])
    return work(partial, Jet.constant(lift[None, :, None] * down - weight, order), cross(arm, down))


def work_of_motion(tree: Tree, q: Series, frames: Frames) -> Float[Numbers, "order-1 body batch"]:
    """Return the forces of the joints that velocities alone need.

    They are those of the inertia of bodies that move while the rates of the joints do not change.
    """
    partial = partial_velocities(tree, frames)
    rate = Jet(tuple(joint_coordinates(tree, q)[:, :, None])).differentiate()
    left = [(p.differentiate() * rate).map(lambda c: jnp.sum(c, axis=1)) for p in partial]
    spin = frames.angular_velocity
    assert spin is not None  # there are velocities
    moment = times_inertia(tree, frames, left[1]) + cross(spin, times_inertia(tree, frames, spin))
    return work(partial, left[0] * jnp.asarray(tree.mass)[:, None], moment)


def mass_jet(tree: Tree, q: Series) -> Float[jax.Array, "order coordinate coordinate batch"]:
    """Return the mass matrix as Taylor coefficients.

    The element of two joints is the work, along the one nearer to the base, of the momentum of all that the other moves
    at a rate of one (composite bodies: Featherstone 2008, Rigid Body Dynamics Algorithms, section 6.2).
    """
    frames = body_frames(tree, q).without_base()
    linear, angular = partial_velocities(tree, frames)
    axis, origin = frames.axes[2], frames.position
    momentum = linear * jnp.asarray(tree.mass)[:, None]
    arm = centers_of(tree, frames).map(lambda c: c[:, None]) - origin.map(lambda c: c[:, :, None])
    about = times_inertia(tree, frames, angular) + cross(arm, momentum)
    momentum, about = (jet.map(lambda c: jnp.sum(c, axis=2)[:, None]) for jet in (momentum, about))
    nearer, from_nearer = (jet.map(lambda c: c[:, :, None]) for jet in (axis, origin))
    turning = jnp.asarray(tree.turning)[:, None, None]
    lever = origin.map(lambda c: c[:, None]) - from_nearer
    moment = (about + cross(lever, momentum)) * turning
    moves = jnp.swapaxes(jnp.asarray(tree.ancestors)[:-1], 0, 1)[:, :, None]
    half = stacked(dot(nearer, moment + momentum * (1 - turning)) * moves)
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
        """Return how the coordinate k changes its own column of the matrix, and the diagonal."""
        change = slope(jnp.zeros_like(q).at[0, k].set(1.0))
        return change[:, :, k], jnp.einsum("ljjs->ljs", change)

    # a few at a time: all slopes at once take the cube of the number of coordinates in memory, 4 GB for 150
    columns, diagonals = jax.lax.map(by_coordinate, jnp.arange(tree.shape.coordinates), batch_size=ABREAST)
    symbols = jnp.moveaxis(columns, 0, 2) - 0.5 * jnp.moveaxis(diagonals, 0, 1)  # levels, i, j, batch
    forces = Jet(tuple(symbols)) * (rate * rate)[None]
    return stacked(forces.map(lambda c: jnp.sum(c, axis=1)))


@Batched
def mass_matrix_of_tree(tree: Tree, arrays: tuple[Series], _: Any, drives: bool) -> Any:
    """Return the mass matrix, with what drives add to it, on Taylor coefficients."""
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
    still = Jet.constant(jnp.zeros(q.shape[1:]), levels - 1)  # turns of a ball that go on drag others along
    return forces + stacked(inertial_forces(tree, coordinates, rate, still))


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
        The robot, with what it holds (`Robot.with_payload`); one with closed loops has no independent coordinates.
    q : array_like of shape (..., n)
        Coordinates in the order of `robot.joint_names`, rad or m, as many positions as there are: unlike for
        `inverse_dynamics`, derivatives must not stand among them, since nothing tells them from positions; give
        ``q[..., 0, :]``. With `rates` of shape (..., order + 1, n): the coordinates and their derivatives.
    rates : bool, default False
        Whether derivatives of the coordinates are given and those of the matrix are requested.
    drives : bool, default True
        Add the armature inertia of the joints, as in `inverse_dynamics`.

    Returns
    -------
    array of shape (..., n, n), or (..., order + 1, n, n) with rates
        kg m^2, kg m or kg, by s; symmetric. A joint that others follow bears their part.

    Raises
    ------
    RobotError
        If q does not fit the robot, or the robot has closed loops.

    Notes
    -----
    By composite bodies on jets (Featherstone 2008, Rigid Body Dynamics Algorithms, section 6.2); the matrix of the
    kinetic energy ``1/2 q'^T M q'`` of Negrean 2025, equations 75-77.

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
    """Return the joint torques or forces that velocities and gravity need, and on request their rates.

    What `inverse_dynamics` gives where all accelerations are zero: ``tau = M q'' + bias``, with `mass_matrix`.

    Parameters
    ----------
    robot : Robot
        The robot, with what it holds (`Robot.with_payload`) and the gravity that it feels; one with closed loops has no
        independent coordinates.
    q : array_like of shape (..., 2, n)
        Coordinates and velocities, in the order of `robot.joint_names`; derivatives beyond do not matter. With `rates`
        of shape (..., order + 1, n), order 1 or more.
    rates : bool, default False
        Whether rates of the forces are requested: each derivative beyond the velocities gives one.
    parts : {"coriolis", "centrifugal", "gravity"} or a sequence of them, default all
        What to add up. Centrifugal forces go with the squares of the velocities of single coordinates, Coriolis forces
        with products of two; the split belongs to the choice of coordinates, and their sum is ``C(q, q') q'``.
    drives : bool, optional
        Add viscous damping and Coulomb friction of the joints, as in `inverse_dynamics`. Unless given, they are added
        to all parts together, and to no part alone.

    Returns
    -------
    array of shape (..., n), or (..., order, n) with rates
        N m, or N for prismatic joints, by s. A joint that others follow bears their part.

    Raises
    ------
    RobotError
        If q does not fit the robot, there is no such part, or the robot has closed loops.

    Notes
    -----
    By the virtual work of inertia and weight: Negrean 2025, equations 81, 124 and 125.

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
