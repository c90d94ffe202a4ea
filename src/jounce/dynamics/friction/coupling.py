"""Joint friction in the equations of motion: forces proportional to reactions, which in turn depend on them.

The normal forces N of joints with friction are unknowns in addition to the multipliers. The friction for a unit normal
force is known from the motion, and acts on the bodies as a multiplier acts through its row. So

    J^T lambda + V N = load,    N = |R(lambda)|,

where R is the reaction force of the joint; for gears N is the torque loss, a function of their multiplier alone. With
the solution of the frictionless equations, lambda = S load, there remains one equation for each normal force,
``N = |R(S load - S V N)|``. Newton's method solves these few equations, starting from no friction; where it diverges,
by continuation in the friction. The higher Taylor coefficients follow from linear equations with the same matrix at
every order.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Float

from jounce.base.modules import Module
from jounce.base.shapes import Numbers
from jounce.constraints.friction import GearFriction, displacements, normal_force, slip_velocity
from jounce.errors import UnsupportedError
from jounce.jet import Jet
from jounce.jet.algebra import stacked
from jounce.kinematics.sensitivity.jacobian_series import Slope, along_displacements
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism import Mechanism
from jounce.mechanism.building.builder import Model, group_rows
from jounce.mechanism.system import Group, System, movable
from jounce.rigid.pose import Pose

SHARES = (0.25, 0.5, 0.75, 1.0)  # of friction, at which the sign of the determinant is checked
STEPS = 30  # of Newton's method; four or five suffice far from locking
RAMP, EACH = 16, 6  # of the continuation: number of increments of friction, and of Newton steps for each
CLOSE = 1e-15  # fraction of the largest normal force: a smaller change is rounding
ROUNDING = 1e-14  # fraction of the largest multiplier: rounding of the torque loss of lossless gears

NormalForces = Float[Numbers, "joint batch"]


def has_friction(group: Group) -> bool:
    """Return whether joints of a group have friction."""
    return getattr(group.element, "friction", None) is not None


def has_flanks(group: Group) -> bool:
    """Return whether the elements of a group are teeth with a pressure angle."""
    return hasattr(group.element, "flank") and group.element.pressure_angle is not None


def pressing_teeth(system: System) -> list[Group]:
    """Return the groups of teeth with a pressure angle if joints have friction, which tooth forces press."""
    return [group for group in system.groups if has_flanks(group)] if any(map(has_friction, system.groups)) else []


def loses_torque(element: Any) -> bool:
    """Return whether the friction of joints is a loss of transmitted torque, as that of gears."""
    return isinstance(getattr(element, "friction", None), GearFriction)


def joints_with_friction(model: Model, system: System) -> list[str]:
    """Return the names of the joints with friction."""
    pairs = zip(system.groups, group_rows(model), strict=True)
    return [name for group, rows in pairs if has_friction(group) for name in model.rows[rows][: group.instances]]


def check_unique_pressing(model: Model, system: System) -> None:
    """Raise UnsupportedError if joints have friction and redundant constraints leave their reactions undetermined."""
    if system.rank is not None and (names := joints_with_friction(model, system)):
        message = (
            "friction follows reactions, and redundant constraints leave these open: free the mechanism of constraints "
            "that repeat others (a ball in the place of a pin, a rod in the place of a coupler), or leave friction out"
        )
        raise UnsupportedError(message, name=f"{names[0]}.friction")


def check_no_friction(mechanism: Mechanism, result: str) -> None:
    """Raise UnsupportedError, with the name of the joint, if a joint has friction and `result` does not support it."""
    for name, joint in mechanism.joints.items():
        if getattr(joint, "friction", None) is not None:
            message = f"{result} of a mechanism whose joints have friction cannot be computed yet; leave friction out"
            raise UnsupportedError(message, name=f"joints.{name}.friction")


def friction_slope(element: Any, poses: Sequence[Pose], slot: int) -> Slope:
    """Return the generalized friction force on the body in a slot for a unit normal force, as jets.

    Parameters
    ----------
    element : AbstractConstraint
        Joints with friction; the values have shape (..., instances, 1).
    poses : sequence of SpatialPose or PlanarPose
        Poses of the bodies in each slot, shape (..., instances, batch), with one order more than the result.
    slot : int
        Slot of the body.

    Returns
    -------
    array of shape (order, coordinates, 1, instances, batch)
        As from `slopes` for a residual with one row, whose multiplier is the normal force.
    """
    factor = resisting(element, poses)
    bodies = tuple(pose.truncate(pose.order - 1) for pose in poses)
    body = movable(bodies[slot])

    def resisted(change: Any) -> Any:
        changes = [None] * slot + [change] + [None] * (len(bodies) - slot - 1)
        slip = element.slip(bodies, displacements([*bodies[:slot], body, *bodies[slot + 1 :]], changes))
        return stacked(slip.dot(factor))[:, None]

    return along_displacements(body, resisted)


def pressed(element: Any, poses: Sequence[Pose], force: Float[Jet, "component *batch"]) -> Jet:
    """Return the normal force of joints, (instances, batch), from their global force on the second body."""
    return normal_force(element, tuple(pose.truncate(force.order) for pose in poses), force)


def resisting(element: Any, poses: Sequence[Pose]) -> Float[Jet, "direction instance batch"]:
    """Return the part of the normal force that resists slip in each direction, with one order less than the poses."""
    return element.friction.resisting(slip_velocity(element, poses))


def torque_lost(
    element: Any, multipliers: Float[Jet, "row instance batch"], resisting: Float[Jet, "direction instance batch"]
) -> Jet:
    """Return the torque loss of turning gears, (instances, batch), from their multipliers."""
    return element.friction.lost(element.passed_on(multipliers[0]), resisting[0])


class Coupling(Module):
    """The solved normal forces of order zero, and the linear equations of the higher orders.

    Parameters
    ----------
    response : array of shape (joints, rows, batch)
        Decrease of the multipliers for a unit normal force in each joint.
    factor : DenseFactor
        Factors of the matrix of the normal forces, ``1 + dN/dlambda S V``.
    """

    response: Float[Numbers, "joint row batch"]
    factor: DenseFactor

    @classmethod
    def of(
        cls,
        normal: Callable[[Any], Any],
        free: Float[Numbers, "row batch"],
        response: Float[Numbers, "joint row batch"],
    ) -> tuple["Coupling", Float[Numbers, "row batch"], NormalForces]:
        """Return the coupling, multipliers and normal forces of order zero, by Newton's method.

        Parameters
        ----------
        normal : callable
            Function from multipliers, (rows, batch), to normal forces, (joints, batch).
        free : array of shape (rows, batch)
            Multipliers without friction.
        response : array of shape (joints, rows, batch)
            Decrease of the multipliers for a unit normal force in each joint.

        Returns
        -------
        coupling : Coupling
        multipliers : array of shape (rows, batch)
        forces : array of shape (joints, batch)
            Normal forces. NaN, as the multipliers, where friction locks: where no normal forces satisfy the equations,
            or the matrix becomes singular as friction grows from none.
        """

        def with_friction(forces: Any, free: Any, response: Any) -> Any:
            return free - jnp.sum(response * forces[:, None], axis=0)

        def matrix(normal: Callable[[Any], Any], multipliers: Any, response: Any) -> Any:
            slopes = jax.vmap(lambda column: jax.jvp(normal, (multipliers,), (column,))[1])(response)
            return jnp.eye(len(response))[..., None] + jnp.swapaxes(slopes, 0, 1)

        pure_normal, extras = jax.closure_convert(normal, free)
        extras = [jax.lax.stop_gradient(x) for x in extras]
        inputs = [jax.lax.stop_gradient(x) for x in (free, response)]

        def normal_now(multipliers: Any) -> Any:
            return pure_normal(multipliers, *extras)

        def gap_of(normal: Callable[[Any], Any], forces: Any, free: Any, response: Any) -> tuple[Any, Any]:
            """Return the residual of the normal forces, and its negative Jacobian."""
            multipliers = with_friction(forces, free, response)
            return normal(multipliers) - forces, matrix(normal, multipliers, response)

        def is_solution(gap: Any, forces: Any, jacobian: Any) -> Any:
            first_size, last_size, extras = (jnp.max(jnp.abs(x), axis=0) for x in (start, forces, inputs[0]))
            is_small = jnp.max(jnp.abs(gap), axis=0) <= 1e-9 * (first_size + last_size) + ROUNDING * extras
            return is_small & _is_regular_from_none(jacobian)

        def iterated(is_moving: Any, forces: Any, fractions: int) -> Any:
            """Return forces after Newton steps in the lanes that move, as friction grows in a number of shares."""

            def improved(carry: Any) -> Any:
                forces, is_moving, step = carry
                fraction = jnp.minimum(jnp.ceil((step + 1).astype(float) / EACH) / fractions, 1.0)
                gap, jacobian = gap_of(normal_now, forces, inputs[0], fraction * inputs[1])
                change = DenseFactor.of(jacobian).solve(gap, refined=False)
                size = jnp.max(jnp.abs(forces), axis=0)
                has_moved = (jnp.max(jnp.abs(change), axis=0) > CLOSE * size) | (fraction < 1.0)
                return jnp.where(is_moving, forces + change, forces), is_moving & has_moved, step + 1

            def unsolved(carry: Any) -> Any:
                return jnp.any(carry[1]) & (carry[2] < STEPS + EACH * (fractions - 1))

            return jax.lax.while_loop(unsolved, improved, (forces, is_moving, jnp.zeros((), jnp.int32)))[0]

        start = normal_now(inputs[0])
        # start from no friction, so that joints are pressed on the same side as without friction in the first step
        forces = iterated(jnp.ones(start.shape[-1], bool), jnp.zeros_like(start), 1)
        gap, jacobian = gap_of(normal_now, forces, *inputs)
        is_lost = ~is_solution(gap, forces, jacobian)
        forces = jax.lax.stop_gradient(iterated(is_lost, jnp.where(is_lost, 0.0, forces), RAMP))
        gap, jacobian = gap_of(normal, forces, free, response)
        factor = DenseFactor.of(jacobian)
        has_converged = is_solution(*map(jax.lax.stop_gradient, (gap, forces, jacobian)))
        forces = jnp.where(has_converged, forces + factor.solve(gap), jnp.nan)  # the last step carries all derivatives
        return cls(response, factor), with_friction(forces, free, response), forces

    def solved(self, free: Float[Numbers, "row batch"], lower: NormalForces) -> tuple[Any, NormalForces]:
        """Return the coefficients of multipliers and normal forces of an order.

        Parameters
        ----------
        free : array of shape (rows, batch)
            Coefficients of the multipliers without the normal forces of this order.
        lower : array of shape (joints, batch)
            Coefficients of the normal forces for these multipliers.
        """
        forces = self.factor.solve(lower)
        return free - jnp.sum(self.response * forces[:, None], axis=0), forces


def _is_regular_from_none(matrix: Float[Numbers, "joint joint batch"]) -> Any:
    """Return whether the determinant of the matrix of normal forces stays positive as friction grows, (batch,)."""
    size, _, lanes = matrix.shape
    unit = jnp.eye(size)[..., None]
    matrices = jnp.concatenate([unit + fraction * (matrix - unit) for fraction in SHARES], axis=-1)
    return (DenseFactor.of(matrices).sign().reshape(len(SHARES), lanes) > 0).all(axis=0)
