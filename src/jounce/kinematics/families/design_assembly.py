"""Designs assembled side by side by damped Gauss-Newton, each with steps of its own."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jounce.base.modules import with_fields
from jounce.base.shapes import Numbers
from jounce.execution.mapped import mapped
from jounce.jet import Jet
from jounce.kinematics.assembly.gauss_newton import LONGEST_STEP, MAX_STEPS
from jounce.kinematics.continuation.instant_program import of_design
from jounce.kinematics.continuation.jacobian_factors import factored
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

HALVINGS = 12
CLEARLY_REGULAR = 1e-6  # ratio of smallest to largest pivot above which a Jacobian needs no closer check

Coordinates = dict[str, Float[Numbers, "_ ... _"]]


class AssemblyAttempts(NamedTuple):
    """Assembly attempts of many designs, each from its own starting guess.

    Attributes
    ----------
    coordinates : dict of str to array
        Coordinates of all bodies, (..., bodies, designs).
    plain : array of bool, shape (designs,)
        Whether Gauss-Newton is sufficient: all gaps are closed, no body turned by more than half a turn, and the
        Jacobian is far from singular. Other designs are assembled individually.
    """

    coordinates: Coordinates
    plain: Bool[Numbers, " design"]


def _assembled(
    system: System,
    guess: Coordinates,
    instant: Float[Numbers, " design"],
    tolerance: Float[Numbers, ""],
    driven: Bool[Numbers, "row 1"],
    pose_type: type[Pose],
) -> AssemblyAttempts:
    """Assemble designs side by side, a lane for each; see `assemble_from_guess`."""
    time = Jet([instant[None]])
    unscaled = with_fields(system, row_scale=np.ones(system.row_scale.shape))

    def gaps(pose: Any, scale: Any) -> Any:
        return jnp.sqrt(jnp.sum((scale * unscaled.residual(pose, time).coefficients[0]) ** 2, axis=0))

    def going(state: Any) -> Any:
        return jnp.any(state[1]) & (state[2] < MAX_STEPS)

    def correct(state: Any) -> Any:
        coordinates, active, count = state
        pose = pose_at(coordinates, pose_type)
        scale = system.pattern.row_scale(unscaled.entries(pose, time))
        step = factored(system, pose, time).solve(-system.residual(pose, time).coefficients[0])
        size = jnp.max(jnp.abs(step), axis=0)
        step, gap = step * jnp.minimum(1.0, LONGEST_STEP / jnp.maximum(size, 1e-300))[None], gaps(pose, scale)

        def displaced(fraction: Any) -> Any:
            return pose.displaced(*system.coordinates(step * fraction[None], pose.shifts))

        def better(fraction: Any) -> Any:
            return (gaps(displaced(fraction), scale) < gap) | (size <= tolerance)

        def halve(state: Any) -> Any:
            fraction, accepted, tried = state
            fraction = jnp.where(accepted, fraction, 0.5 * fraction)
            return fraction, accepted | better(fraction), tried + 1

        ones = jnp.ones_like(size)
        fraction, accepted, _ = jax.lax.while_loop(
            lambda s: jnp.any(active & ~s[1]) & (s[2] < HALVINGS), halve, (ones, better(ones), jnp.zeros((), int))
        )
        trial = {name: jet.coefficients[0] for name, jet in displaced(fraction).coordinates().items()}
        take = active & accepted
        coordinates = {name: jnp.where(_per_lane(take, x), trial[name], x) for name, x in coordinates.items()}
        return coordinates, take & (size > tolerance), count + 1

    lag = jnp.where(driven, jnp.abs(unscaled.residual(pose_at(guess, pose_type), time).coefficients[0]), 0.0)
    start = (guess, jnp.isfinite(instant), jnp.zeros((), int))
    coordinates, active, _ = jax.lax.while_loop(going, correct, start)
    pose = pose_at(coordinates, pose_type)
    scale = system.pattern.row_scale(unscaled.entries(pose, time))
    open_by = jnp.max(jnp.abs(scale * unscaled.residual(pose, time).coefficients[0]), axis=0)
    plain = ~active & (open_by <= jnp.maximum(1e3 * tolerance, 1e-9)) & (jnp.max(lag, axis=0) < np.pi)
    plain &= factored(system, pose, time).pivot_ratio() > CLEARLY_REGULAR
    if "angle" in coordinates:
        plain &= jnp.max(jnp.abs(coordinates["angle"] - guess["angle"]), axis=0) < np.pi
    return AssemblyAttempts(coordinates, plain)


def _of_many(shared: Any, designs: Any, *, pose_type: type[Pose]) -> AssemblyAttempts:
    (system, tolerance, driven), (guess, instant, design) = shared, designs
    return _assembled(of_design(system, design), guess, instant, tolerance, driven, pose_type)


@mapped(by_xla=_of_many, made_of=(_assembled,))
def assemble_from_guess(shared: Any, designs: Any, *, pose_type: type[Pose]) -> AssemblyAttempts:
    """Assemble a design by damped Gauss-Newton; see `assembly.gauss_newton.assemble_from_guess`.

    Parameters
    ----------
    shared : tuple
        System; largest last correction, rad or sizes of the mechanism; and whether each row is that of a driver, shape
        (rows, 1).
    designs : tuple
        Start coordinates of all bodies, the instant, s, and the values of the design, see `of_design`.
    pose_type : type
        PlanarPose or SpatialPose.
    """
    (system, tolerance, driven), (guess, instant, design) = shared, designs
    system = with_fields(of_design(system, design), reflected=True)
    return _assembled(system, guess, instant, tolerance, driven, pose_type)


def _per_lane(lanes: Any, values: Any) -> Any:
    return lanes.reshape(*[1] * (values.ndim - 1), -1)
