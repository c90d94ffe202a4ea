"""Projection onto the constraints: mass-weighted least corrections of positions and velocities."""

from typing import Any

import jax
import jax.numpy as jnp

from jounce.dynamics.forward.accelerations import Attitudes, Equations, Instants, Inverse, Lanes, State, inverted
from jounce.jet import Jet

MOST_ITERATIONS = 10
LARGEST_GAP = 1e-9  # of redundant constraints, rad or sizes of the mechanism; beyond it they contradict each other
CLOSE = 4e-15  # distance, in the same unit, over which the inverse of the matrix changes by rounding only
ROUNDING = 1e-15  # correction, in the same unit, that is rounding


@jax.jit  # traced once for the steps of a run and for the motion within them
def projected(equations: Equations, state: State, time: Instants) -> tuple[State, Lanes, Inverse]:
    """Return the nearest state that satisfies the constraints and their rates, and the correction of positions.

    The corrections of positions and of velocities are least in the norm of the mass matrix.

    Parameters
    ----------
    equations : Equations
        Equations of motion of the mechanism.
    state : State
        State near the constraints.
    time : array of shape (1, batch)
        The instant, s.

    Returns
    -------
    State
        The projected state, with normalized Euler parameters.
    distance : array of shape (batch,)
        Size of the first correction of positions, rad or sizes of the mechanism; not finite if the projection failed or
        redundant constraints contradict each other.
    inverse : DenseInverse or SaddleInverse
        Inverse of the matrix of the equations at this state, for `expand`.
    """
    clock, lanes = Jet([time]), time.shape[-1]
    position, attitude = state.position, normalized(state.attitude)

    def correction(position: Any, attitude: Any) -> tuple[Any, Any]:
        factor = equations.factored(state._replace(position=position, attitude=attitude), time)
        gap = equations.system.residual(equations.pose_at_rest(position, attitude), clock).coefficients[0]
        return factor, gap

    def moved(position: Any, attitude: Any, column: Any) -> tuple[Any, Any]:
        change = equations.system.coordinates(column, equations.pose_type.shifts)
        pose = equations.pose_at_rest(position, attitude).displaced(*change)
        return pose.position.coefficients[0][:, 1:], equations.attitude_of(pose)

    def iterate(carry: Any) -> Any:
        position, attitude, _, last, first, count, _ = carry
        is_near = ~jnp.any((last > 1e-9) & jnp.isfinite(last)) | (count >= MOST_ITERATIONS)
        inverting = is_near & (count > 0)  # one more factorization; a branch for it would be compiled twice
        factor, gap = correction(position, attitude)
        column = equations.least_change(factor, gap)
        size = jnp.where(inverting, last, jnp.max(jnp.abs(column), axis=0))
        moved_pose = [
            jnp.where(inverting, x, y) for x, y in zip(carry[:2], moved(position, attitude, column), strict=True)
        ]
        is_done = inverting | jnp.all(size <= CLOSE)
        return *moved_pose, factor, size, jnp.where(count == 0, size, first), count + 1, is_done

    start = (position, attitude, equations.blank_factor(lanes), jnp.full(lanes, jnp.inf), jnp.zeros(lanes), 0, False)
    position, attitude, factor, last, first, *_ = jax.lax.while_loop(lambda carry: ~carry[-1], iterate, start)
    result = equations.with_rates(factor, state._replace(position=position, attitude=attitude), time)
    fulfilled = last <= 1e-9
    if equations.system.rank is not None:
        gap = equations.system.residual(equations.pose_at_rest(position, attitude), clock).coefficients[0]
        fulfilled &= jnp.max(jnp.abs(gap), axis=0) <= LARGEST_GAP
    return result, jnp.where(fulfilled, first, jnp.inf), inverted(factor)


def normalized(attitude: Attitudes) -> Attitudes:
    """Return Euler parameters of unit length; angles unchanged."""
    if attitude.shape[0] == 1:
        return attitude
    return attitude / jnp.sqrt(jnp.sum(attitude * attitude, axis=0))[None]
