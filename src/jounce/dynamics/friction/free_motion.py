"""Friction in forward dynamics: its terms in the equations of motion, and their solution.

Teeth press bearings, too. Beyond the torque of the residual of gears, a tooth force has two parts that do no work: one
proportional to the multiplier of the gears, and one proportional to its absolute value. Both count as normal forces,
with ``N = lambda`` and ``N = |lambda|`` instead of ``N = |R(lambda)|``.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.constraints.friction import displacements
from jounce.dynamics.friction.coupling import (
    Coupling,
    has_flanks,
    has_friction,
    loses_torque,
    pressed,
    pressing_teeth,
    resisting,
    torque_lost,
)
from jounce.jet import Jet
from jounce.mechanism.system import Group, System, movable, with_field, with_rows
from jounce.rigid.pose import Pose

Rows = Float[Numbers, "row batch"]


class FreeFriction:
    """The friction of a mechanism at an instant.

    Parameters
    ----------
    system : System
        System of the mechanism.
    pose : SpatialPose or PlanarPose
        Poses of all bodies, the ground first, of order one.
    time : Jet
        Time of order zero, shape (1, batch).
    """

    def __init__(self, system: System, pose: Pose, time: Jet):
        self.system, self.pose, self.time = system, pose, time
        self.groups = [group for group in system.groups if has_friction(group)]
        self.meshes = pressing_teeth(system)

    @property
    def count(self) -> int:
        """Number of normal forces of joints and teeth."""
        return sum(group.instances for group in self.groups) + 2 * sum(group.instances for group in self.meshes)

    @cached_property
    def _at_rest(self) -> Pose:
        return movable(self.pose.truncate(0))

    def normal_forces(self, multipliers: Rows) -> Float[Numbers, "joint batch"]:
        """Return the normal forces of joints with friction, then of teeth, from multipliers of scaled rows."""
        unscaled, normals, teeth, first = multipliers * self.system.row_scale, [], [], 0
        for group in self.system.groups:
            bodies = tuple(self._at_rest.take(indices) for indices in group.bodies)
            shape = jax.eval_shape(lambda g=group: g.residual(self.pose.truncate(0), self.time).coefficients[0]).shape
            count = shape[0] * shape[1]
            values = unscaled[first : first + count].reshape(shape[0], shape[1], -1)
            if self.meshes and has_flanks(group):
                teeth += [values[0], jnp.abs(values[0])]
            if has_friction(group):
                normals.append(
                    self._lost(group, values) if loses_torque(group.element) else self._pressed(group, bodies, values)
                )
            first += count
        return jnp.concatenate(normals + teeth)

    def _lost(self, group: Group, multipliers: Any) -> Any:
        return torque_lost(group.element, Jet([multipliers]), self._resisting(group)).coefficients[0]

    def _resisting(self, group: Group) -> Jet:
        return resisting(group.element, [movable(self.pose.take(indices)) for indices in group.bodies])

    def _pressed(self, group: Group, bodies: tuple[Pose, ...], multipliers: Any) -> Any:
        body = bodies[1]
        no_turn = jnp.zeros((body.turns, *body.position.shape[1:]))

        def displaced(shift: Any) -> Any:
            change = movable(body.varied(Jet([shift]), Jet([no_turn])))
            return with_rows(group.element.variation(bodies, (None, change), self.time)).coefficients[0]

        force = -jax.linear_transpose(displaced, jax.ShapeDtypeStruct(body.position.shape, jnp.float64))(multipliers)[0]
        return pressed(group.element, bodies, Jet([force])).coefficients[0]

    def slips(self, change: Pose) -> list[Any]:
        """Return the slip of the surfaces of each group for a displacement of all bodies.

        For teeth, return the displacements conjugate to the parts of the tooth force that do no work.
        """
        slips = []
        for group in self.groups:
            bodies, changes = ([p.take(indices) for indices in group.bodies] for p in (self._at_rest, change))
            slips.append(group.element.slip(tuple(bodies), displacements(bodies, changes)).coefficients[0])
        return slips + [self._parted(group, change) for group in self.meshes]

    def _parted(self, group: Group, change: Pose) -> Any:
        """Return the displacements conjugate to the parts of a tooth force that follow the multiplier and its size."""
        of_residual, on_left, on_right = (
            flanked.variation(self._at_rest, change, self.time).coefficients[0]
            for flanked in (group, with_field(group, "flank", 1.0), with_field(group, "flank", -1.0))
        )
        return jnp.concatenate([(on_left + on_right) / 2.0 - of_residual, (on_left - on_right) / 2.0])

    def resisting(self, normal: Float[Numbers, "joint batch"]) -> list[Any]:
        """Return the friction forces of each group, conjugate to `slips`, for normal forces of all joints."""
        forces, first = [], 0
        for group in self.groups:
            factor = self._resisting(group).coefficients[0]
            forces.append(factor * normal[first : first + group.instances][None])
            first += group.instances
        for group in self.meshes:
            forces.append(normal[first : first + 2 * group.instances].reshape(2, group.instances, -1))
            first += 2 * group.instances
        return forces


def with_friction(
    unknowns: Callable[[Any, Any], tuple[Any, Any]],
    frictionless: tuple[Any, Any],
    friction: FreeFriction,
    felt: Callable[[Any], Any],
) -> tuple[Any, Any, Callable[[Any, Any], tuple[Any, Any]]]:
    """Return accelerations and multipliers with friction, and the solver for their higher orders.

    Parameters
    ----------
    unknowns : callable
        Solver of the frictionless equations for the residuals of `Equations.balance`.
    frictionless : tuple of array
        Accelerations and multipliers without friction.
    friction : FreeFriction
        Friction of the mechanism.
    felt : callable
        Function from normal forces to generalized forces on the bodies, as in `Equations.balance`.
    """
    acceleration, multipliers = frictionless
    count, lanes = friction.count, multipliers.shape[-1]
    unit = jnp.broadcast_to(jnp.eye(count)[..., None], (count, count, lanes))
    accelerations, responses = jax.vmap(lambda forces: unknowns(felt(forces), jnp.zeros_like(multipliers)))(unit)
    coupling, multipliers, normal = Coupling.of(friction.normal_forces, multipliers, -responses)
    acceleration = acceleration + _along(accelerations, normal)

    def solved(forces: Any, second: Any) -> tuple[Any, Any]:
        unrubbed, change = unknowns(forces, second)
        pressing = jax.jvp(friction.normal_forces, (multipliers,), (change,))[1]
        change, normal = coupling.solved(change, pressing)
        return unrubbed + _along(accelerations, normal), change

    return acceleration, multipliers, solved


def _along(columns: Any, weights: Any) -> Any:
    """Return the sum of columns, (joints, ..., batch), with weights, (joints, batch)."""
    return jnp.sum(columns * weights.reshape(len(weights), *[1] * (columns.ndim - 2), -1), axis=0)
