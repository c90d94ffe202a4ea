"""Friction in a motion that is known: multipliers and normal forces together, order after order."""

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
"""Of a group of joints with friction: `friction_slope` for each moving slot, where the bodies are, and of gears which
part of the torque lost resists, (levels, 1, instances, batch); None of others.
"""


class FrictionGroup(Module):
    """A group of joints with friction, in a motion.

    Parameters
    ----------
    group : Group
        Of the joints.
    poses : sequence of SpatialPose or PlanarPose
        Of their bodies, (..., instances, batch).
    slopes : sequence of array
        Of their residuals, for each moving slot.
    friction : sequence of array
        As `friction_slope` gives it, for each moving slot.
    resisting : array of shape (levels, 1, instances, batch), or None
        Of gears, which part of the torque lost is against their turning.
    first : int
        The first row of the group.
    """

    group: Group
    poses: Sequence[Pose]
    slopes: Sequence[Any]  # as `Slope`; of other rows than those of friction
    friction: Sequence[Any]
    resisting: Any
    first: int = field(static=True)

    def normal_forces(self, multipliers: Sequence[Any]) -> Float[Numbers, "order instance batch"]:
        """Return the normal forces of multipliers of all rows, given by Taylor coefficients, (rows, batch)."""
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
    """Return the multipliers of all rows, not scaled, and below them the normal forces, as Taylor coefficients.

    Parameters
    ----------
    system, blocks, load, mass
        As `constraint_forces.multipliers` takes them.
    rubbing : sequence of FrictionGroup
        All joints with friction.
    """
    solve, rows, levels = load_solver(system, blocks, mass), system.shape[0], len(load)
    felt = [_felt(slopes, group) for group, slopes in zip(system.groups, blocks, strict=True)]
    resisted = [_felt(its.friction, its.group) for its in rubbing]
    joints = [its.group.instances for its in rubbing]

    def on_bodies(level: Callable[[Slope, Any], Any], parts: Sequence[Any], forces: Any) -> Any:
        """Return what forces of all rows do to bodies, by what a level of slopes makes of them."""
        done, first = 0.0, 0
        for by_slot in parts:
            _, _, count, instances, lanes = by_slot[0][0].shape
            its = forces[..., first : first + count * instances, :]
            its = its.reshape(*its.shape[:-2], count, instances, lanes)
            for slope, bodies in by_slot:
                done = done + onto_bodies(level(slope, its), bodies, system.body_count)
            first += count * instances
        return done

    def now(slope: Slope, forces: Any) -> Any:
        return jnp.sum(slope[0] * forces[None], axis=1)

    def normal(multipliers: Any) -> Any:
        return jnp.concatenate([its.normal_forces([multipliers])[0] for its in rubbing])

    unit = jnp.broadcast_to(jnp.eye(sum(joints))[..., None], (sum(joints), sum(joints), load.shape[-1]))
    response = jax.vmap(lambda forces: solve(on_bodies(now, resisted, forces)))(unit)
    coupling, multipliers, forces = Coupling.of(normal, solve(load[0]), response)
    if levels == 1:
        return jnp.concatenate([multipliers, forces])[None]
    below = np.arange(1, levels)

    def level(coefficients: Any, order_and_load: Any) -> tuple[Any, None]:
        k, missing = order_and_load
        earlier = coefficients[(k - below) % levels]  # those not computed yet are zero, also where the index runs round

        def lower(slope: Slope, forces: Any) -> Any:
            needed = jnp.where((below <= k).reshape(-1, 1, 1, 1, 1), slope[1:], 0.0)  # others may not be finite
            return jnp.sum(needed * forces[:, None], axis=(0, 2))

        missing = missing - on_bodies(lower, felt, earlier[:, :rows]) - on_bodies(lower, resisted, earlier[:, rows:])
        trial = coefficients.at[k, :rows].set(solve(missing))
        pressing = jnp.concatenate([its.normal_forces(list(trial[:, :rows])) for its in rubbing], axis=1)
        newest = coupling.solved(trial[k, :rows], pressing[k])
        return coefficients.at[k].set(jnp.concatenate(newest)), None

    start = jnp.zeros((levels, rows + sum(joints), load.shape[-1])).at[0].set(jnp.concatenate([multipliers, forces]))
    return jax.lax.scan(level, start, (np.arange(1, levels), load[1:]))[0]


def _felt(slopes: Sequence[Slope], group: Group) -> list[tuple[Slope, tuple[int, ...]]]:
    return [(slope, group.bodies[slot]) for slot, slope in zip(group.moving_slots, slopes, strict=True)]
