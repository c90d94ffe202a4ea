"""What the constraints of a mechanism have to balance: inertia, weight and applied forces of all bodies, on jets.

Forces act in the coordinates of virtual displacements: a shift of the origin of a body along the global axes, and a
turn about the axes of the body.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.forward.saddle_point import BodyMatrices
from jounce.dynamics.masses import Gravity, Masses
from jounce.jet import Jet, components, cross
from jounce.jet.algebra import stacked, total
from jounce.mechanism.system import System
from jounce.rigid import PlanarPose
from jounce.rigid.pose import Pose


def inertia_forces(pose: Pose, masses: Masses, gravity: Gravity | float) -> tuple[Jet, Jet]:
    """Return inertia less weight of all bodies: force, global, and moment about the origin, in axes of the body.

    Both are two orders shorter than the pose; shapes (c, bodies, batch) and (turns, bodies, batch).

    Parameters
    ----------
    pose : SpatialPose or PlanarPose
        Jets of all bodies, of shape (..., bodies, batch).
    masses : Masses
        Of these bodies.
    gravity : array of shape (c, 1, 1)
        m/s^2.
    """
    mass, center, moments = masses
    acceleration = pose.point(center).differentiate().differentiate()
    force = (acceleration - gravity) * mass
    if isinstance(pose, PlanarPose):
        about = moments[0][0] + moments[1][1]
        moment = pose.angle.differentiate().differentiate() * about + cross(pose.direction(center), force)
        return force, moment[None]
    spread = moments[0][0] + moments[1][1] + moments[2][2]
    spin = pose.angular_velocity
    assert spin is not None  # there are accelerations
    momentum = spin * spread - total(moments[:, i] * part for i, part in enumerate(components(spin)))
    local = pose.to_body(force)
    return force, momentum.differentiate() + cross(spin, momentum) + cross(center, local)


def mass_matrices(pose: Pose, masses: Masses) -> BodyMatrices:
    """Return the mass matrix of each body at a pose of order zero.

    It is the map from accelerations to the forces of inertia of bodies that do not move yet.
    """
    split, shape = pose.shifts, pose.position.shape[1:]

    def wide(direction: Any) -> tuple[Any, Any]:
        whole = jnp.broadcast_to(direction[:, None, None], (len(direction), *shape))
        return whole[:split], whole[split:]

    size = split + pose.turns
    at_rest = pose.extended(*wide(jnp.zeros(size)))

    def along(direction: Any) -> Any:
        accelerated = at_rest.extended(*wide(0.5 * direction))
        force, moment = inertia_forces(accelerated, masses, 0.0)
        return jnp.concatenate([force.coefficients[0], moment.coefficients[0]])

    return jax.vmap(along, out_axes=1)(jnp.eye(size))


def loads(
    system: System, pose: Pose, time: Jet, masses: Masses, gravity: Gravity
) -> Float[Numbers, "order coordinate moving batch"]:
    """Return applied forces and weight less inertia of all moving bodies, as Taylor coefficients.

    Parameters
    ----------
    system : System
        Its applied forces count.
    pose : SpatialPose or PlanarPose
        Jets of all bodies, the ground first.
    time : Jet
        Of shape (1, batch).
    masses : Masses
        Of all bodies.
    gravity : array of shape (c, 1, 1)
        m/s^2.

    Returns
    -------
    array of shape (order - 1, coordinates, moving bodies, batch)
        The order is that of the pose; force, global, and moment about the origin, in axes of the body.
    """
    load = -jnp.concatenate([stacked(x) for x in inertia_forces(pose, masses, gravity)], axis=1)
    if system.forces:
        load = load + stacked(system.applied_forces(pose, time))[: len(load)]
    return load[:, :, 1:]


def constraint_loads(
    system: System, pose: Pose, time: Jet, multipliers: Float[Numbers, "order row batch"]
) -> Float[Numbers, "order coordinate moving batch"]:
    """Return ``Phi_q^T lambda`` of all moving bodies, as Taylor coefficients, from those of the multipliers."""
    return stacked(system.constraint_forces(pose, time, multipliers))[:, :, 1:]
