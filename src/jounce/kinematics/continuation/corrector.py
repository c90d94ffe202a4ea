"""Newton-Raphson corrections of predicted poses, a batch side by side.

Corrections reuse the first Jacobian as long as they shrink fast (simplified Newton iteration): a factorization costs
several times as much as a residual and a solve. The first two corrections with one Jacobian show whether the solution
nearby is unique (Deuflhard 2011, Newton Methods for Nonlinear Problems, chapter 5).
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers
from jounce.jet import Jet
from jounce.kinematics.continuation.jacobian_factors import Factor, blank_factor, refactored
from jounce.kinematics.continuation.predictor import SMALLEST_DEPARTURE
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

MAX_ITERATIONS = 30
LARGEST_CONTRACTION = 0.25  # of the first simplified Newton corrections: Deuflhard 2011, section 5.1
ROUNDING = 4e-15  # rad, or sizes of the mechanism
NEARLY_ROUNDING = 6e-8  # first correction, after which the next one is rounding
NEGLIGIBLE = 1e-16  # predicted size of the next correction
SLOWEST = 0.03  # ratio of successive corrections: three more cost as much as a new factorization

Lanes = Float[Numbers, " batch"]


class Correction(NamedTuple):
    """Outcome of a Newton-Raphson iteration."""

    last: Lanes  # size of the last correction, rad or sizes of the mechanism
    first: Lanes
    simplified: Lanes  # size of the second correction with the Jacobian of the first

    def contracts(self) -> Bool[Numbers, " batch"]:
        """Return whether the simplified Newton iteration contracts, as it must near a unique solution."""
        return (self.simplified <= LARGEST_CONTRACTION * self.first) | (self.first <= SMALLEST_DEPARTURE)


class _Iteration(NamedTuple):
    """State of a Newton-Raphson iteration after a correction."""

    pose: Any
    factor: Factor
    correction: Correction
    rate: Lanes  # expected ratio of the next correction to the last one
    distance: Lanes  # distance of the pose from that of the factored Jacobian, rad or sizes of the mechanism
    count: Int[Numbers, ""]


def newton_raphson(
    system: System, pose: Pose, time: Float[Jet, "1 batch"], tolerance: Float[Numbers, ""], refine: Bool[Numbers, ""]
) -> tuple[Pose, Factor, Correction]:
    """Return the assembled pose, its factored Jacobian, and the sizes of the corrections.

    A Jacobian serves several corrections (simplified Newton iteration). It is factored again only if they shrink
    slowly, and for the final pose, unless the old factors still solve the equations there (`refactored`). Fronts,
    however, are factored at each correction.

    An instant is accepted when its correction is at most the tolerance. With `refine`, that correction is still made,
    and others follow until the next one would be rounding.
    """

    def sized(pose: Any, step: Any) -> Any:
        shift, turn = system.coordinates(step, pose.shifts)
        distance = jnp.max(jnp.abs(pose.position.coefficients[0]), axis=(0, 1), keepdims=True)
        shift = shift / jnp.maximum(system.column_scale[0], distance)  # rounding of a position grows with its distance
        return jnp.maximum(jnp.max(jnp.abs(shift), axis=(0, 1)), jnp.max(jnp.abs(turn), axis=(0, 1)))

    def going(state: _Iteration) -> Any:
        size = state.correction.last
        accepted = size <= tolerance
        rounded = (size <= ROUNDING) | (accepted & (size * state.rate <= NEGLIGIBLE))
        hopeful = jnp.isfinite(size) | (state.count == 0)  # iterations do not recover from non-finite values
        return ~jnp.where(refine, rounded, accepted) & hopeful

    def unfinished(state: _Iteration) -> Any:
        return jnp.any(going(state) | (state.distance > ROUNDING)) & (state.count < MAX_ITERATIONS)

    def iterate(state: _Iteration) -> _Iteration:
        pose, before, correction, rate, distance, count = state
        residual = system.residual(pose, time).coefficients[0]
        active, slow = going(state), ~(rate <= SLOWEST)
        refactor = (count == 0) | (count > 1) & jnp.any(active & slow)  # the second correction measures the contraction
        small = (count == 1) & jnp.all(correction.last <= NEARLY_ROUNDING)  # the Jacobian here serves as the final one
        renewed = refactor | small | ~jnp.any(active)
        if system.fronts is None:
            factor = jax.lax.cond(renewed, lambda: refactored(system, pose, time, before, refactor), lambda: before)
        else:  # results of a branch are copied, and copying so many fronts takes longer than factoring them
            renewed = refactor = np.ones((), bool)
            factor = refactored(system, pose, time, before, refactor)
        step = factor.solve(-residual, refined=False)
        size = second_size = sized(pose, step)
        if system.fronts is not None:  # the second correction with the first Jacobian, for `contracts`
            second = partial(sized, pose)
            second_size = jax.lax.cond(count == 1, lambda: second(before.solve(-residual, refined=False)), lambda: size)
        applied = refine | ~(size <= tolerance)
        pose = pose.displaced(*system.coordinates(jnp.where(applied, step, 0.0), pose.shifts))
        compared = (count == 1) & (refine | ~(correction.last <= tolerance))  # otherwise the pose has not changed
        first = jnp.where(count == 0, size, correction.first)
        simplified = jnp.where(compared, second_size, correction.simplified)
        rate = jnp.where(refactor, size, size / jnp.maximum(correction.last, 1e-300))
        counts = applied & (active | ~renewed)  # those of converged lanes are rounding, which may exceed `ROUNDING`
        distance = jnp.where(renewed, 0.0, distance) + jnp.where(counts, size, 0.0)
        return _Iteration(pose, factor, Correction(size, first, simplified), rate, distance, count + 1)

    lanes = time.coefficients[0].shape[-1]
    unknown, zeros = np.full(lanes, np.inf), np.zeros(lanes)
    correction = Correction(unknown, unknown, zeros)
    start = _Iteration(pose, blank_factor(system, lanes), correction, zeros, zeros, np.zeros((), int))
    end = jax.lax.while_loop(unfinished, iterate, start)
    return end.pose, end.factor, end.correction
