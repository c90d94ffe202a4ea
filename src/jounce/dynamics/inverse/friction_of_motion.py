"""Friction in inverse dynamics: multipliers and normal forces together, order after order."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import Module, field
from jounce.base.shapes import Numbers
from jounce.dynamics.friction.coupling import Coupling, has_friction, pressed, torque_lost
from jounce.dynamics.inverse.constraint_forces import BodyMatrices, Slopes, load_solver, onto_bodies
from jounce.jet import Jet
from jounce.jet.algebra import stacked, total
from jounce.kinematics.sensitivity.jacobian_series import Slope
from jounce.mechanism.system import Group, System
from jounce.rigid.pose import Pose

Rubbed = tuple[Sequence[Float[Numbers, "order coordinate _ _ batch"]], Sequence[Pose], Any]
"""For a group of joints with friction: `friction_slope` for each moving slot, the poses of the bodies, and for gears
the resisting part of the torque loss, (levels, 1, instances, batch), otherwise None.
"""


class FrictionGroup(Module):
    """A group of joints with friction, in a motion.

    Parameters
    ----------
    group : Group
        The joints.
    poses : sequence of SpatialPose or PlanarPose
        Poses of their bodies, (..., instances, batch).
    slopes : sequence of array
        Slopes of their residuals, for each moving slot.
    friction : sequence of array
        Slopes from `friction_slope`, for each moving slot.
    resisting : array of shape (levels, 1, instances, batch), or None
        For gears, the resisting part of the torque loss.
    first : int
        First row of the group.
    """

    group: Group
    poses: Sequence[Pose]
    slopes: Sequence[Any]  # as `Slope`; of other rows than those of friction
    friction: Sequence[Any]
    resisting: Any
    first: int = field(static=True)

    def normal_forces(self, multipliers: Sequence[Any]) -> Float[Numbers, "order instance batch"]:
        """Return the Taylor coefficients of the normal forces from those of all multipliers, (rows, batch) each."""
        sign = -1.0 if self.group.moving_slots[-1] else 1.0
        slope = self.slopes[-1][:, : self.poses[0].shifts]
        _, _, rows, instances, lanes = slope.shape
        own = [m[self.first : self.first + rows * instances].reshape(rows, instances, lanes) for m in multipliers]
        if self.resisting is not None:
            return stacked(torque_lost(self.group.element, Jet(tuple(own)), Jet(tuple(self.resisting[: len(own)]))))
        force = [
            sign * total(jnp.sum(slope[j] * own[k - j][None], axis=1) for j in range(k + 1)) for k in range(len(own))
        ]
        return stacked(pressed(self.group.element, self.poses, Jet(tuple(force))))


def friction_groups(system: System, blocks: Slopes, rubbed: Sequence[Rubbed]) -> list[FrictionGroup]:
    """Return the groups of joints with friction; `rubbed` is in the order of the groups."""
    rubbing, first, left = [], 0, iter(rubbed)
    for group, slopes in zip(system.groups, blocks, strict=True):
        if has_friction(group):
            friction, poses, resisting = next(left)
            rubbing.append(FrictionGroup(group, poses, slopes, friction, resisting, first))
        first += slopes[0].shape[2] * group.instances
    return rubbing


def with_friction(
    system: System,
    blocks: Slopes,
    load: Float[Numbers, "levels coordinate body batch"],
    mass: BodyMatrices | None,
    rubbing: Sequence[FrictionGroup],
) -> Float[Numbers, "levels row batch"]:
    """Return the Taylor coefficients of the unscaled multipliers of all rows, and below them of the normal forces.

    Parameters
    ----------
    system, blocks, load, mass
        As for `constraint_forces.multipliers`.
    rubbing : sequence of FrictionGroup
        All joints with friction.
    """
    solve, rows, levels = load_solver(system, blocks, mass), system.shape[0], len(load)
    felt = [_felt(slopes, group) for group, slopes in zip(system.groups, blocks, strict=True)]
    resisted = [_felt(joint.friction, joint.group) for joint in rubbing]
    joints = [joint.group.instances for joint in rubbing]

    def on_bodies(level: Callable[[Slope, Any], Any], all_slopes: Sequence[Any], forces: Any) -> Any:
        """Return the generalized forces of all rows on the bodies; `level` multiplies a slope by the forces."""
        work, first = 0.0, 0
        for by_slot in all_slopes:
            _, _, count, instances, lanes = by_slot[0][0].shape
            joint = forces[..., first : first + count * instances, :]
            joint = joint.reshape(*joint.shape[:-2], count, instances, lanes)
            for slope, bodies in by_slot:
                work = work + onto_bodies(level(slope, joint), bodies, system.body_count)
            first += count * instances
        return work

    def leading_term(slope: Slope, forces: Any) -> Any:
        return jnp.sum(slope[0] * forces[None], axis=1)

    def normal(multipliers: Any) -> Any:
        return jnp.concatenate([joint.normal_forces([multipliers])[0] for joint in rubbing])

    unit = jnp.broadcast_to(jnp.eye(sum(joints))[..., None], (sum(joints), sum(joints), load.shape[-1]))
    response = jax.vmap(lambda forces: solve(on_bodies(leading_term, resisted, forces)))(unit)
    coupling, multipliers, forces = Coupling.of(normal, solve(load[0]), response)
    if levels == 1:
        return jnp.concatenate([multipliers, forces])[None]
    orders = np.arange(1, levels)

    def level(coefficients: Any, order_and_load: Any) -> tuple[Any, None]:
        k, deficit = order_and_load
        previous = coefficients[(k - orders) % levels]  # zero if not computed yet, also where the index wraps

        def lower(slope: Slope, forces: Any) -> Any:
            active = jnp.where((orders <= k).reshape(-1, 1, 1, 1, 1), slope[1:], 0.0)  # the rest may not be finite
            return jnp.sum(active * forces[:, None], axis=(0, 2))

        deficit = deficit - on_bodies(lower, felt, previous[:, :rows]) - on_bodies(lower, resisted, previous[:, rows:])
        trial = coefficients.at[k, :rows].set(solve(deficit))
        pressing = jnp.concatenate([joint.normal_forces(list(trial[:, :rows])) for joint in rubbing], axis=1)
        newest = coupling.solved(trial[k, :rows], pressing[k])
        return coefficients.at[k].set(jnp.concatenate(newest)), None

    start = jnp.zeros((levels, rows + sum(joints), load.shape[-1])).at[0].set(jnp.concatenate([multipliers, forces]))
    return jax.lax.scan(level, start, (np.arange(1, levels), load[1:]))[0]


def _felt(slopes: Sequence[Slope], group: Group) -> list[tuple[Slope, tuple[int, ...]]]:
    return [(slope, group.bodies[slot]) for slot, slope in zip(group.moving_slots, slopes, strict=True)]
