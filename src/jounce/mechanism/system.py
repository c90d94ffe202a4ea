"""A mechanism in numbers: stacked instances, bodies by index, residual and Jacobian of the whole."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

from jounce.base.jax_internals import by_certain_entries
from jounce.base.modules import Module, field, unchecked, with_fields
from jounce.base.shapes import Numbers
from jounce.constraints.friction import check_no_own_code
from jounce.errors import JounceError
from jounce.execution.traced_once import traced_once
from jounce.jet import Jet, concatenate
from jounce.jet.algebra import stacked
from jounce.linear_algebra.elimination_order import Order, elimination_order
from jounce.linear_algebra.fronts import Fronts
from jounce.linear_algebra.pattern import Pattern
from jounce.mechanism.carriages import carriages
from jounce.mechanism.resolve import along_instances, group_key, resolve_element, stack_elements
from jounce.mechanism.user_code import READINGS, has_own_methods, readings_of, users_class, with_readings
from jounce.rigid import SpatialPose
from jounce.rigid.body_arrays import each_jet
from jounce.rigid.pose import Pose
from jounce.trajectory import AbstractMotion

POSITION_COMPONENTS = {"planar": 2, "spatial": 3}


class Group(Module):
    """All joints, drivers, forces or outputs of one type with one structure, evaluated together.

    Parameters
    ----------
    element : AbstractConstraint, AbstractForce or AbstractOutput
        Element with values of shape (..., instances, 1).
    bodies : tuple of tuple of int
        For each body slot, the indices of the bodies of the instances; 0 is the ground.
    """

    element: Any
    bodies: tuple[tuple[int, ...], ...] = field(static=True)

    @property
    def instances(self) -> int:
        """Number of joints, drivers, forces or outputs in the group."""
        return len(self.bodies[0])

    @property
    def is_driver(self) -> bool:
        """Whether the group prescribes motion."""
        return self.element.role == "driver"

    def residual(self, pose: Pose, time: Jet) -> Float[Jet, "row instance batch"]:
        """Return the residuals, shape (rows, instances, batch)."""
        return with_rows(self.element.residual(*self._poses(pose), time))

    def evaluate(self, pose: Pose) -> Float[Jet, "component instance batch"]:
        """Return the outputs, shape (components, instances, batch)."""
        return with_rows(self.element.evaluate(*self._poses(pose)))

    def displacement(self, pose: Pose, time: Jet) -> Float[Jet, "component instance batch"]:
        """Return the displacements of forces, shape (components, instances, batch)."""
        return with_rows(self.element.displacement(*self._poses(pose), time))

    def force(self, pose: Pose, time: Jet) -> Float[Jet, "component instance batch"]:
        """Return the forces, shape (components, instances, batch), one order shorter than the pose."""
        return self._acting(pose, time)[1].truncate(pose.order - 1)

    def finite(self, pose: Pose, time: Jet) -> Bool[Numbers, "instance batch"]:
        """Return whether each force and the velocity on which it does work are finite, shape (instances, batch)."""
        velocity, force = (jnp.isfinite(jet.coefficients[0]).all(axis=0) for jet in self._acting(pose, time))
        return velocity & force

    def power(self, pose: Pose, time: Jet) -> Float[Jet, "instance batch"]:
        """Return the power that forces supply to the mechanism, shape (instances, batch), W."""
        velocity, force = self._acting(pose, time)
        return force.dot(velocity)

    def velocity(self, pose: Pose, time: Jet) -> Float[Jet, "component instance batch"]:
        """Return the velocities on which forces do work, shape (components, instances, batch)."""
        return with_rows(self.element.velocity(*self._poses(pose), time))

    def energy(self, pose: Pose, time: Jet) -> Float[Jet, "instance batch"]:
        """Return the energy that forces store, shape (instances, batch), J."""
        return self.element.energy(self.element.displacement(*self._poses(pose), time))

    def variation(self, pose: Pose, change: Pose, time: Jet) -> Jet:
        """Return the variation of residuals, or of the displacements of forces, for a change of the poses.

        The shape is (rows, instances, batch) or (components, instances, batch).
        """
        return with_rows(self.element.variation(tuple(self._poses(pose)), tuple(self._poses(change)), time))

    def _acting(self, pose: Pose, time: Jet) -> tuple[Jet, Jet]:
        """Return the velocities on which forces do work, and the forces."""
        poses = self._poses(pose)
        displacement, velocity = self.element.displacement(*poses, time), self.element.velocity(*poses, time)
        # without the barrier, XLA computes both again at each use
        displacement, velocity = jax.lax.optimization_barrier((displacement, velocity))
        return with_rows(velocity), with_rows(self.element.force(displacement, velocity, time))

    def derivative_blocks(self, pose: Pose, time: Jet, scale: Float[Numbers, " coordinate"]) -> list[Any]:
        """Return the derivatives of the residuals by the coordinates of the bodies in each moving slot.

        Each block is the linear map from the first-order coefficients of a body to those of the residual, and has the
        shape (coordinates, rows, instances, batch).
        """
        return _derivative_blocks(self.element, self._poses(pose), time, scale, self.moving_slots)

    @property
    def moving_slots(self) -> tuple[int, ...]:
        """Slots with at least one body other than the ground."""
        return tuple(slot for slot, bodies in enumerate(self.bodies) if any(bodies))

    def _poses(self, pose: Pose) -> list[Any]:
        return [pose.take(indices) for indices in self.bodies]


@traced_once(static=(4,))
def _derivative_blocks(
    element: Any, poses: Sequence[Pose], time: Jet, scale: Float[Numbers, " coordinate"], slots: tuple[int, ...]
) -> list[Any]:
    batch, shifts = poses[0].position.shape[-2:], poses[0].shifts
    static = [p.extended(None, None) for p in poses]
    directions = jnp.diag(scale)[:, :, None, None]
    blocks = []
    for slot in slots:

        def slope(shift: Any, turn: Any, slot: int = slot) -> Any:
            displaced = list(static)
            displaced[slot] = poses[slot].extended(shift, turn)
            value, rate = with_rows(element.residual(*displaced, time)).coefficients
            return jnp.zeros_like(value) if rate is None else rate

        def wide(direction: Any) -> Any:
            return jnp.broadcast_to(direction, (*direction.shape[:2], *batch))

        by_shift = jax.vmap(lambda d: slope(d, None))(wide(directions[:shifts, :shifts]))
        by_turn = jax.vmap(lambda d: slope(None, d))(wide(directions[shifts:, shifts:]))
        blocks.append(jnp.concatenate([by_shift, by_turn]))
    return blocks


def with_field(group: Group, name: str, value: Any) -> Group:
    """Return a group with another value in a field of its elements.

    A function is used, because Equinox makes an object for each look-up of a method, which takes longer than the rest.
    """
    return with_fields(group, element=with_fields(group.element, **{name: value}))


class OmittedLaw(AbstractMotion):
    """A law of zero that replaces a law on which no result depends."""

    def __call__(self, time: Jet) -> Jet:
        """Return zero."""
        return 0.0 * time


def law_left_out(group: Group, *, only_if_evaluated: bool = False) -> Group:
    """Return a group without its law, unless the derivatives of the residuals by the poses may depend on the law.

    Parameters
    ----------
    group : Group
        Group of joints or drivers.
    only_if_evaluated : bool, default False
        Whether to omit the law only if `evaluate` gives its value from the poses of the bodies.
    """
    element = users_class(type(group.element))
    kind = next(kind for kind in element.__mro__ if "residual" in vars(kind))
    is_separable = vars(kind).get("separable", False)
    if is_separable and only_if_evaluated:  # a subclass may override `evaluate` and inherit the residual
        is_separable = getattr(kind, "evaluate", None) is getattr(element, "evaluate", object)
    return with_field(group, "motion", OmittedLaw()) if is_separable else group


def with_rows(jet: Jet) -> Jet:
    """Return a jet of shape (instances, batch) as one of shape (1, instances, batch)."""
    return jet.map(lambda c: c[None]) if len(jet.shape) == 2 else jet


def group_elements(
    elements: Mapping[str, Any], parameters: Mapping[str, Any], body_index: Mapping[str, int], components: int
) -> tuple[tuple[Group, ...], tuple[tuple[str, ...], ...]]:
    """Return the groups of all elements, and the names of the instances in each."""
    members_by_key: dict[Any, list[tuple[str, Any, dict]]] = {}
    user_classes = {kind for kind in set(map(type, elements.values())) if has_own_methods(kind)}
    for name, element in elements.items():
        values = resolve_element(element, parameters, components, name)
        try:
            check_no_own_code(element)
            readings = readings_of(element, values, components) if type(element) in user_classes else {}
        except JounceError as error:
            raise error.located(name=name) from error.__cause__
        if readings:
            values[READINGS] = readings
        members_by_key.setdefault(group_key(element, values), []).append((name, element, values))
    groups, names = [], []
    for members in members_by_key.values():
        instance_names, instances, values = zip(*members, strict=True)
        pairs = zip(instance_names, instances, strict=True)
        slots = zip(*([body_index[b] for b in (*e.bodies, *carriages(n, e))] for n, e in pairs), strict=True)
        groups.append(unchecked(Group, {"element": _stacked(instances, values), "bodies": tuple(slots)}))
        names.append(instance_names)
    return tuple(groups), tuple(names)


def _stacked(elements: Sequence[Any], values: Sequence[Mapping[str, Any]]) -> Any:
    """Return one element with the values of several, and with the readings of methods that a user wrote."""
    element = stack_elements(elements, values)
    readings = [field_values[READINGS] for field_values in values if READINGS in field_values]
    return with_readings(element, jax.tree.map(along_instances, *readings)) if readings else element


class System(Module):
    """All constraints and forces of a mechanism as functions of one pose of all its bodies, the ground first.

    Position coordinates are scaled by a length of the mechanism, and rows by the size of their derivatives, so that
    steps and pivots are comparable for a watch and a crane.
    """

    groups: tuple[Group, ...]
    outputs: tuple[Group, ...]
    pattern: Pattern  # positions of the blocks of the groups in the Jacobian
    row_scale: Float[Numbers, "row 1"]
    column_scale: Float[Numbers, " coordinate"]  # one for each coordinate of a body
    body_count: int = field(static=True)
    forces: tuple[Group, ...] = ()
    fronts: Fronts | None = None  # elimination of a large Jacobian
    rank: int | None = field(static=True, default=None)  # generic rank of the Jacobian, where rows are redundant
    reflected: bool = field(static=True, default=False)  # whether the Jacobian is eliminated by reflections

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns of the Jacobian."""
        return self.pattern.shape

    @property
    def rank_is_open(self) -> bool:
        """Whether the number of redundant constraints is only known after assembly; programs depend on it."""
        rows, columns = self.shape
        return rows > columns and self.rank is None

    @property
    def elimination_order(self) -> Order:
        """Order of rows and columns in which reflections eliminate the Jacobian with little fill-in."""
        row_bodies = []
        for group, count in zip(self.groups, self.pattern.row_counts, strict=True):
            row_bodies += [frozenset(b - 1 for b in bodies if b) for bodies in zip(*group.bodies, strict=True)] * count
        return elimination_order(tuple(row_bodies), self.body_count, self.pattern.width)

    def residual(self, pose: Pose, time: Jet) -> Float[Jet, "row batch"]:
        """Return the scaled residuals of all constraints, shape (rows, batch)."""
        if not self.groups:  # free bodies
            return Jet.constant(jnp.zeros((0, time.coefficients[0].shape[-1])), pose.order)
        parts = [group.residual(pose, time).map(_flat) for group in self.groups]
        return concatenate(parts) * self.row_scale

    def variation(self, pose: Pose, change: Pose, time: Jet) -> Float[Jet, "row batch"]:
        """Return the variation of the scaled residuals, shape (rows, batch), for a change of the pose."""
        if not self.groups:
            return Jet.constant(jnp.zeros((0, time.coefficients[0].shape[-1])), pose.order)
        parts = [group.variation(pose, change, time).map(_flat) for group in self.groups]
        return concatenate(parts) * self.row_scale

    def jacobian(self, pose: Pose, time: Jet) -> Float[Numbers, "row column batch"]:
        """Return the scaled Jacobian at a pose of order zero, shape (rows, columns, batch)."""
        matrix = self.pattern.dense(self.entries(pose, time))
        with by_certain_entries():
            return matrix * self.row_scale[:, :, None]

    def entries(self, pose: Pose, time: Jet) -> Float[Numbers, "entry batch"]:
        """Return the structurally nonzero entries of the Jacobian, before the rows are scaled."""
        frozen = Jet.constant(time.coefficients[0], 1)
        blocks = [b for group in self.groups for b in group.derivative_blocks(pose, frozen, self.column_scale)]
        none = jnp.zeros((0, pose.position.shape[-1]))  # free bodies
        return jnp.concatenate([*map(_flat, blocks), none])

    def admissible(self, time: Jet) -> Bool[Numbers, "driver batch"]:
        """Return whether the value of each driver is admissible at each instant, shape (drivers, batch)."""
        lanes = time.coefficients[0].shape[-1]
        drivers = [group for group in self.groups if group.is_driver]
        parts = [jnp.broadcast_to(g.element.admissible(time), (g.instances, lanes)) for g in drivers]
        return jnp.concatenate([*parts, jnp.ones((0, lanes), bool)])

    def laws(self, time: Jet, *, periodic: bool = False) -> list[Jet]:
        """Return the jets of the motion laws; with `periodic`, only those of drivers that ignore whole turns, rad."""
        drivers = (
            group.element for group in self.groups if group.is_driver and (group.element.periodic or not periodic)
        )
        return [
            driver.motion(time) for driver in drivers if isinstance(getattr(driver, "motion", None), AbstractMotion)
        ]

    def applied_forces(self, pose: Pose, time: Jet) -> Float[Jet, "coordinate body batch"]:
        """Return the generalized applied forces on all bodies, shape (coordinates, bodies, batch), the ground first.

        Forces are in global axes, moments about the origin of each body and in its axes. They are conjugate to the
        virtual velocities of ``pose.varied``, and follow by transposing the variation of the force displacements: no
        Jacobian is written. The order is one less than that of the pose; gravity is not included.
        """
        order = pose.order - 1
        if not self.forces:
            return Jet.constant(jnp.zeros((pose.shifts + pose.turns, *pose.position.shape[1:])), order)
        sizes = jax.lax.optimization_barrier([stacked(group.force(pose, time)) for group in self.forces])
        truncated = time.truncate(order)

        def along(static: Any, change: Any) -> list[Any]:
            return [stacked(group.variation(static, change, truncated)) for group in self.forces]

        return conjugate_series(along, pose.truncate(order), sizes)

    def constraint_forces(self, pose: Pose, time: Jet, multipliers: Float[Numbers, "order row batch"]) -> Jet:
        """Return ``Phi_q^T lambda`` of all bodies for Taylor coefficients of multipliers, shaped like `applied_forces`.

        Pose, time and multipliers have the same order.
        """
        if not self.groups:
            return Jet.constant(jnp.zeros((pose.shifts + pose.turns, *pose.position.shape[1:])), pose.order)
        return conjugate_series(lambda static, change: stacked(self.variation(static, change, time)), pose, multipliers)

    def finite_forces(self, pose: Pose, time: Jet) -> Bool[Numbers, "force batch"]:
        """Return whether each applied force is finite, shape (forces, batch); the pose contains velocities.

        A force has no direction where its velocity is not finite, as for the distance of two coincident points.
        """
        lanes = time.coefficients[0].shape[-1]
        checks = [group.finite(movable(pose.truncate(1)), time.truncate(1)) for group in self.forces]
        parts = [jnp.broadcast_to(x, (x.shape[0], lanes)) for x in checks]
        return jnp.concatenate([*parts, jnp.ones((0, lanes), bool)])

    def coordinates(
        self, solution: Float[Numbers, "column batch"], shifts: int
    ) -> tuple[Float[Numbers, "shift body batch"], Float[Numbers, "turn body batch"]]:
        """Return the shifts and turns of all bodies, (c, bodies, batch), of a scaled solution, (columns, batch)."""
        count = self.column_scale.shape[0]
        parts = jnp.swapaxes(solution.reshape(self.body_count, count, -1), 0, 1)
        parts = jnp.pad(parts * self.column_scale[:, None, None], ((0, 0), (1, 0), (0, 0)))
        return parts[:shifts], parts[shifts:]


def conjugate_series(variation: Callable[[Any, Any], Any], pose: Pose, sizes: Any) -> Jet:
    """Return the forces on all bodies that are conjugate to given displacements, (coordinates, bodies, batch).

    Parameters
    ----------
    variation : callable
        Returns the variation of the displacements for a pose and its change: linear in the change, in the structure of
        `sizes`.
    pose : SpatialPose or PlanarPose
        Pose of the order of the sizes.
    sizes : pytree of array
        Taylor coefficients of the force components.
    """
    static, order = movable(pose), pose.order

    def varied(velocity: Any) -> Any:
        shift, turn = (Jet(tuple(part)) for part in (velocity[:, : pose.shifts], velocity[:, pose.shifts :]))
        return variation(static, movable(static.varied(shift, turn).truncate(order)))

    shape = (order + 1, pose.shifts + pose.turns, *pose.position.shape[1:])
    transposed = jax.linear_transpose(varied, jax.ShapeDtypeStruct(shape, jnp.float64))
    # the transpose of a convolution runs backwards in the orders
    backwards = jax.tree.map(lambda size: size[::-1], sizes)
    return Jet(tuple(transposed(backwards)[0][::-1]))


def movable(pose: Pose) -> Any:
    """Return a pose without structural zeros, ready for a variation."""
    pose = each_jet(Jet.dense, pose)
    if isinstance(pose, SpatialPose) and pose.order and pose.angular_velocity is None:
        zero = Jet.constant(jnp.zeros_like(pose.position.coefficients[0]), pose.order - 1).dense()
        return dataclasses.replace(pose, angular_velocity=zero)
    return pose


def _flat(block: Float[Numbers, "*rest batch"]) -> Float[Numbers, "entry batch"]:
    return block.reshape(-1, block.shape[-1])
