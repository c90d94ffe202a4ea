"""The equations of motion of a tree on plain values: the joint forces for given accelerations.

Vectors are in the axes of the base of the scene, and refer to the origins of the bodies. `jet.programs.series` runs
this program order after order; all operations except sums along branches cover all bodies together.
"""

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.jax_internals import by_certain_entries
from jounce.base.modules import Module, field
from jounce.base.shapes import Numbers
from jounce.jet import Jet, cross
from jounce.jet.algebra import total
from jounce.linear_algebra.linear import DenseFactor
from jounce.rigid.spatial import body_axes, quaternion_change
from jounce.robot.model.tree import Frame, Tree
from jounce.robot.recursions.articulated_bodies import ArticulatedBodies, RigidInertia
from jounce.robot.recursions.drive_forces import (
    ball_spin,
    inertial_forces,
    passive_forces,
    spring_energy,
    tendon_energy,
)
from jounce.robot.recursions.newton_euler import Turn
from jounce.robot.recursions.tree_scan import at_joints, fill_slots, of_one_body, read_slot, to_coordinates, write_slot
from jounce.robot.recursions.tree_sums import sums_at_parents, totals

Coordinates = Float[Numbers, "coordinate batch"]
Wrenches = tuple[Float[Numbers, "6 batch"], ...]
"""Force and torque of each external wrench."""


class FreeBase(NamedTuple):
    """The pose and twist of a free base.

    Attributes
    ----------
    position : array of shape (3, batch)
        Position of the origin, m.
    quaternion : array of shape (4, batch)
        Unit quaternion, scalar first.
    axes : array of shape (3, 3, batch)
        Rotation matrix.
    twist : array of shape (6, batch)
        Velocity of the origin and angular velocity, in the axes of the base, m/s and rad/s.
    """

    position: Numbers
    quaternion: Numbers
    axes: Numbers
    twist: Numbers


class TreeState(NamedTuple):
    """The position and velocity of a tree.

    Attributes
    ----------
    coordinates, rates : array of shape (coordinates, batch)
        Coordinates and their rates, rad or m, and by s.
    axes : array of shape (3, 3, bodies, batch)
        Rotation matrices of the bodies.
    arm : array of shape (3, bodies, batch)
        Vector from the origin of the parent of each body to that of the body, m.
    base : FreeBase or None
    """

    coordinates: Numbers
    rates: Numbers
    axes: Numbers
    arm: Numbers
    base: FreeBase | None


class Unknowns(NamedTuple):
    """Accelerations of the coordinates and rates of the components of the twist of a free base, or forces."""

    joints: Float[Numbers, "coordinate batch"]
    base: Float[Numbers, "6 batch"] | None


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class BaseBody:
    """The mass of a free base, its center of mass, and its inertia about that center, in the axes of the base."""

    mass: Any
    center: Any
    inertia: Any


class TreeEquations(Module):
    """The equations of motion of a tree.

    Parameters
    ----------
    tree : Tree
        Arrays of the robot.
    driven : array of shape (coordinates,)
        1 for a given acceleration, 0 for a given force.
    base : BaseBody, optional
        Mass properties of a free base.
    frames : tuple of Frame
        Frames at which external wrenches act, with the axes of their components.
    global_axes : tuple of bool
        Whether the components of wrenches are in the axes of the scene.
    drives : bool
        Whether to include armature, damping and friction of drives.
    """

    tree: Tree
    driven: Any
    base: BaseBody | None = None
    frames: tuple[Frame, ...] = ()
    global_axes: tuple[bool, ...] = field(static=True, default=())
    drives: bool = field(static=True, default=False)

    @by_certain_entries()
    def motion(self, coordinates: Coordinates, rates: Coordinates, base: FreeBase | None = None) -> TreeState:
        """Return the state of all bodies from coordinates and rates."""
        tree, lanes = self.tree, coordinates.shape[-1]
        joints = at_joints(tree, coordinates) + (0.0 if tree.shape.direct else jnp.asarray(tree.offset)[:, None])
        turn = Turn.of(tree, Jet([joints[:, None]]))

        def outward(state: Any, entry: Any) -> tuple[Any, Any]:
            slot, parent_slot, position, slides, rotation, coordinate = entry
            parent = read_slot(tree, state, parent_slot)
            columns = [total(parent[:, k] * rotation.matrix[k, j][None] for k in range(3)) for j in range(3)]
            axes = jnp.stack(columns, axis=1)
            arm = total(parent[:, k] * position[k] for k in range(3)) + axes[:, 2] * (slides * coordinate)[None]
            return write_slot(tree, state, slot, axes), (axes, arm)

        start = jnp.broadcast_to(jnp.eye(3)[..., None], (3, 3, lanes)) if base is None else base.axes
        tree_arrays = (tree.slot, tree.parent_slot, tree.position, 1 - jnp.asarray(tree.turning))
        bodies = (*map(jnp.asarray, tree_arrays), turn, joints)
        _, (axes, arm) = jax.lax.scan(outward, fill_slots(tree, start), bodies)
        return TreeState(coordinates, rates, jnp.moveaxis(axes, 0, 2), jnp.moveaxis(arm, 0, 1), base)

    @by_certain_entries()
    def factored(self, motion: TreeState) -> "TreeFactor":
        """Return the factored inertia at a position, which gives accelerations for forces, for all orders."""
        tree = self.tree
        armature = jnp.asarray(tree.armature) if self.drives else jnp.zeros(tree.shape.coordinates)
        free = 1.0 - jnp.asarray(self.driven)
        if tree.shape.direct and not tree.shape.armed:
            inertia = _turned_inertia(motion.axes, tree.mass, tree.center, tree.inertia)
            base = None
            if self.base is not None and motion.base is not None:
                base = _turned_inertia(motion.base.axes, self.base.mass, self.base.center, self.base.inertia)
            bodies = ArticulatedBodies.of(tree, motion.axes[:, 2], motion.arm, inertia, armature, free, base)
            return TreeFactor(bodies, None, free, motion.base)
        return TreeFactor(None, self._coupled(motion, free), free, motion.base)

    def _coupled(self, motion: TreeState, is_free: Any) -> tuple[DenseFactor, Any]:
        """Return the factored mass matrix of a tree whose drives or followers couple joints, scaled, and the scales."""
        lanes, count = motion.axes.shape[-1], self.tree.shape.coordinates
        size = count + (6 if motion.base is not None else 0)
        zero = Unknowns(jnp.zeros((count, lanes)), None if motion.base is None else jnp.zeros((6, lanes)))
        _, slope = jax.linearize(partial(self.needed, motion), zero)
        units = jnp.broadcast_to(jnp.eye(size)[..., None], (size, size, lanes))
        directions = Unknowns(units[:, :count], None if motion.base is None else units[:, count:])
        matrix = jnp.concatenate([x for x in jax.vmap(slope)(directions) if x is not None], axis=1)
        mask = jnp.concatenate([is_free, jnp.ones(size - count)])[:, None]
        matrix = matrix * mask[:, None] * mask[None]
        matrix = matrix + jnp.eye(size)[..., None] * (1.0 - mask[:, None])
        scale = 1.0 / jnp.sqrt(jnp.stack([matrix[k, k] for k in range(size)]))
        return DenseFactor.of(matrix * scale[:, None] * scale[None]), scale

    @by_certain_entries()
    def needed(self, motion: TreeState, unknowns: Unknowns, wrenches: Wrenches = ()) -> Unknowns:
        """Return the forces for accelerations: of the coordinates, and on a free base, in its axes."""
        tree, lanes, base = self.tree, motion.axes.shape[-1], motion.base
        turning = jnp.asarray(tree.turning)[None, :, None]
        z, arm = motion.axes[:, 2], motion.arm
        rates, accelerations = at_joints(tree, motion.rates)[None], at_joints(tree, unknowns.joints)[None]
        shift0 = jnp.broadcast_to(-jnp.asarray(tree.gravity)[:, None], (3, lanes))
        spin0 = spin_rate0 = jnp.zeros((3, lanes))
        if base is not None and unknowns.base is not None:
            v, w = base.twist[:3], base.twist[3:]
            spin0, spin_rate0 = _combined(base.axes, w), _combined(base.axes, unknowns.base[3:])
            shift0 = shift0 + _combined(base.axes, unknowns.base[:3] + cross(w, v))
        turn = z * (turning * rates)
        parent_spin = sums_at_parents(tree, turn, spin0)
        arm_rate = cross(parent_spin, arm)
        spin_rate = cross(parent_spin, turn) + z * (turning * accelerations)
        parent_spin_rate = sums_at_parents(tree, spin_rate, spin_rate0)
        shift = cross(parent_spin_rate, arm)
        if tree.shape.sliding:
            slide = z * ((1 - turning) * rates)
            arm_rate = arm_rate + slide
            shift = shift + cross(parent_spin, slide) + z * ((1 - turning) * accelerations)
        shift = shift + cross(parent_spin, arm_rate)
        acceleration = sums_at_parents(tree, shift, shift0) + shift
        of_bodies, rate = (tree.mass, tree.center, tree.inertia), parent_spin_rate + spin_rate
        force, moment = _of_inertia(motion.axes, of_bodies, parent_spin + turn, rate, acceleration)
        if (external := self._pushed(motion, wrenches)) is not None:
            force, moment = force - external[:3, :-1], moment - external[3:, :-1]
        force, base_force = totals(tree, force)
        moment, base_moment = totals(tree, moment, cross(arm, force))
        joint_forces = jnp.sum(z * moment, axis=0)
        if tree.shape.sliding:
            joint_forces = turning[0] * joint_forces + (1 - turning[0]) * jnp.sum(z * force, axis=0)
        forces = to_coordinates(tree, joint_forces[None])[0]
        if self.drives:
            q, rate, acceleration = (Jet([x]) for x in (motion.coordinates, motion.rates, unknowns.joints))
            drive_forces = inertial_forces(tree, q, rate, acceleration) + passive_forces(tree, q, rate, 0)
            forces = forces + drive_forces.coefficients[0]
        if base is None or self.base is None:
            return Unknowns(forces, None)
        at_base = _of_inertia(base.axes, dataclasses.astuple(self.base), spin0, spin_rate0, shift0)
        base_force, base_moment = base_force + at_base[0], base_moment + at_base[1]
        if external is not None:
            base_force, base_moment = base_force - external[:3, -1], base_moment - external[3:, -1]
        return Unknowns(forces, jnp.concatenate([_local(base.axes, x) for x in (base_force, base_moment)]))

    @by_certain_entries()
    def motion_rates(self, motion: TreeState, unknowns: Unknowns) -> TreeState:
        """Return the rates of all parts of a state."""
        tree, base = self.tree, motion.base
        turning = jnp.asarray(tree.turning)[None, :, None]
        z, rates = motion.axes[:, 2], at_joints(tree, motion.rates)[None]
        base_rates, spin0 = None, jnp.zeros((3, motion.axes.shape[-1]))
        if base is not None and unknowns.base is not None:
            v, w = base.twist[:3], base.twist[3:]
            spin0 = _combined(base.axes, w)
            change = quaternion_change(base.quaternion, w)
            base_rates = FreeBase(_combined(base.axes, v), change, cross(spin0[:, None], base.axes), unknowns.base)
        turn = z * (turning * rates)
        parent_spin = sums_at_parents(tree, turn, spin0)
        arm = cross(parent_spin, motion.arm)
        if tree.shape.sliding:
            arm = arm + z * ((1 - turning) * rates)
        axes = cross((parent_spin + turn)[:, None], motion.axes)
        return TreeState(motion.rates, unknowns.joints, axes, arm, base_rates)

    def energy(self, motion: TreeState) -> tuple[Float[Numbers, " batch"], Float[Numbers, " batch"]]:
        """Return the kinetic energy, with that of armatures, and the potential energy of gravity and springs, J."""
        tree, base = self.tree, motion.base
        turning = jnp.asarray(tree.turning)[None, :, None]
        place0 = spin0 = velocity0 = jnp.zeros((3, motion.axes.shape[-1]))
        if base is not None:
            place0, spin0 = base.position, _combined(base.axes, base.twist[3:])
            velocity0 = _combined(base.axes, base.twist[:3])
        z, rates = motion.axes[:, 2], at_joints(tree, motion.rates)[None]
        turn = z * (turning * rates)
        parent_spin = sums_at_parents(tree, turn, spin0)
        shift = cross(parent_spin, motion.arm) + z * ((1 - turning) * rates)
        velocity = sums_at_parents(tree, shift, velocity0) + shift
        position = sums_at_parents(tree, motion.arm, place0) + motion.arm
        of_bodies = (tree.mass, tree.center, tree.inertia)
        energies = [_energies(motion.axes, of_bodies, parent_spin + turn, velocity, position, tree.gravity)]
        if base is not None and self.base is not None:
            base_inertia = dataclasses.astuple(self.base)
            energies.append(_energies(base.axes, base_inertia, spin0, velocity0, place0, tree.gravity))
        kinetic, potential = (total(body_energies[k] for body_energies in energies) for k in (0, 1))
        if tree.shape.lifted:
            axes, positions = (_with_base(a, b, base) for a, b in ((motion.axes, "axes"), (position, "position")))
            moments = positions * jnp.asarray(tree.lift)[None, :, None]
            moments = moments + _combined(axes, jnp.swapaxes(jnp.asarray(tree.lift_moment), 0, 1)[:, :, None])
            potential = potential + jnp.sum(jnp.asarray(tree.gravity)[:, None, None] * moments, axis=(0, 1))
        if self.drives:
            armature = jnp.asarray(tree.armature)[:, None]
            kinetic = kinetic + 0.5 * jnp.sum(armature * motion.rates * motion.rates, axis=0)
            if tree.shape.balls:
                spin = ball_spin(tree, Jet([motion.coordinates]), Jet([motion.rates])).coefficients[0]
                inertia = jnp.asarray(tree.balls.armature)[None, :, None]
                kinetic = kinetic + 0.5 * jnp.sum(inertia * spin * spin, axis=(0, 1))
            if tree.shape.tendons:
                potential = potential + spring_energy(tree, motion.coordinates)
                kinetic = kinetic + jnp.sum(tendon_energy(tree, Jet([motion.rates])).coefficients[0], axis=0)
        return kinetic, potential

    def _pushed(self, motion: TreeState, wrenches: Wrenches) -> Any:
        """Return external forces and moments, with those that balance gravity, on the bodies and, last, the base."""
        tree = self.tree
        if not wrenches and not tree.shape.lifted:
            return None
        axes = _with_base(motion.axes, "axes", motion.base)
        loads = jnp.zeros((6, *axes.shape[2:]))
        if tree.shape.lifted:
            gravity = jnp.broadcast_to(jnp.asarray(tree.gravity)[:, None, None], (3, *axes.shape[2:]))
            moment = _combined(axes, jnp.swapaxes(jnp.asarray(tree.lift_moment), 0, 1)[:, :, None])
            loads = loads - jnp.concatenate([gravity * jnp.asarray(tree.lift)[None, :, None], cross(moment, gravity)])
        for value, (body, point, rotation), in_scene in zip(wrenches, self.frames, self.global_axes, strict=True):
            link_axes = jax.lax.dynamic_index_in_dim(axes, body, 2, keepdims=False)
            force, torque = value[:3], value[3:]
            if not in_scene:
                frame = jnp.stack([total(link_axes[:, k] * rotation[k, j] for k in range(3)) for j in range(3)], axis=1)
                force, torque = _combined(frame, force), _combined(frame, torque)
            arm = total(link_axes[:, k] * point[k] for k in range(3))
            loads = loads + of_one_body(jnp.concatenate([force, torque + cross(arm, force)]), body, loads.shape[1])
        return loads


class TreeFactor(Module):
    """The factored inertia of a tree: by articulated bodies, or as a dense matrix if joints are coupled."""

    bodies: ArticulatedBodies | None
    dense: tuple[DenseFactor, Any] | None
    free: Any
    base: FreeBase | None

    @property
    def margin(self) -> Float[Numbers, "joint batch"]:
        """Margin of each joint and of a free base, or of the whole, to a singular inertia; see `ArticulatedBodies`."""
        if self.bodies is None:
            assert self.dense is not None
            return self.dense[0].pivot_ratio()[None]
        if self.bodies.base is None:
            return self.bodies.margin
        return jnp.concatenate([self.bodies.margin, self.bodies.base[0].pivot_ratio()[None]])

    @by_certain_entries()
    def solve(self, missing: Unknowns) -> Unknowns:
        """Return the accelerations from missing forces, zero for driven joints."""
        if self.bodies is None:
            assert self.dense is not None
            (factor, scale), count = self.dense, len(self.free)
            stacked_forces = [missing.joints * self.free[:, None]] + ([] if missing.base is None else [missing.base])
            solution = factor.solve(jnp.concatenate(stacked_forces) * scale) * scale
            return Unknowns(solution[:count] * self.free[:, None], None if missing.base is None else solution[count:])
        if self.base is None or missing.base is None:
            return Unknowns(self.bodies.solve(missing.joints)[0], None)
        axes = self.base.axes
        force, moment = _combined(axes, missing.base[:3]), _combined(axes, missing.base[3:])
        joints, base = self.bodies.solve(missing.joints, jnp.concatenate([moment, force]))
        assert base is not None
        return Unknowns(joints, jnp.concatenate([_local(axes, base[3:]), _local(axes, base[:3])]))


def _with_base(values: Any, field: str, base: FreeBase | None) -> Any:
    """Return axes or positions of the bodies and, last, of the base; a fixed base coincides with the scene."""
    if base is not None:
        base_value = getattr(base, field)
    else:
        start = jnp.eye(3) if field == "axes" else jnp.zeros(3)
        base_value = jnp.broadcast_to(start[..., None], (*start.shape, values.shape[-1]))
    return jnp.concatenate([values, base_value[..., None, :]], axis=-2)


def free_base(position: Any, quaternion: Any, twist: Any) -> FreeBase:
    """Return a free base from its position, unit quaternion and twist."""
    return FreeBase(position, quaternion, jnp.stack(body_axes(quaternion), axis=1), twist)


def _combined(axes: Any, local: Any) -> Any:
    """Return vectors in the axes of the scene, from those in the axes of each body."""
    return total(axes[:, k] * local[k : k + 1] for k in range(3))


def _local(axes: Any, vector: Any) -> Any:
    return jnp.stack([jnp.sum(axes[:, k] * vector, axis=0) for k in range(3)])


def _columns(values: tuple[Any, Any, Any], is_batch: bool) -> tuple[Any, Any, Any]:
    """Return mass, center and tensor with components first and a batch of size one last."""
    mass, center, tensor = map(jnp.asarray, values)
    if is_batch:
        return mass[None, :, None], jnp.moveaxis(center, 0, -1)[..., None], jnp.moveaxis(tensor, 0, -1)[..., None]
    return mass[None, None], center[:, None], tensor[..., None]


def _turned_inertia(axes: Any, mass: Any, center: Any, tensor: Any) -> RigidInertia:
    mass, center, tensor = _columns((mass, center, tensor), axes.ndim > 3)
    half = [total(axes[:, k] * tensor[k, j][None] for k in range(3)) for j in range(3)]
    rotated = total(half[j][:, None] * axes[None, :, j] for j in range(3))
    return RigidInertia(mass[0], _combined(axes, center), rotated)


def _energies(axes: Any, values: tuple[Any, ...], spin: Any, velocity: Any, position: Any, gravity: Any) -> list[Any]:
    """Return the total kinetic and potential energies of bodies, or of one body."""
    mass, center, tensor = _columns((values[0], values[1], values[2]), axes.ndim > 3)
    arm, w = _combined(axes, center), _local(axes, spin)
    center_velocity, momentum = velocity + cross(spin, arm), total(tensor[:, k] * w[k : k + 1] for k in range(3))
    gravity_ = jnp.reshape(jnp.asarray(gravity), (3,) + (1,) * (arm.ndim - 1))
    kinetic = 0.5 * jnp.sum(mass * center_velocity * center_velocity + w * momentum, axis=0)
    potential = -jnp.sum(mass * gravity_ * (position + arm), axis=0)
    return [jnp.sum(x.reshape(-1, x.shape[-1]), axis=0) for x in (kinetic, potential)]


def _of_inertia(axes: Any, values: tuple[Any, ...], spin: Any, spin_rate: Any, acceleration: Any) -> tuple[Any, Any]:
    """Return the inertial force of bodies in a motion, and its moment about the origin."""
    mass, center, tensor = _columns((values[0], values[1], values[2]), axes.ndim > 3)
    arm = _combined(axes, center)
    force = mass * (acceleration + cross(spin_rate, arm) + cross(spin, cross(spin, arm)))
    w, rate = _local(axes, spin), _local(axes, spin_rate)
    momentum, changed = (total(tensor[:, k] * x[k : k + 1] for k in range(3)) for x in (w, rate))
    return force, _combined(axes, changed + cross(w, momentum)) + cross(arm, force)
