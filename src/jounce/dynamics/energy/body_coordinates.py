"""Equations of motion in body coordinates, for mechanisms whose drivers do not prescribe the whole motion.

The coordinates of a body are the position of its origin and, in the plane, its angle; in space, small rotations from
the motion about the axes of the body. A coordinate changes the whole motion by a constant. The derivative of the
points of the body with respect to it is a jet: a column of the Jacobian.
"""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.energy.slopes import Columns, Form, column_of, slope_values
from jounce.dynamics.forward.loads import inertia_forces
from jounce.dynamics.inverse.constraint_equations import COLUMNS
from jounce.dynamics.masses import Gravity, Masses, gravity_of, required_masses
from jounce.dynamics.motion_values import Coordinates, cut, labeled, pose_of
from jounce.errors import MechanismError
from jounce.execution.mapped import Mapped
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.kinematics import Motion
from jounce.kinematics.continuation.change_points import spoiled
from jounce.mechanism.system import movable
from jounce.rigid.pose import Pose
from jounce.units.shown_units import derivative_unit

if TYPE_CHECKING:
    import xarray


def in_body_coordinates(motion: Motion, form: Form, *, power: int = 0) -> "xarray.DataArray":
    """Return a sum of energy slopes with respect to the coordinates of all bodies.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism whose bodies have masses.
    form : Form
        The sum, with its rates.
    power : int, default 0
        Power of s by which the unit of force is divided to give the unit of the sum.

    Returns
    -------
    xarray.DataArray
        Dimensions time, derivative and column, with the unit of each column; NaN at instants that were not solved.

    Raises
    ------
    MechanismError
        If no body has a mass, or the motion has too few derivatives.
    """
    masses = required_masses(motion.mechanism)
    return _of_bodies(motion, _evaluated, masses, form.order, power, form=form)


def balanced_bodies(motion: Motion, rates: int, *, gravity: bool) -> "xarray.DataArray":
    """Return the inertia forces of each body, less its weight if `gravity` is true, from its momentum balances.

    Parameters
    ----------
    motion : Motion
        Motion of a mechanism whose bodies have masses.
    rates : int
        Number of rates.
    gravity : bool
        Whether weight is subtracted.

    Returns
    -------
    xarray.DataArray
        As from `in_body_coordinates`: forces in global axes, and moments about the body origins, in space in body axes.

    Raises
    ------
    MechanismError
        If no body has a mass, or the motion has too few derivatives.
    """
    masses, order = required_masses(motion.mechanism), rates + 2
    falling = gravity_of(motion.mechanism)
    return _of_bodies(motion, _momentum, (masses, falling if gravity else np.zeros_like(falling)), order, order=order)


def _of_bodies(
    motion: Motion, program: Mapped, shared: Any, min_order: int, power: int = 0, **static: Any
) -> "xarray.DataArray":
    """Return the labeled values of a program of the body coordinates along a motion.

    The program needs derivatives to order `min_order`.

    Raises
    ------
    MechanismError
        If the motion has too few derivatives.
    """
    mechanism, coordinates = motion.mechanism, motion.poses[1]
    if len(coordinates["position"]) - 1 < min_order:
        raise MechanismError(f"this needs a motion of order {min_order} or higher", name="order", value=motion.order)
    values = program.along(shared, cut(coordinates, min_order), pose_type=motion.poses[0], **static)
    values = np.where(spoiled(motion.passages, motion.time, min_order), np.nan, values)
    names = COLUMNS[mechanism.space]
    efforts = ["N" if name in "xyz" else "N*m" for name in names] * len(mechanism.bodies)
    units = [derivative_unit(unit, power) if power >= 0 else f"{unit}*s^{-power}" for unit in efforts]
    columns = [f"{body}.{name}" for body in mechanism.bodies for name in names]
    return labeled(motion, values, column=columns).assign_coords(unit=("column", units))


@Mapped
def _momentum(
    shared: tuple[Masses, Gravity], coordinates: Coordinates, *, pose_type: type[Pose], order: int
) -> Float[Numbers, "level coordinate time"]:
    masses, gravity = shared
    pose = movable(pose_of(coordinates, pose_type, order).truncate(order))
    forces = jnp.concatenate([stacked(force) for force in inertia_forces(pose, masses, gravity)], axis=1)[:, :, 1:]
    return jnp.swapaxes(forces, 1, 2).reshape(forces.shape[0], -1, forces.shape[-1])


@Mapped
def _evaluated(
    masses: Masses, coordinates: Coordinates, *, pose_type: type[Pose], form: Form
) -> Float[Numbers, "level coordinate time"]:
    pose = movable(pose_of(coordinates, pose_type, form.order).truncate(form.order))
    moving_poses, body_masses = jax.tree.map(lambda x: x[..., 1:, :], (pose, masses))  # without the ground

    def of_body(pose: Any, masses: Any) -> Any:
        pose, masses = jax.tree.map(lambda x: x[..., None, :], (pose, masses))
        size = pose.shifts + pose.turns

        def column(direction: Any) -> tuple[Any, Any]:
            unit = jnp.broadcast_to(direction[:, None, None], (size, *pose.position.shape[1:]))
            shift, turn = (Jet.constant(x, pose.order).dense() for x in (unit[: pose.shifts], unit[pose.shifts :]))
            return column_of(pose, movable(pose.varied(shift, turn)), masses.center, form.column_order)

        linear, angular = jax.vmap(column, out_axes=2)(np.eye(size))
        return slope_values(form, pose, Columns(Jet(tuple(linear)), Jet(tuple(angular))), *masses)

    values = jax.vmap(of_body, in_axes=-2, out_axes=1)(moving_poses, body_masses)  # levels, bodies, coordinates, time
    return values.reshape(values.shape[0], -1, values.shape[-1])
