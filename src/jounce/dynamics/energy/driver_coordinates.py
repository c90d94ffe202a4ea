"""Equations of motion in driver coordinates: the laws of the drivers are the generalized coordinates.

The laws, with joints and loops, determine all bodies. The columns of the Jacobian of the bodies, as jets, follow from
adding a constant to a law: the factored constraint Jacobian gives the change of all poses to first order, one
derivative order after the other, as in a solve.
"""

import dataclasses
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.modules import Module, with_fields
from jounce.base.shapes import Numbers
from jounce.dynamics.energy.slopes import Columns, Form, column_of, slope_values
from jounce.dynamics.forward.accelerations import Lanes
from jounce.dynamics.inverse.motion_forces import MotionForces
from jounce.dynamics.masses import Masses, required_masses
from jounce.dynamics.motion_values import Coordinates, cut, labeled, pose_of
from jounce.errors import MechanismError
from jounce.execution.mapped import Mapped
from jounce.jet import Jet
from jounce.kinematics import Motion
from jounce.kinematics.continuation.change_points import spoiled
from jounce.kinematics.continuation.jacobian_factors import Factor, factored
from jounce.mechanism.building.element_indices import element_indices
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.system import System, movable
from jounce.rigid.pose import Pose
from jounce.units.shown_units import derivative_unit

if TYPE_CHECKING:
    import xarray


class ChangedLaw(Module):
    """The laws of a group of drivers, with jets added."""

    law: Any
    change: Float[Numbers, "levels instance batch"]  # Taylor coefficients

    def __call__(self, time: Jet) -> Jet:
        """Return the changed laws at the instants of a time jet."""
        return self.law(time) + Jet(tuple(self.change[: time.order + 1]))


def in_driver_coordinates(
    motion: Motion,
    form: Form,
    *,
    power: int = 0,
) -> "xarray.DataArray":
    """Return a sum of energy slopes with respect to the coordinates of the drivers.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism whose bodies have masses, and whose drivers prescribe its whole motion.
    form : Form
        The sum, with its rates.
    power : int, default 0
        Power of s by which the unit of force is divided to give the unit of the sum.

    Returns
    -------
    xarray.DataArray
        Dimensions time, derivative and driver, with the unit of each driver; NaN at instants that were not solved, and
        at change points.

    Raises
    ------
    MechanismError
        If no body has a mass.
    """
    model, names = motion.model, tuple(motion.mechanism.drivers)
    indices = element_indices(model)
    order = tuple((indices[name].group, indices[name].instance) for name in names)
    pose_type, coordinates = motion.poses
    masses = required_masses(motion.mechanism)
    lanes, options = (cut(coordinates, 0), motion.time), {"pose_type": pose_type, "order": order, "form": form}
    values = _evaluated.along((model.system, masses), lanes, **options)
    values = np.where(spoiled(motion.passages, motion.time, form.order), np.nan, values)
    return _of_drivers(motion, values, power)


def _of_drivers(motion: Motion, values: Float[np.ndarray, "order driver time"], power: int = 0) -> Any:
    """Return generalized forces of the drivers as a labeled array, with units N or N*m over s^power."""
    drivers = motion.mechanism.drivers
    efforts = ["N*m" if is_turning(driver) else "N" for driver in drivers.values()]
    units = [derivative_unit(unit, power) if power >= 0 else f"{unit}*s^{-power}" for unit in efforts]
    return labeled(motion, values, driver=tuple(drivers)).assign_coords(unit=("driver", units))


def is_driven(motion: Motion) -> bool:
    """Return whether the drivers prescribe the whole motion."""
    system = motion.model.system
    rows, columns = system.shape if system.groups else (0, 1)
    return (rows if system.rank is None else system.rank) == columns and bool(motion.mechanism.drivers)


def balanced(motion: Motion, rates: int, *, gravity: bool) -> "xarray.DataArray":
    """Return the driver forces that balance inertia, and weight if `gravity` is true, by multipliers.

    Applied forces and friction do not act.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism whose bodies have masses, and whose drivers prescribe its whole motion.
    rates : int
        Number of rates.
    gravity : bool
        Whether the bodies have weight.

    Returns
    -------
    xarray.DataArray
        Dimensions time, derivative and driver, with the unit of each driver; NaN at instants that were not solved.

    Raises
    ------
    MechanismError
        If no body has a mass, or the motion has too few derivatives.
    """
    required_masses(motion.mechanism)
    if motion.order < rates + 2:
        raise MechanismError(f"this needs a motion solved to order {rates + 2}", name="order", value=motion.order)
    forces = MotionForces(motion, gravity=gravity, applied=False, friction=False)
    values = np.stack([forces.driver_force(name)[: rates + 1, 0] for name in motion.mechanism.drivers], axis=1)
    return _of_drivers(motion, values)


@Mapped
def _evaluated(
    shared: tuple[System, Masses],
    lanes: tuple[Coordinates, Lanes],
    *,
    pose_type: type[Pose],
    order: tuple[tuple[int, int], ...],
    form: Form,
) -> Any:
    (system, masses), (coordinates, instants) = shared, lanes
    start_pose = pose_of(coordinates, pose_type)
    factor = factored(dataclasses.replace(system, fronts=None), start_pose, Jet([instants[None]]))
    time = Jet.variable(instants[None], form.order)

    def pose_after(change: Any) -> Pose:
        """Return the pose after constants are added to the laws."""
        levels = jnp.concatenate([change[None], jnp.zeros((form.order, *change.shape))])
        return movable(followed(with_changes(system, order, levels), start_pose, factor, time))

    unchanged = jnp.zeros((len(order), len(instants)))
    pose, slope = jax.linearize(pose_after, unchanged)

    def column(unit: Any) -> tuple[Any, Any]:
        return column_of(pose, slope(jnp.broadcast_to(unit, unchanged.shape)), masses.center, form.column_order)

    linear, angular = jax.vmap(column, out_axes=2)(np.eye(len(order))[..., None])
    columns = Columns(Jet(tuple(linear)), Jet(tuple(angular)))
    return slope_values(form, pose, columns, *masses)


def with_changes(
    system: System, order: tuple[tuple[int, int], ...], changes: Float[Numbers, "levels driver batch"]
) -> System:
    """Return the system with changed laws of its drivers, which `order` names by group and instance."""
    groups = list(system.groups)
    for index in {group for group, _ in order}:
        members = [order.index((index, instance)) for instance in range(groups[index].instances)]
        law = ChangedLaw(groups[index].element.motion, changes[:, np.array(members)])
        groups[index] = with_fields(groups[index], element=with_fields(groups[index].element, motion=law))
    return with_fields(system, groups=tuple(groups))


def followed(system: System, start_pose: Pose, factor: Factor, time: Jet) -> Pose:
    """Return the pose with as many derivatives as the time jet, exact to first order in changes of the system.

    The factors are those of the unchanged system. A second solve with them removes the remaining residual to first
    order, so that no factorization is differentiated.
    """

    def extended(pose: Any, solution: Any) -> Any:
        return pose.extended(*system.coordinates(solution, pose.shifts))

    def remainder(pose: Any) -> Any:
        return system.residual(pose, time.truncate(pose.order)).dense().coefficients[pose.order]

    pose = start_pose.displaced(*system.coordinates(factor.solve(-remainder(start_pose)), start_pose.shifts))
    for _ in range(time.order):
        solution = factor.solve(-remainder(pose.extended(None, None)))
        solution = solution - factor.solve(remainder(extended(pose, solution)))
        pose = jax.lax.optimization_barrier(
            extended(pose, solution)
        )  # without the barrier, XLA computes it again for each use
    return pose
