"""Forces of a driven mechanism and their rates: Lagrange multipliers from the transposed factor, to any order.

The equations of motion ``M q'' + Phi_q^T lambda = Q`` are a balance of jets. With the motion known, each coefficient of
the multipliers follows from the factored Jacobian of the positions, transposed. The product ``Phi_q^T lambda`` of jets is
the transpose of ``Phi_q v``, and that is how the residuals change as bodies move with the virtual velocity v: no Jacobian
is written anywhere, and a joint of one's own has its reactions.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jounce.dynamics.energies import mechanism_masses
from jounce.errors import MechanismError, did_you_mean
from jounce.jet import Jet, components, concatenate, cross
from jounce.jet.algebra import total
from jounce.kinematics import Motion, Status
from jounce.kinematics.compilation import compiled
from jounce.kinematics.linear import DenseFactor
from jounce.mechanism.system import Group, System
from jounce.robot.scan import stacked
from jounce.trajectory import AbstractMotion


class _Shifted(AbstractMotion):
    """A law moved by a constant: how the residual of a driver changes with it tells the force that the driver exerts."""

    law: AbstractMotion
    shift: Any

    def __call__(self, time: Jet) -> Jet:
        return self.law(time) + self.shift


def _truncated(pose: Any, order: int) -> Any:
    """Return a pose with the jets cut to an order; its angular velocity is one shorter."""
    cut = jax.tree.map(lambda jet: jet.truncate(order).dense(), pose, is_leaf=_is_jet)
    spin = getattr(cut, "angular_velocity", None)
    if spin is None:
        return cut
    return dataclasses.replace(cut, angular_velocity=spin.truncate(order - 1) if order else None)


def _is_jet(value: Any) -> bool:
    return isinstance(value, Jet)


def inertia_forces(pose: Any, mass: Any, center: Any, moments: Any, gravity: Any) -> tuple[Jet, Jet]:
    """Return inertia less weight of all bodies: force, global, and moment about the origin, in axes of the body.

    Both are two orders shorter than the pose; shapes (c, bodies, batch) and (turns, bodies, batch).
    """
    acceleration = pose.point(center).differentiate().differentiate()
    force = (acceleration - gravity) * mass
    if pose.turns == 1:
        about = moments[0][0] + moments[1][1]
        moment = pose.angle.differentiate().differentiate() * about + cross(pose.direction(center), force)
        return force, moment[None]
    spread = moments[0][0] + moments[1][1] + moments[2][2]
    spin = pose.angular_velocity
    momentum = spin * spread - total(moments[:, i] * part for i, part in enumerate(components(spin)))
    local = pose.to_body(force)
    return force, momentum.differentiate() + cross(spin, momentum) + cross(center, local)


def _balance(system: System, pose: Any, time: Jet, levels: int) -> Callable[[Any], Any]:
    """Return the map from multipliers, (levels, rows, batch), to ``Phi_q^T lambda``, (levels, c, bodies, batch)."""
    order = levels - 1
    pose, time = _truncated(pose, order), time.truncate(order)

    def rates(velocity: Any) -> Any:
        still = jnp.zeros_like(velocity[:, :, :1])  # the ground does not move
        velocity = jnp.concatenate([still, velocity], axis=2)
        shift, turn = (Jet(tuple(part)) for part in (velocity[:, : pose.shifts], velocity[:, pose.shifts :]))
        change = _truncated(pose.varied(shift, turn), order)
        return jax.jvp(lambda p: stacked(system.residual(p, time)), (pose,), (change,))[1]

    batch = time.coefficients[0].shape[-1]
    example = jax.ShapeDtypeStruct((levels, pose.shifts + pose.turns, system.body_count, batch), jnp.float64)
    transposed = jax.linear_transpose(rates, example)
    # the transpose of a convolution runs backwards in the orders
    return lambda multipliers: transposed(multipliers[::-1])[0][::-1]


def multipliers(system: System, pose: Any, time: Jet, load: Any, levels: int) -> Any:
    """Return the multipliers of all rows as Taylor coefficients, (levels, rows, batch).

    Parameters
    ----------
    system : System
        The mechanism; its rows are scaled, and so are the multipliers.
    pose : SpatialPose or PlanarPose
        Jets of all bodies, the ground first.
    time : Jet
        Of shape (1, batch).
    load : array of shape (levels, coordinates of a body, bodies, batch)
        What the constraints have to balance: applied forces less those of inertia.
    levels : int
        One more than the rates that are wanted.
    """
    product = _balance(system, pose, time, levels)
    factor = DenseFactor.of(system.jacobian(_truncated(pose, 0), time.truncate(0)))
    scale = jnp.tile(jnp.asarray(system.column_scale), system.body_count)[:, None]
    found = jnp.zeros((levels, system.row_scale.shape[0], load.shape[-1]))
    for k in range(levels):
        missing = load[k] - product(found)[k]
        right = jnp.swapaxes(missing, 0, 1).reshape(-1, missing.shape[-1]) * scale
        found = found.at[k].set(factor.solve_transposed(right))
    return found


def exerted(group: Group, pose: Any, time: Jet, found: Jet) -> Jet:
    """Return the forces that drivers exert along what they prescribe, (instances, batch), with rates.

    Conjugate to the law f: ``lambda^T dPhi/df``, whose product with f' is the power that goes into the mechanism.

    Parameters
    ----------
    group : Group
        Drivers of one type.
    pose, time
        Jets of at least the order of the multipliers.
    found : Jet
        Multipliers of the rows, not scaled, shape (rows, instances, batch).
    """
    pose, time = _truncated(pose, found.order), time.truncate(found.order)

    def residual(shift: Any) -> Any:
        element = eqx.tree_at(lambda e: e.motion, group.element, _Shifted(group.element.motion, shift))
        return stacked(Group(element, group.bodies).residual(pose, time))

    shift = jnp.zeros((group.instances, time.coefficients[0].shape[-1]))
    _, slope = jax.jvp(residual, (shift,), (jnp.ones_like(shift),))
    return total(components(found * Jet(tuple(slope))))[0]


def _moving(pose: Any) -> Any:
    """Return a pose with no certain zeros: also the ground may be moved in thought."""
    pose = jax.tree.map(lambda jet: jet.dense(), pose, is_leaf=_is_jet)
    if pose.turns == 3 and pose.order and pose.angular_velocity is None:
        rest = Jet.constant(jnp.zeros_like(pose.position.coefficients[0]), pose.order - 1).dense()
        return dataclasses.replace(pose, angular_velocity=rest)
    return pose


def joint_wrenches(group: Group, pose: Any, time: Jet, found: Jet) -> list[tuple[Jet, Jet]]:
    """Return what the joints of one type do to the bodies in each slot: force, global, and moment about the origin.

    The force has the shape (c, instances, batch), the moment, in the axes of the body, (turns, instances, batch).
    """
    order = found.order
    pose, time = _truncated(pose, order), time.truncate(order)
    poses = [pose.take(indices) for indices in group.bodies]
    results = []
    for slot, body in enumerate(map(_moving, poses)):
        shape = jnp.shape(body.position.coefficients[0])

        def residual(change: Any, slot: int = slot, body: Any = body) -> Any:
            moved = list(poses)
            moved[slot] = change
            jet = group.element.residual(*moved, time)
            return stacked(jet.map(lambda c: c[None]) if len(jet.shape) == 2 else jet)

        def rates(velocity: Any, body: Any = body, residual: Any = residual) -> Any:
            shift, turn = (Jet(tuple(part)) for part in (velocity[:, : body.shifts], velocity[:, body.shifts :]))
            change = _truncated(body.varied(shift, turn), order)
            return jax.jvp(residual, (body,), (change,))[1]

        example = jax.ShapeDtypeStruct((order + 1, pose.shifts + pose.turns, *shape[1:]), jnp.float64)
        work = -jax.linear_transpose(rates, example)(stacked(found)[::-1])[0][::-1]
        results.append((Jet(tuple(work[:, : pose.shifts])), Jet(tuple(work[:, pose.shifts :]))))
    return results
