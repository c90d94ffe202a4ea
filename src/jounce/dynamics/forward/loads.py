"""Loads that the constraints of a mechanism balance: inertia, weight and applied forces of all bodies, on jets.

Forces are conjugate to virtual displacements: a shift of the body origin along the global axes, and a rotation about
the body axes.
"""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.saddle_point import BodyMatrices
from jounce.dynamics.masses import Gravity, Masses
from jounce.jet import Jet, components, cross
from jounce.jet.algebra import stacked, total
from jounce.mechanism.system import System
from jounce.rigid import PlanarPose
from jounce.rigid.planar import perpendicular
from jounce.rigid.pose import Pose


def inertia_forces(pose: Pose, masses: Masses, gravity: Gravity | float) -> tuple[Jet, Jet]:
    """Return inertia forces less weight: force in global axes, and moment about the body origin in body axes.

    Both have two orders less than the pose; shapes (c, bodies, batch) and (turns, bodies, batch).

    Parameters
    ----------
    pose : SpatialPose or PlanarPose
        Jets of all bodies, of shape (..., bodies, batch).
    masses : Masses
        Masses of these bodies.
    gravity : array of shape (c, 1, 1)
        m/s^2.
    """
    mass, center, moments = masses
    acceleration = pose.point(center).differentiate().differentiate()
    force = (acceleration - gravity) * mass
    if isinstance(pose, PlanarPose):
        polar_moment = moments[0][0] + moments[1][1]
        moment = pose.angle.differentiate().differentiate() * polar_moment + cross(pose.direction(center), force)
        return force, moment[None]
    spread = moments[0][0] + moments[1][1] + moments[2][2]
    spin = pose.angular_velocity
    assert spin is not None  # there are accelerations
    momentum = spin * spread - total(moments[:, i] * rate for i, rate in enumerate(components(spin)))
    local = pose.to_body(force)
    return force, momentum.differentiate() + cross(spin, momentum) + cross(center, local)


def mass_matrices(pose: Pose, masses: Masses) -> BodyMatrices:
    """Return the mass matrix of each body at a pose of order zero.

    It is written out: differentiating `inertia_forces` would take thirty times as many operations in machine code.
    """
    center, mass = masses.center, masses.mass[None, None]
    if isinstance(pose, PlanarPose):
        levers = [perpendicular(pose.direction(center)).coefficients[0]]
    else:
        (x, y, z), (a, b, c) = (axis.coefficients[0] for axis in pose.axes), components(center)
        levers = [b * z - c * y, c * x - a * z, a * y - b * x]  # center velocity per unit rate about each axis
    moments = masses.moments + mass * center[:, None] * center[None]  # about the origin
    trace = total(moments[i, i] for i in range(len(center)))[None, None]
    rotational = trace if len(levers) == 1 else trace * jnp.eye(3)[:, :, None, None] - moments
    shape = pose.position.shape[1:]

    def wide(block: Any) -> Any:
        return jnp.broadcast_to(block, (*block.shape[:2], *shape))

    upper = wide(mass * jnp.eye(pose.shifts)[:, :, None, None]), wide(mass * jnp.stack(levers, axis=1))
    lower = jnp.swapaxes(upper[1], 0, 1), wide(rotational)
    return jnp.concatenate([jnp.concatenate(upper, axis=1), jnp.concatenate(lower, axis=1)])


def loads(
    system: System, pose: Pose, time: Jet, masses: Masses, gravity: Gravity
) -> Float[Numbers, "order coordinate moving batch"]:
    """Return the Taylor coefficients of applied forces and weight less inertia, for all moving bodies.

    Parameters
    ----------
    system : System
        System whose applied forces are included.
    pose : SpatialPose or PlanarPose
        Jets of all bodies, the ground first.
    time : Jet
        Time jet of shape (1, batch).
    masses : Masses
        Masses of all bodies.
    gravity : array of shape (c, 1, 1)
        m/s^2.

    Returns
    -------
    array of shape (order - 1, coordinates, moving bodies, batch)
        The order is that of the pose; force in global axes, and moment about the body origin in body axes.
    """
    load = -jnp.concatenate([stacked(x) for x in inertia_forces(pose, masses, gravity)], axis=1)
    if system.forces:
        load = load + stacked(system.applied_forces(pose, time))[: len(load)]
    return load[:, :, 1:]


def constraint_loads(
    system: System, pose: Pose, time: Jet, multipliers: Float[Numbers, "order row batch"]
) -> Float[Numbers, "order coordinate moving batch"]:
    """Return the Taylor coefficients of ``Phi_q^T lambda`` for all moving bodies, from those of the multipliers."""
    return stacked(system.constraint_forces(pose, time, multipliers))[:, :, 1:]
