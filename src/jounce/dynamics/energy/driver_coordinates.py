"""A driven mechanism in the coordinates of its drivers: how its bodies move with changes of their laws.

The laws of the drivers are generalized coordinates: with them, joints and loops determine all bodies. A constant is
added to a law, and all poses follow from it to first order by the factored Jacobian, order after order, as in a solve:
these are the columns of the Jacobian of the bodies, as jets.
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
    """The laws of a group of drivers, changed by jets."""

    law: Any
    change: Float[Numbers, "levels instance batch"]  # Taylor coefficients

    def __call__(self, time: Jet) -> Jet:
        """Return the law at the instants of a jet."""
        return self.law(time) + Jet(tuple(self.change[: time.order + 1]))


def in_driver_coordinates(
    motion: Motion,
    form: Form,
    *,
    power: int = 0,
) -> "xarray.DataArray":
    """Return a sum of slopes of energies in the coordinates of the drivers.

    Parameters
    ----------
    motion : Motion
        Of a mechanism whose bodies have masses, and whose drivers prescribe all that moves.
    form : Form
        The sum, with its rates.
    power : int, default 0
        By which power of s what the form gives is divided, in units of forces.

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
    lanes, how = (cut(coordinates, 0), motion.time), {"pose_type": pose_type, "order": order, "form": form}
    values = _evaluated.along((model.system, masses), lanes, **how)
    values = np.where(spoiled(motion.passages, motion.time, form.order), np.nan, values)
    return _of_drivers(motion, values, power)


def _of_drivers(motion: Motion, values: Float[np.ndarray, "order driver time"], power: int = 0) -> Any:
    """Return what acts along the coordinates of drivers, labeled, with the unit of each, N or N*m over s^power."""
    drivers = motion.mechanism.drivers
    efforts = ["N*m" if is_turning(driver) else "N" for driver in drivers.values()]
    units = [derivative_unit(unit, power) if power >= 0 else f"{unit}*s^{-power}" for unit in efforts]
    return labeled(motion, values, driver=tuple(drivers)).assign_coords(unit=("driver", units))


def is_driven(motion: Motion) -> bool:
    """Tell whether drivers prescribe all that moves."""
    system = motion.model.system
    rows, columns = system.shape if system.groups else (0, 1)
    return (rows if system.rank is None else system.rank) == columns and bool(motion.mechanism.drivers)


def balanced(motion: Motion, rates: int, *, gravity: bool) -> "xarray.DataArray":
    """Return what inertia asks of the drivers, and on request weight too, by multipliers: nothing applied acts.

    Parameters
    ----------
    motion : Motion
        Of a mechanism whose bodies have masses, and whose drivers prescribe all that moves.
    rates : int
        How many rates are requested.
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
        """Return the pose where constants are added to the laws."""
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
    """Return a system whose drivers, by group and instance, have laws that are changed."""
    groups = list(system.groups)
    for index in {group for group, _ in order}:
        members = [order.index((index, instance)) for instance in range(groups[index].instances)]
        law = ChangedLaw(groups[index].element.motion, changes[:, np.array(members)])
        groups[index] = with_fields(groups[index], element=with_fields(groups[index].element, motion=law))
    return with_fields(system, groups=tuple(groups))


def followed(system: System, start_pose: Pose, factor: Factor, time: Jet) -> Pose:
    """Return the pose with all derivatives that the time jet has, right to first order in changes of the system.

    The factors are those of the system without changes. What they leave of the residual is corrected by them once more,
    which is all of it to first order: no derivative is taken of a factorization.
    """

    def solved(pose: Any, solution: Any) -> Any:
        return pose.extended(*system.coordinates(solution, pose.shifts))

    def left(pose: Any) -> Any:
        return system.residual(pose, time.truncate(pose.order)).dense().coefficients[pose.order]

    pose = start_pose.displaced(*system.coordinates(factor.solve(-left(start_pose)), start_pose.shifts))
    for _ in range(time.order):
        solution = factor.solve(-left(pose.extended(None, None)))
        solution = solution - factor.solve(left(solved(pose, solution)))
        pose = jax.lax.optimization_barrier(solved(pose, solution))  # or XLA computes it again in all that uses it
    return pose
