"""How forces, constraints and outputs change, to first order, as the bodies of a mechanism move a little otherwise.

A change of a motion is itself a motion: for each body a shift along the global axes and a turn about its own, as Taylor
coefficients in time. All that is linear in it follows by differentiating the expressions on jets along it: no Jacobian
of a force is written, and a change of position, of velocity and of acceleration are three coefficients of one jet.
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
"""Taylor coefficients of shifts and turns of all bodies, the ground first, one change for each lane."""
Coordinates = Mapping[str, Float[Numbers, "_ ... 1"]]
Clock = Float[Numbers, "3 1 1"]
"""Taylor coefficients of time; of zero rate where the laws of time are held."""


@compiled()
def loads_at(equations: Equations, coordinates: Coordinates, clock: Clock) -> tuple[Any, Any]:
    """Return what acts on the bodies in a motion, and the scaled Jacobian.

    Returns
    -------
    loads : array of shape (2, coordinates, bodies)
        Inertia less weight, and applied forces with the minus sign: force, global, and moment in the axes of the body,
        N and N m, of the moving bodies.
    jacobian : array of shape (rows, columns)
        Scaled on both sides.
    """
    pose, time = _moving(equations, coordinates), Jet(tuple(clock))
    system = equations.system
    parts = jnp.stack(_loads(equations, pose, time))[:, :, 1:, 0]
    return parts, system.jacobian(pose.truncate(0), time.truncate(0))[..., 0]


@compiled()
def variations(
    equations: Equations,
    coordinates: Coordinates,
    clock: Clock,
    multipliers: Float[Numbers, "row 1"],
    changes: Changes,
) -> tuple[Float[Numbers, "3 coordinate moving lane"], Float[Numbers, "3 row lane"]]:
    """Return how what the bodies have to balance, and the residuals, vary with changes of a motion.

    Parameters
    ----------
    equations : Equations
        Of the mechanism.
    coordinates : dict of str to array
        Taylor coefficients to order 2 of the coordinates of all bodies, the ground first.
    clock : array of shape (3, 1, 1)
        Those of time.
    multipliers : array of shape (rows, 1)
        Of the scaled rows, held while the bodies change: friction follows them, and where nothing slips, their own
        changes do not count in it.
    changes : array of shape (3, coordinates, bodies, lanes)
        Taylor coefficients, in m and rad.

    Returns
    -------
    forces : array of shape (3, coordinates, bodies, lanes)
        Inertia less weight, applied forces with the minus sign, and ``Phi_q^T lambda`` with the friction of joints, of
        the moving bodies.
    rows : array of shape (3, rows, lanes)
        Taylor coefficients of the variation of the scaled residuals.
    """
    pose, time = _moving(equations, coordinates), Jet(tuple(clock))

    def evaluated(moved: Pose) -> tuple[Any, Any]:
        forces = jnp.stack([*_loads(equations, moved, time), _constraint_wrenches(equations, moved, time, multipliers)])
        return forces[:, :, 1:, 0], stacked(equations.system.residual(moved, time))[..., 0]

    return jax.vmap(lambda change: jax.jvp(evaluated, (pose,), (_tangent(pose, change),))[1], -1, -1)(changes)


@compiled()
def constraint_forces_at(
    equations: Equations, coordinates: Coordinates, clock: Clock, multipliers: Float[Numbers, "row 1"]
) -> Float[Numbers, "coordinate moving"]:
    """Return ``Phi_q^T lambda`` with the friction of joints and the tooth forces that press them, of moving bodies."""
    return _constraint_wrenches(equations, _moving(equations, coordinates), Jet(tuple(clock)), multipliers)[:, 1:, 0]


@compiled("pose_type")
def output_variations(
    groups: Sequence[Group], coordinates: Coordinates, pose_type: type[Pose], changes: Changes
) -> tuple[Float[Numbers, "_ _ _ lane"], ...]:
    """Return how outputs and their rates vary with changes of a motion, as Taylor coefficients."""
    pose: Any = movable(pose_of(coordinates, pose_type))

    def evaluated(moved: Pose) -> tuple[Any, ...]:
        return tuple(stacked(group.evaluate(moved))[..., 0] for group in groups)

    return jax.vmap(lambda change: jax.jvp(evaluated, (pose,), (_tangent(pose, change),))[1], -1, -1)(changes)


@compiled("order")
def law_variations(
    equations: Equations,
    coordinates: Coordinates,
    clock: Clock,
    order: tuple[tuple[int, int], ...],
    changes: Float[Numbers, "3 driver lane"],
) -> Float[Numbers, "3 row lane"]:
    """Return how the scaled residuals vary with changes of the laws of drivers, as Taylor coefficients.

    Parameters
    ----------
    equations, coordinates, clock
        As `variations` takes them.
    order : tuple of tuple of int
        The group and the instance of each driver.
    changes : array of shape (3, drivers, lanes)
        Taylor coefficients, rad or m.
    """
    pose, time = _moving(equations, coordinates), Jet(tuple(clock))

    def evaluated(change: Any) -> Any:
        system = with_changes(equations.system, order, change[..., None])
        return stacked(system.residual(pose, time))[..., 0]

    zeros = jnp.zeros(changes.shape[:-1])
    return jax.vmap(lambda change: jax.jvp(evaluated, (zeros,), (change,))[1], -1, -1)(changes)


@compiled()
def reaches(equations: Equations, coordinates: Coordinates, clock: Clock, changes: Changes) -> tuple[Any, ...]:
    """Return how far each applied force acts along as bodies move by changes, (components, instances, lanes)."""
    pose, time = _moving(equations, coordinates), Jet(tuple(clock)).truncate(0)

    def along(change: Any) -> tuple[Any, ...]:
        varied = _tangent(pose, change).truncate(1)
        at_rest = pose.truncate(1)
        groups = equations.system.forces
        return tuple(group.variation(at_rest, varied, time).coefficients[0][..., 0] for group in groups)

    return jax.vmap(along, -1, -1)(changes)


@compiled()
def sizes_of_forces(
    equations: Equations, coordinates: Coordinates, clock: Clock, changes: Changes
) -> tuple[Float[Numbers, "component instance lane"], ...]:
    """Return the applied forces where the bodies have moved, and move otherwise, by small changes."""
    pose, time = _moving(equations, coordinates), Jet(tuple(clock)).truncate(1)

    def at(change: Any) -> tuple[Any, ...]:
        parts = [(c[: pose.shifts, :, None], c[pose.shifts :, :, None]) for c in change]
        moved = pose.truncate(0).displaced(*parts[0])
        shift = pose.position.coefficients[1] + parts[1][0]
        spin = pose.angle.coefficients[1][None] if pose.turns == 1 else pose.angular_velocity.coefficients[0]
        moved = moved.extended(shift, spin + parts[1][1])
        return tuple(group.force(moved, time).coefficients[0][..., 0] for group in equations.system.forces)

    return jax.vmap(at, -1, -1)(changes)


@compiled()
def residuals_at(equations: Equations, coordinates: Coordinates, clock: Clock) -> Float[Numbers, "level row"]:
    """Return the Taylor coefficients of the scaled residuals in a motion."""
    pose, time = _moving(equations, coordinates), Jet(tuple(clock))
    return stacked(equations.system.residual(pose, time))[..., 0]


@compiled()
def masses_at(equations: Equations, coordinates: Coordinates) -> Float[Numbers, "coordinate coordinate body"]:
    """Return the mass matrix of each moving body, about the origin of its frame."""
    return mass_matrices(_moving(equations, coordinates).truncate(0), equations.masses)[:, :, 1:, 0]


@compiled("pose_type")
def displaced(coordinates: Mapping[str, Numbers], change: Numbers, pose_type: type[Pose]) -> dict[str, Any]:
    """Return coordinates of order zero after all bodies, the ground first, have shifted, m, and turned, rad."""
    pose = pose_at(coordinates, pose_type).displaced(change[: pose_type.shifts], change[pose_type.shifts :])
    return {name: jet.coefficients[0] for name, jet in pose.coordinates().items()}


def at_rest(coordinates: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return Taylor coefficients to order 2 of bodies that stand still, from coordinates of order zero."""
    extended = {name: np.stack([np.asarray(x), *[np.zeros_like(x)] * 2]) for name, x in coordinates.items()}
    if "quaternion" in extended:
        extended["angular_velocity"] = np.zeros((2, *np.shape(coordinates["position"])))
    return extended


def clock_at(instant: float, *, stopped: bool) -> np.ndarray:
    """Return the Taylor coefficients of time at an instant; stopped, the laws of time stand still."""
    return np.array([instant, 0.0 if stopped else 1.0, 0.0]).reshape(3, 1, 1)


def _moving(equations: Equations, coordinates: Coordinates) -> Any:
    return movable(pose_of(coordinates, equations.pose_type))


def _loads(equations: Equations, pose: Pose, time: Jet) -> tuple[Any, Any]:
    """Return inertia less weight, and applied forces with the minus sign, of all bodies."""
    inertia = jnp.concatenate([f.coefficients[0] for f in inertia_forces(pose, equations.masses, equations.gravity)])
    applied = equations.system.applied_forces(pose.truncate(1), time.truncate(1)).coefficients[0]
    return inertia, -applied


def _constraint_wrenches(equations: Equations, pose: Pose, time: Jet, multipliers: Float[Numbers, "row 1"]) -> Any:
    """Return what joints exert on all bodies, with the minus sign of forces."""
    system, now = equations.system, time.truncate(0)
    friction = FreeFriction(system, pose.truncate(1), now)

    def loosened(change: Any) -> Any:
        return [system.variation(pose.truncate(0), change, now).coefficients[0], *friction.slips(change)]

    weights = [multipliers]
    if friction.groups:
        weights += friction.resisting(friction.normal_forces(multipliers))
    return conjugate(loosened, pose.truncate(0), weights)


def _tangent(pose: Pose, change: Float[Numbers, "level coordinate body"]) -> Any:
    """Return the change of a pose whose bodies shift and turn as given by Taylor coefficients."""
    parts = change[..., None]
    shift, turn = Jet(tuple(parts[:, : pose.shifts])), Jet(tuple(parts[:, pose.shifts :]))
    return movable(pose.varied(shift, turn))
