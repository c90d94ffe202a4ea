"""Forces of drives: armature, damping and Coulomb friction of joints, springs and tendons, and drives of balls.

They are written once on jets; the equations of motion at an instant use jets of order zero.
"""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.jet import Jet, cos, sin
from jounce.jet.algebra import stacked, total
from jounce.robot.model.tree import Tree


def passive_forces(tree: Tree, q: Jet, rate: Jet, order: int) -> Jet:
    """Return the forces against damping, friction and springs, (coordinates, batch); friction jumps at rest.

    Parameters
    ----------
    tree : Tree
        Arrays of the robot.
    q, rate : Jet of shape (coordinates, batch)
        Coordinates and their rates, to the order of the result or beyond.
    order : int
        Order of the result.
    """
    q, rate = q.truncate(order), rate.truncate(order)
    forces = rate * jnp.asarray(tree.damping)[:, None] + _held(_dry(tree.friction, rate, tree.friction_skew), order)
    if tree.shape.tendons:
        line = tree.tendons
        weights = jnp.asarray(line.weights)
        length = q.map(lambda x: weights @ x) - jnp.asarray(line.rest)[:, None]
        lengthening = rate.map(lambda x: weights @ x)
        tensions = length * jnp.asarray(line.stiffness)[:, None] + lengthening * jnp.asarray(line.damping)[:, None]
        tensions = tensions + _held(_dry(line.friction, lengthening), order)
        forces = forces + tensions.map(lambda x: weights.T @ x)
    if tree.shape.balls:
        ball = tree.balls
        axes = _ball_axes(tree, q)
        spin = [_product(axis, _turns_of(tree, rate)) for axis in axes]
        moments = [w * jnp.asarray(ball.damping)[:, None] + _held(_dry(ball.friction, w), order) for w in spin]
        forces = forces + _at_turns(tree, axes, moments)
    return forces


def inertial_forces(tree: Tree, q: Jet, rate: Jet, acceleration: Jet) -> Jet:
    """Return the forces that accelerate armatures, (coordinates, batch), to the order of the accelerations."""
    forces = acceleration * jnp.asarray(tree.armature)[:, None]
    if not tree.shape.armed:
        return forces
    if tree.shape.tendons:
        weights, inertia = jnp.asarray(tree.tendons.weights), jnp.asarray(tree.tendons.armature)[:, None]
        forces = forces + acceleration.map(lambda x: weights.T @ (inertia * (weights @ x)))
    if not tree.shape.balls:
        return forces
    order = acceleration.order
    q, rate = q.truncate(order), rate.truncate(order)
    angle = _turns_of(tree, q)[1]
    sine, cosine = sin(angle), cos(angle)
    (psi, theta, phi), (psi2, theta2, phi2) = _turns_of(tree, rate), _turns_of(tree, acceleration)
    inertia = jnp.asarray(tree.balls.armature)[:, None]
    moments = [
        psi2 - phi2 * sine - phi * theta * cosine,
        theta2 + phi * psi * cosine,
        phi2 - psi2 * sine - psi * theta * cosine,
    ]
    return forces + _to_coordinates(tree, [moment * inertia for moment in moments])


def armature_matrix(tree: Tree, q: Jet) -> Float[Numbers, "order coordinate coordinate batch"]:
    """Return the armature terms of the mass matrix, as Taylor coefficients."""
    inertia_of_joints = jnp.diag(jnp.asarray(tree.armature))
    if tree.shape.armed and tree.shape.tendons:
        weights = jnp.asarray(tree.tendons.weights)
        inertia_of_joints = inertia_of_joints + weights.T @ (jnp.asarray(tree.tendons.armature)[:, None] * weights)
    inertia_of_joints = inertia_of_joints[:, :, None]
    constant = Jet.constant(jnp.broadcast_to(inertia_of_joints, (*inertia_of_joints.shape[:2], q.shape[-1])), q.order)
    if not (tree.shape.armed and tree.shape.balls):
        return stacked(constant)
    select, inertia = jnp.asarray(tree.balls.select), jnp.asarray(tree.balls.armature)
    diagonal = jnp.einsum("kbi,kbj,b->ij", select, select, inertia)[:, :, None]
    off_diagonal = jnp.einsum("bi,bj,b->ijb", select[0], select[2], inertia)
    off_diagonal = off_diagonal + jnp.swapaxes(off_diagonal, 0, 1)
    mixed = sin(_turns_of(tree, q)[1]).map(lambda x: jnp.einsum("ijb,bs->ijs", off_diagonal, x))
    return stacked(constant + diagonal - mixed)


def spring_energy(tree: Tree, q: Float[Numbers, "coordinate batch"]) -> Float[Numbers, " batch"]:
    """Return the energy stored in springs, J."""
    line = tree.tendons
    length = jnp.asarray(line.weights) @ q - jnp.asarray(line.rest)[:, None]
    return 0.5 * jnp.sum(jnp.asarray(line.stiffness)[:, None] * length * length, axis=0)


def tendon_energy(tree: Tree, rate: Jet) -> Jet:
    """Return the kinetic energy of each tendon from the rates of coordinates, (tendons, batch), J."""
    weights = jnp.asarray(tree.tendons.weights)
    lengthening = rate.map(lambda x: weights @ x)
    return lengthening * lengthening * (0.5 * jnp.asarray(tree.tendons.armature)[:, None])


def ball_spin(tree: Tree, q: Jet, rate: Jet) -> Jet:
    """Return the relative angular velocity of balls in the axes of the link that carries them, (3, balls, batch)."""
    first, second, _ = _turns_of(tree, q)
    psi, theta, phi = _turns_of(tree, rate)
    s_theta, c_theta, s_psi, c_psi = sin(second), cos(second), sin(first), cos(first)
    spin = [phi * c_theta * c_psi - theta * s_psi, phi * c_theta * s_psi + theta * c_psi, psi - phi * s_theta]
    return Jet(jnp.stack(level) for level in zip(*(component.dense().coefficients for component in spin), strict=True))


def _held(values: Any, order: int) -> Jet:
    return Jet.constant(values, order)


def _dry(friction: Any, rate: Jet, skew: Any = None) -> Any:
    """Return Coulomb friction by the sign of the rate, zero at rest."""
    sign = jnp.sign(rate.coefficients[0])
    force = jnp.asarray(friction)[:, None] * sign
    return force if skew is None else force + jnp.asarray(skew)[:, None] * jnp.abs(sign)


def _turns_of(tree: Tree, values: Jet) -> list[Jet]:
    """Return the values of the three turns of each ball, each of shape (balls, batch)."""
    select = jnp.asarray(tree.balls.select)
    return [values.map(lambda x, k=k: select[k] @ x) for k in range(3)]


def _product(a: list[Jet], b: list[Jet]) -> Jet:
    return total(x * y for x, y in zip(a, b, strict=True))


def _ball_axes(tree: Tree, q: Jet) -> list[list[Jet]]:
    """Return the factors of the rates of turns z, y, x in each component of the spin, in axes of the moved link."""
    _, theta, phi = _turns_of(tree, q)
    s, c, s_phi, c_phi = sin(theta), cos(theta), sin(phi), cos(phi)
    zero, one = Jet.constant(jnp.zeros(theta.shape), q.order), Jet.constant(jnp.ones(theta.shape), q.order)
    return [[-s, zero, one], [c * s_phi, c_phi, zero], [c * c_phi, -s_phi, zero]]


def _at_turns(tree: Tree, axes: list[list[Jet]], moments: list[Jet]) -> Jet:
    """Return the generalized forces of moments in the axes of the moved links."""
    turn_moments = [_product([axes[i][k] for i in range(3)], moments) for k in range(3)]
    return _to_coordinates(tree, turn_moments)


def _to_coordinates(tree: Tree, moments: list[Jet]) -> Jet:
    select = jnp.asarray(tree.balls.select)
    by_turn = [moment.map(lambda x, k=k: select[k].T @ x) for k, moment in enumerate(moments)]
    return by_turn[0] + by_turn[1] + by_turn[2]
