"""Articulated-body inertias of a tree: factorized once, they give the accelerations for any forces.

Featherstone 2008, Rigid Body Dynamics Algorithms, chapter 7. Vectors are in the axes of the base, and moments are about
the origin of each body, so that a step from joint to joint is a shift without rotation.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.modules import Module
from jounce.base.shapes import Numbers
from jounce.jet import cross
from jounce.jet.algebra import total
from jounce.linear_algebra.linear import DenseFactor
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.tree_scan import fill_slots, materialised, read_slot, write_slot
from jounce.robot.recursions.tree_sums import BaseVector, BodyVectors

Joints = Float[Numbers, "body batch"]
"""One number for each moving body, or its joint."""
LEAST_INERTIA = 1e-13  # ratio of the inertia along a joint to that of its articulated body: less is rounding


class RigidInertia(Module):
    """Inertias of bodies in the axes of the base: mass, center of mass from the origin, tensor about the center."""

    mass: Float[Numbers, "*body 1"]
    center: Float[Numbers, "3 *body batch"]
    tensor: Float[Numbers, "3 3 *body batch"]

    def blocks(self) -> tuple[Any, Any, Any]:
        """Return the blocks of the spatial inertia about the origin: rotational, coupling, translational."""
        c, mass = self.center, self.mass[None, None]
        x, y, z = c
        zero = jnp.zeros_like(x)
        coupling = mass * jnp.stack([jnp.stack([zero, -z, y]), jnp.stack([z, zero, -x]), jnp.stack([-y, x, zero])])
        unit = jnp.reshape(jnp.eye(3), (3, 3) + (1,) * (c.ndim - 1))
        rotational = self.tensor + mass * (unit * jnp.sum(c * c, axis=0)[None, None] - c[:, None] * c[None])
        return rotational, coupling, unit * mass * jnp.ones_like(x)[None, None]


class ArticulatedBodies(Module):
    """Factorized articulated-body inertias of a tree; driven joints have no compliance.

    Attributes
    ----------
    axis, arm : array of shape (3, bodies, batch)
        Axis of each joint, and the vector from the origin of the parent to that of the body.
    moment, force : array of shape (3, bodies, batch)
        Moment and force for a unit acceleration of the joint.
    compliance : array of shape (bodies, batch)
        Acceleration of the joint per unit of force along it; zero if it is driven, NaN if it moves no inertia.
    margin : array of shape (bodies, batch)
        Ratio of the inertia along the joint to the largest of its articulated body; not finite if it moves no mass.
    base : tuple of DenseFactor and array of shape (6, batch), optional
        Factor of the scaled inertia of a free base, and the scales.
    """

    tree: Tree
    axis: BodyVectors
    arm: BodyVectors
    moment: BodyVectors
    force: BodyVectors
    compliance: Joints
    margin: Joints
    base: tuple[DenseFactor, Float[Numbers, "6 batch"]] | None

    @classmethod
    def of(
        cls,
        tree: Tree,
        axis: BodyVectors,
        arm: BodyVectors,
        inertia: RigidInertia,
        armature: Float[Numbers, " body"],
        free: Float[Numbers, " body"],
        base: RigidInertia | None = None,
    ) -> "ArticulatedBodies":
        """Return the articulated bodies of a tree in a position.

        Parameters
        ----------
        tree : Tree
            Arrays of the robot.
        axis, arm : array of shape (3, bodies, batch)
            As in the attributes.
        inertia : RigidInertia
            Inertias of the bodies.
        armature, free : array of shape (bodies,)
            Armature inertia of each joint; 0 if its acceleration is given, else 1.
        base : RigidInertia, optional
            Inertia of a free base.
        """

        def inward(state: Any, entry: Any) -> tuple[Any, Any]:
            body, z, r, rigid, drive, is_free = entry
            rotational, coupling, mass = (
                a + b for a, b in zip(rigid.blocks(), read_slot(tree, state, body[0]), strict=True)
            )
            by_turn = _product(rotational, z), _transposed_product(coupling, z)
            by_slide = _product(coupling, z), _product(mass, z)
            if tree.shape.turning and tree.shape.sliding:
                moment, force = (body[2] * a + (1 - body[2]) * b for a, b in zip(by_turn, by_slide, strict=True))
            else:
                moment, force = by_turn if tree.shape.turning else by_slide
            inertia = jnp.sum(z * (body[2] * moment + (1 - body[2]) * force), axis=0) + drive
            trace = body[2] * _trace(rotational) + (1 - body[2]) * _trace(mass) + drive
            margin = inertia / trace
            compliance = jnp.where(margin > LEAST_INERTIA, is_free / inertia, jnp.where(is_free > 0, jnp.nan, 0.0))
            moment, force, compliance = materialised((moment, force, compliance))
            by_moment, by_force = (moment * compliance[None])[None], (force * compliance[None])[None]
            rotational, coupling = rotational - moment[:, None] * by_moment, coupling - moment[:, None] * by_force
            mass = mass - force[:, None] * by_force
            # shift to the origin of the parent
            shift = _rows_crossed(r, coupling)
            coupling = coupling + _rows_crossed(r, mass).swapaxes(0, 1)
            rotational = rotational + shift + _rows_crossed(r, coupling).swapaxes(0, 1)
            passed_inertia = materialised((rotational, coupling, mass))
            if tree.shape.slots > 1:
                state = write_slot(tree, state, body[0], jax.tree.map(jnp.zeros_like, passed_inertia))
                passed_inertia = jax.tree.map(jnp.add, passed_inertia, read_slot(tree, state, body[1]))
            return write_slot(tree, state, body[1], passed_inertia), (moment, force, compliance, margin)

        def by_body(x: Any) -> Any:
            return jnp.moveaxis(x, -2, 0)

        nothing = (jnp.zeros((3, 3, axis.shape[-1])),) * 3
        tree_arrays = (*(jnp.asarray(x) for x in (tree.slot, tree.parent_slot, tree.turning)),)
        bodies = (tree_arrays, by_body(axis), by_body(arm), jax.tree.map(by_body, inertia), armature, free)
        state, body_values = jax.lax.scan(inward, fill_slots(tree, nothing), bodies, reverse=True)
        moment, force, compliance, margin = body_values
        factor = None
        if base is not None:
            base_state = state if tree.shape.slots == 1 else jax.tree.map(lambda x: x[0], state)
            base_inertia = _six_by_six(*(a + b for a, b in zip(base.blocks(), base_state, strict=True)))
            scale = 1.0 / jnp.sqrt(jnp.stack([base_inertia[k, k] for k in range(6)]))
            factor = DenseFactor.of(base_inertia * scale[:, None] * scale[None]), scale
        moment, force = (jnp.moveaxis(x, 0, 1) for x in (moment, force))
        return cls(tree, axis, arm, moment, force, compliance, margin, factor)

    def solve(self, efforts: Joints, at_base: BaseVector | None = None) -> tuple[Joints, BaseVector | None]:
        """Return the accelerations that forces along the joints cause, and that of a free base.

        Parameters
        ----------
        efforts : array of shape (bodies, batch)
            Force or torque along each joint.
        at_base : array of shape (6, batch), optional
            Moment about the origin of a free base, and force on it.

        Returns
        -------
        joints : array of shape (bodies, batch)
        base : array of shape (6, batch) or None
            Angular acceleration of the base, and acceleration of its origin.
        """
        tree = self.tree
        turning = jnp.asarray(tree.turning)

        def inward(state: Any, entry: Any) -> tuple[Any, Any]:
            (slot, parent_slot, turn), z, r, moment, force, compliance, effort = entry
            m, f = read_slot(tree, state, slot)
            net_force = effort - jnp.sum(z * (turn * m + (1 - turn) * f), axis=0)
            effort = (net_force * compliance)[None]
            m, f = m + moment * effort, f + force * effort
            passed_wrench = m + cross(r, f), f
            if tree.shape.slots > 1:
                state = write_slot(tree, state, slot, jax.tree.map(jnp.zeros_like, passed_wrench))
                passed_wrench = jax.tree.map(jnp.add, passed_wrench, read_slot(tree, state, parent_slot))
            return write_slot(tree, state, parent_slot, passed_wrench), net_force

        def outward(state: Any, entry: Any) -> tuple[Any, Any]:
            (slot, parent_slot, turn), z, r, moment, force, compliance, net_force = entry
            spin, shift = read_slot(tree, state, parent_slot)
            shift = shift + cross(spin, r)
            rate = compliance * (net_force - jnp.sum(moment * spin + force * shift, axis=0))
            spin, shift = spin + z * (turn * rate)[None], shift + z * ((1 - turn) * rate)[None]
            return write_slot(tree, state, slot, (spin, shift)), rate

        tree_arrays = (jnp.asarray(tree.slot), jnp.asarray(tree.parent_slot), turning)
        rows = (jnp.moveaxis(x, 1, 0) for x in (self.axis, self.arm, self.moment, self.force))
        bodies = (tree_arrays, *rows, self.compliance)
        nothing = jnp.zeros((3, self.axis.shape[-1]))
        state, net_force = jax.lax.scan(inward, fill_slots(tree, (nothing, nothing)), (*bodies, efforts), reverse=True)
        start, base = (nothing, nothing), None
        if self.base is not None and at_base is not None:
            base_state = state if tree.shape.slots == 1 else jax.tree.map(lambda x: x[0], state)
            inertia, scale = self.base
            base = inertia.solve((at_base - jnp.concatenate(base_state)) * scale) * scale
            start = base[:3], base[3:]
        _, rate = jax.lax.scan(outward, fill_slots(tree, start), (*bodies, net_force))
        return rate, base


def _product(matrix: Any, vector: Any) -> Any:
    return total(matrix[:, k] * vector[k : k + 1] for k in range(3))


def _transposed_product(matrix: Any, vector: Any) -> Any:
    return total(matrix[k] * vector[k : k + 1] for k in range(3))


def _rows_crossed(vector: Any, matrix: Any) -> Any:
    """Return the matrix whose rows are the cross products of a vector with the rows of a matrix."""
    return cross(vector[:, None], jnp.swapaxes(matrix, 0, 1)).swapaxes(0, 1)


def _trace(matrix: Any) -> Any:
    return matrix[0, 0] + matrix[1, 1] + matrix[2, 2]


def _six_by_six(rotational: Any, coupling: Any, mass: Any) -> Any:
    upper = jnp.concatenate([rotational, coupling], axis=1)
    return jnp.concatenate([upper, jnp.concatenate([jnp.swapaxes(coupling, 0, 1), mass], axis=1)])
