"""First-order variations of forces, constraints and outputs with changes of a motion.

A change of a motion is itself a motion: for each body a shift along the global axes and a rotation about its own axes,
as Taylor coefficients in time. Changes of position, velocity and acceleration are three coefficients of one jet. All
variations are directional derivatives of the expressions on jets; no Jacobian of a force is written by hand.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.energy.driver_coordinates import with_changes
from jounce.dynamics.forward.accelerations import Equations, conjugate
from jounce.dynamics.forward.loads import inertia_forces, mass_matrices
from jounce.dynamics.friction.free_motion import FreeFriction
from jounce.dynamics.motion_values import pose_of
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.system import Group, movable
from jounce.rigid.pose import Pose

LEVELS = 3  # position, velocity and acceleration
Changes = Float[Numbers, "level coordinate all lane"]
"""Taylor coefficients of shifts and rotations of all bodies, the ground first, with one change in each lane."""
Coordinates = Mapping[str, Float[Numbers, "_ ... 1"]]
Clock = Float[Numbers, "3 1 1"]
"""Taylor coefficients of time; the rate is zero if the laws are frozen."""


@compiled()
def loads_at(equations: Equations, coordinates: Coordinates, clock: Clock) -> tuple[Any, Any]:
    """Return the loads on the moving bodies in a motion, and the scaled Jacobian.

    Returns
    -------
    loads : array of shape (2, coordinates, bodies)
        Inertia less weight, and applied forces with the minus sign: global forces, N, and moments in body axes, N m.
    jacobian : array of shape (rows, columns)
        Jacobian with rows and columns scaled.
    """
    pose, time = _moving(equations, coordinates), Jet(tuple(clock))
    system = equations.system
    loads = jnp.stack(_loads(equations, pose, time))[:, :, 1:, 0]
    return loads, system.jacobian(pose.truncate(0), time.truncate(0))[..., 0]


@compiled()
def variations(
    equations: Equations,
    coordinates: Coordinates,
    clock: Clock,
    multipliers: Float[Numbers, "row 1"],
    changes: Changes,
) -> tuple[Float[Numbers, "3 coordinate moving lane"], Float[Numbers, "3 row lane"]]:
    """Return the variations of loads, constraint forces and residuals with changes of a motion.

    Parameters
    ----------
    equations : Equations
        Equations of motion of the mechanism.
    coordinates : dict of str to array
        Taylor coefficients to order 2 of the coordinates of all bodies, the ground first.
    clock : array of shape (3, 1, 1)
        Taylor coefficients of time.
    multipliers : array of shape (rows, 1)
        Multipliers of the scaled rows, held constant. Friction depends on them; without slip, their variations do not
        contribute to it.
    changes : array of shape (3, coordinates, bodies, lanes)
        Taylor coefficients, in m and rad.

    Returns
    -------
    forces : array of shape (3, coordinates, bodies, lanes)
        For the moving bodies: inertia less weight, applied forces with the minus sign, and ``Phi_q^T lambda`` with
        joint friction.
    rows : array of shape (3, rows, lanes)
        Taylor coefficients of the variation of the scaled residuals.
    """
    pose, time = _moving(equations, coordinates), Jet(tuple(clock))

    def forces_and_rows(varied: Pose) -> tuple[Any, Any]:
        forces = jnp.stack(
            [*_loads(equations, varied, time), _constraint_wrenches(equations, varied, time, multipliers)]
        )
        return forces[:, :, 1:, 0], stacked(equations.system.residual(varied, time))[..., 0]

    return jax.vmap(lambda change: jax.jvp(forces_and_rows, (pose,), (_tangent(pose, change),))[1], -1, -1)(changes)


@compiled()
def constraint_forces_at(
    equations: Equations, coordinates: Coordinates, clock: Clock, multipliers: Float[Numbers, "row 1"]
) -> Float[Numbers, "coordinate moving"]:
    """Return ``Phi_q^T lambda`` on moving bodies, with joint friction and the tooth forces that press the joints."""
    return _constraint_wrenches(equations, _moving(equations, coordinates), Jet(tuple(clock)), multipliers)[:, 1:, 0]


@compiled("pose_type")
def output_variations(
    groups: Sequence[Group], coordinates: Coordinates, pose_type: type[Pose], changes: Changes
) -> tuple[Float[Numbers, "_ _ _ lane"], ...]:
    """Return the Taylor coefficients of the variations of outputs with changes of a motion."""
    pose: Any = movable(pose_of(coordinates, pose_type))

    def output_series(varied: Pose) -> tuple[Any, ...]:
        return tuple(stacked(group.evaluate(varied))[..., 0] for group in groups)

    return jax.vmap(lambda change: jax.jvp(output_series, (pose,), (_tangent(pose, change),))[1], -1, -1)(changes)


@compiled("order")
def law_variations(
    equations: Equations,
    coordinates: Coordinates,
    clock: Clock,
    order: tuple[tuple[int, int], ...],
    changes: Float[Numbers, "3 driver lane"],
) -> Float[Numbers, "3 row lane"]:
    """Return the Taylor coefficients of the variations of scaled residuals with changes of driver laws.

    Parameters
    ----------
    equations, coordinates, clock
        As for `variations`.
    order : tuple of tuple of int
        The group and the instance of each driver.
    changes : array of shape (3, drivers, lanes)
        Taylor coefficients, rad or m.
    """
    pose, time = _moving(equations, coordinates), Jet(tuple(clock))

    def residuals(change: Any) -> Any:
        system = with_changes(equations.system, order, change[..., None])
        return stacked(system.residual(pose, time))[..., 0]

    zeros = jnp.zeros(changes.shape[:-1])
    return jax.vmap(lambda change: jax.jvp(residuals, (zeros,), (change,))[1], -1, -1)(changes)


@compiled()
def reaches(equations: Equations, coordinates: Coordinates, clock: Clock, changes: Changes) -> tuple[Any, ...]:
    """Return the displacements conjugate to each applied force for changes, (components, instances, lanes)."""
    pose, time = _moving(equations, coordinates), Jet(tuple(clock)).truncate(0)

    def conjugates(change: Any) -> tuple[Any, ...]:
        varied = _tangent(pose, change).truncate(1)
        rest_pose = pose.truncate(1)
        groups = equations.system.forces
        return tuple(group.variation(rest_pose, varied, time).coefficients[0][..., 0] for group in groups)

    return jax.vmap(conjugates, -1, -1)(changes)


@compiled()
def sizes_of_forces(
    equations: Equations, coordinates: Coordinates, clock: Clock, changes: Changes
) -> tuple[Float[Numbers, "component instance lane"], ...]:
    """Return the applied forces after small changes of positions and velocities."""
    pose, time = _moving(equations, coordinates), Jet(tuple(clock)).truncate(1)

    def forces_after(change: Any) -> tuple[Any, ...]:
        levels = [(c[: pose.shifts, :, None], c[pose.shifts :, :, None]) for c in change]
        varied = pose.truncate(0).displaced(*levels[0])
        shift = pose.position.coefficients[1] + levels[1][0]
        spin = pose.angle.coefficients[1][None] if pose.turns == 1 else pose.angular_velocity.coefficients[0]
        varied = varied.extended(shift, spin + levels[1][1])
        return tuple(group.force(varied, time).coefficients[0][..., 0] for group in equations.system.forces)

    return jax.vmap(forces_after, -1, -1)(changes)


@compiled()
def residuals_at(equations: Equations, coordinates: Coordinates, clock: Clock) -> Float[Numbers, "level row"]:
    """Return the Taylor coefficients of the scaled residuals in a motion."""
    pose, time = _moving(equations, coordinates), Jet(tuple(clock))
    return stacked(equations.system.residual(pose, time))[..., 0]


@compiled()
def masses_at(equations: Equations, coordinates: Coordinates) -> Float[Numbers, "coordinate coordinate body"]:
    """Return the mass matrix of each moving body about the origin of its frame."""
    return mass_matrices(_moving(equations, coordinates).truncate(0), equations.masses)[:, :, 1:, 0]


@compiled("pose_type")
def displaced(coordinates: Mapping[str, Numbers], change: Numbers, pose_type: type[Pose]) -> dict[str, Any]:
    """Return coordinates of order zero after shifts, m, and rotations, rad, of all bodies, the ground first."""
    pose = pose_at(coordinates, pose_type).displaced(change[: pose_type.shifts], change[pose_type.shifts :])
    return {name: jet.coefficients[0] for name, jet in pose.coordinates().items()}


def at_rest(coordinates: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return Taylor coefficients to order 2 of bodies at rest, from coordinates of order zero."""
    extended = {name: np.stack([np.asarray(x), *[np.zeros_like(x)] * 2]) for name, x in coordinates.items()}
    if "quaternion" in extended:
        extended["angular_velocity"] = np.zeros((2, *np.shape(coordinates["position"])))
    return extended


def clock_at(instant: float, *, stopped: bool) -> np.ndarray:
    """Return the Taylor coefficients of time at an instant; `stopped` freezes the laws."""
    return np.array([instant, 0.0 if stopped else 1.0, 0.0]).reshape(3, 1, 1)


def _moving(equations: Equations, coordinates: Coordinates) -> Any:
    return movable(pose_of(coordinates, equations.pose_type))


def _loads(equations: Equations, pose: Pose, time: Jet) -> tuple[Any, Any]:
    """Return inertia less weight, and applied forces with the minus sign, for all bodies."""
    inertia = jnp.concatenate([f.coefficients[0] for f in inertia_forces(pose, equations.masses, equations.gravity)])
    applied = equations.system.applied_forces(pose.truncate(1), time.truncate(1)).coefficients[0]
    return inertia, -applied


def _constraint_wrenches(equations: Equations, pose: Pose, time: Jet, multipliers: Float[Numbers, "row 1"]) -> Any:
    """Return ``Phi_q^T lambda`` with joint friction for all bodies: the negative wrenches of the joints."""
    system, instant = equations.system, time.truncate(0)
    friction = FreeFriction(system, pose.truncate(1), instant)

    def loosened(change: Any) -> Any:
        return [system.variation(pose.truncate(0), change, instant).coefficients[0], *friction.slips(change)]

    weights = [multipliers]
    if friction.groups:
        weights += friction.resisting(friction.normal_forces(multipliers))
    return conjugate(loosened, pose.truncate(0), weights)


def _tangent(pose: Pose, change: Float[Numbers, "level coordinate body"]) -> Any:
    """Return the change of a pose from the Taylor coefficients of shifts and rotations."""
    coefficients = change[..., None]
    shift, turn = Jet(tuple(coefficients[:, : pose.shifts])), Jet(tuple(coefficients[:, pose.shifts :]))
    return movable(pose.varied(shift, turn))
