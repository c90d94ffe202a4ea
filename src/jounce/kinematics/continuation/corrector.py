"""Newton-Raphson corrections of predicted poses, a batch side by side.

Corrections go on with the Jacobian of the first as long as they shrink fast (simplified Newton iteration): to factor a
Jacobian costs several times what evaluating the residual and solving for a correction does. The first two corrections,
with one Jacobian, tell whether one solution only is near (Deuflhard 2011, Newton Methods for Nonlinear Problems,
chapter 5).
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
NEGLIGIBLE = 1e-16  # next correction, as the last ones foretell it
SLOWEST = 0.03  # of a correction over the one before: three more cost as much as to factor the Jacobian again

Lanes = Float[Numbers, " batch"]


class Correction(NamedTuple):
    """Outcome of a Newton-Raphson iteration."""

    last: Lanes  # size of the last correction, rad or sizes of the mechanism
    first: Lanes
    simplified: Lanes  # size of the second, with the Jacobian of the first

    def contracts(self) -> Bool[Numbers, " batch"]:
        """Tell whether the simplified Newton iteration contracts, as it must where one solution only is near."""
        return (self.simplified <= LARGEST_CONTRACTION * self.first) | (self.first <= SMALLEST_DEPARTURE)


class _Iteration(NamedTuple):
    """State of a Newton-Raphson iteration after a correction."""

    pose: Any
    factor: Factor
    correction: Correction
    rate: Lanes  # by which the next correction will be smaller than the last one
    away: Lanes  # how far the pose is from that of the factored Jacobian, rad or sizes of the mechanism
    count: Int[Numbers, ""]


def newton_raphson(
    system: System, pose: Pose, time: Float[Jet, "1 batch"], tolerance: Float[Numbers, ""], refine: Bool[Numbers, ""]
) -> tuple[Pose, Factor, Correction]:
    """Return the assembled pose, the factored Jacobian there, and how large the corrections were.

    A Jacobian serves several corrections (simplified Newton iteration): it is factored again only where they shrink
    slowly, and for the last one, unless what was factored still solves the equations there (`refactored`). Only fronts
    are factored at each correction.

    An instant is accepted when its correction is at most the tolerance. With `refine` that correction is still made,
    and others until the next one would be rounding.
    """

    def sized(pose: Any, step: Any) -> Any:
        shift, turn = system.coordinates(step, pose.shifts)
        away = jnp.max(jnp.abs(pose.position.coefficients[0]), axis=(0, 1), keepdims=True)
        shift = shift / jnp.maximum(system.column_scale[0], away)  # what is far away is known no better
        return jnp.maximum(jnp.max(jnp.abs(shift), axis=(0, 1)), jnp.max(jnp.abs(turn), axis=(0, 1)))

    def going(state: _Iteration) -> Any:
        size = state.correction.last
        accepted = size <= tolerance
        rounded = (size <= ROUNDING) | (accepted & (size * state.rate <= NEGLIGIBLE))
        hopeful = jnp.isfinite(size) | (state.count == 0)  # what is not finite never will be
        return ~jnp.where(refine, rounded, accepted) & hopeful

    def unfinished(state: _Iteration) -> Any:
        return jnp.any(going(state) | (state.away > ROUNDING)) & (state.count < MAX_ITERATIONS)

    def iterate(state: _Iteration) -> _Iteration:
        pose, before, correction, rate, away, count = state
        residual = system.residual(pose, time).coefficients[0]
        on, slow = going(state), ~(rate <= SLOWEST)
        anew = (count == 0) | (count > 1) & jnp.any(on & slow)  # the second correction tells whether they contract
        small = (count == 1) & jnp.all(correction.last <= NEARLY_ROUNDING)  # the Jacobian of here serves at the end
        moved = anew | small | ~jnp.any(on)
        if system.fronts is None:
            factor = jax.lax.cond(moved, lambda: refactored(system, pose, time, before, anew), lambda: before)
        else:  # what goes through a branch is copied, and so many fronts take longer to copy than to factor again
            moved = anew = np.ones((), bool)
            factor = refactored(system, pose, time, before, anew)
        step = factor.solve(-residual, refined=False)
        size = again = sized(pose, step)
        if system.fronts is not None:  # what the Jacobian of before says of the second correction, for `contracts`
            second = partial(sized, pose)
            again = jax.lax.cond(count == 1, lambda: second(before.solve(-residual, refined=False)), lambda: size)
        made = refine | ~(size <= tolerance)
        pose = pose.displaced(*system.coordinates(jnp.where(made, step, 0.0), pose.shifts))
        compared = (count == 1) & (refine | ~(correction.last <= tolerance))  # else the pose was left as it was
        first = jnp.where(count == 0, size, correction.first)
        simplified = jnp.where(compared, again, correction.simplified)
        rate = jnp.where(anew, size, size / jnp.maximum(correction.last, 1e-300))
        counts = made & (on | ~moved)  # what is at rest already is corrected by rounding, which may exceed `ROUNDING`
        away = jnp.where(moved, 0.0, away) + jnp.where(counts, size, 0.0)
        return _Iteration(pose, factor, Correction(size, first, simplified), rate, away, count + 1)

    lanes = time.coefficients[0].shape[-1]
    unknown, nothing = np.full(lanes, np.inf), np.zeros(lanes)
    correction = Correction(unknown, unknown, nothing)
    start = _Iteration(pose, blank_factor(system, lanes), correction, nothing, nothing, np.zeros((), int))
    end = jax.lax.while_loop(unfinished, iterate, start)
    return end.pose, end.factor, end.correction
