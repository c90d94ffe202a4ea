"""Potential energy in gravity, with its rates, and the energy that forces store."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.energy.energies import Energies
from jounce.dynamics.forward.accelerations import Lanes
from jounce.dynamics.masses import Gravity, gravity_of, required_masses
from jounce.dynamics.motion_values import (
    Coordinates,
    check_motion,
    cut,
    labeled,
    pose_of,
)
from jounce.execution.mapped import Mapped
from jounce.jet import Jet, dot
from jounce.jet.algebra import stacked
from jounce.kinematics import Motion
from jounce.mechanism.system import Group
from jounce.mechanism.transmissions.axis_angles import angles_of, of_one_lane, with_turns
from jounce.rigid.pose import Pose

if TYPE_CHECKING:
    import xarray


def potential_energy(motion: Motion) -> "xarray.DataArray":
    """Return the potential energy of all bodies of a mechanism in gravity, with its rates; zero at the origin.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism whose bodies have masses.

    Returns
    -------
    xarray.DataArray
        Dimensions time and derivative, J by s; NaN at instants that were not solved.

    Raises
    ------
    MechanismError
        If no body has a mass.

    Examples
    --------
    >>> import jounce as jn
    >>> lift = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -10.0],
    ...     bodies={"cage": jn.Body([0, 0], mass=3.0)},
    ...     joints={"rail": jn.planar.Prismatic(("ground", "cage"), [0, 0], [0, 0], [0, 1], [0, 1])},
    ...     drivers={"height": jn.drivers.SlideDriver(("ground", "cage"), [0, 0], [0, 0], [0, 1], "2*t")},
    ... )
    >>> energy = jn.dynamics.potential_energy(jn.solve(lift, [0.0, 1.0], order=1))
    >>> energy.values[1].round(9).tolist()  # energy and power
    [60.0, 60.0]
    """
    check_motion(motion)
    return labeled(motion, potential_coefficients(motion)[: motion.order + 1].sum(axis=1), "J")


def potential_coefficients(motion: Motion) -> Energies:
    """Return the Taylor coefficients of the potential energies of all bodies, the ground first."""
    masses, (pose_type, coordinates) = required_masses(motion.mechanism), motion.poses
    shared = masses.center, gravity_of(motion.mechanism)
    heights = _heights.along(shared, coordinates, pose_type=pose_type)
    return 0.0 - heights * masses.mass[None]  # no -0


@Mapped
def _heights(
    shared: tuple[Float[Numbers, "component body 1"], Gravity], coordinates: Coordinates, *, pose_type: type[Pose]
) -> Energies:
    center, gravity = shared
    return stacked(dot(pose_of(coordinates, pose_type).point(center), gravity))


def stored_energy(motion: Motion) -> Any:
    """Return the energy stored in springs and other conservative applied forces.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism; the energy is zero without such forces.

    Returns
    -------
    xarray.DataArray
        Dimension time, J; NaN at instants that were not solved.

    Examples
    --------
    >>> import jounce as jn
    >>> sled = jn.Mechanism(
    ...     space="planar",
    ...     bodies={"sled": jn.Body([1, 0])},
    ...     joints={"rail": jn.planar.Prismatic(("ground", "sled"), [0, 0], [0, 0], [1, 0], [1, 0])},
    ...     drivers={"push": jn.drivers.SlideDriver(("ground", "sled"), [0, 0], [0, 0], [1, 0], "1 + t**2")},
    ...     forces={"spring": jn.forces.Spring(("ground", "sled"), [0, 0], [0, 0], stiffness=5.0, length=1.0)},
    ... )
    >>> jn.dynamics.stored_energy(jn.solve(sled, [0.0, 2.0], order=1)).values.round(12).tolist()  # 5/2 t^4
    [0.0, 40.0]
    """
    check_motion(motion)
    pose_type, coordinates = motion.poses
    lanes = cut(coordinates, 1), angles_of(motion.forces), motion.time
    stored = _stored.along(of_one_lane(motion.forces), lanes, pose_type=pose_type)
    return labeled(motion, stored[None], "J")[:, 0].drop_vars("derivative")


@Mapped
def _stored(
    groups: tuple[Group, ...], lanes: tuple[Coordinates, Sequence[Any], Lanes], *, pose_type: type[Pose]
) -> Any:
    coordinates, angles, instants = lanes
    pose, time, count = pose_of(coordinates, pose_type), Jet.variable(instants[None], 1), len(instants)
    groups_with_turns = with_turns(groups, angles)
    energies = [jnp.broadcast_to(g.energy(pose, time).coefficients[0], (g.instances, count)) for g in groups_with_turns]
    return jnp.sum(jnp.concatenate([*energies, jnp.zeros((1, count))]), axis=0)
