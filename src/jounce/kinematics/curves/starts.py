"""One compiled function: assembly from many starts side by side, at one instant."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.execution.compilation import compiled
from jounce.jet import Jet
from jounce.linear_algebra.linear import DenseFactor
from jounce.mechanism.building.starting_guess import pose_at
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

STEPS = 80
LONGEST_STEP = 1.0  # rad or sizes of the mechanism
FIRST_DAMPING, SMALLEST_DAMPING, LARGEST_DAMPING = 1e-1, 1e-13, 1e6
EASED, STIFFENED = 0.2, 4.0
CLOSED = 1e-12  # residual at which the iteration stops


@compiled("pose_type")
def assemble_side_by_side(
    system: System, coordinates: dict[str, Numbers], instant: Float[Numbers, ""], *, pose_type: type[Pose]
) -> tuple[dict[str, Numbers], Float[Numbers, " start"]]:
    """Return the coordinates that starts converge to, and their largest residuals, by the Levenberg-Marquardt method.

    Parameters
    ----------
    system : System
        The mechanism, with rows of one size.
    coordinates : dict of str to array
        Coordinates of all bodies, the ground first, starts last.
    instant : float
        Time, s.
    pose_type
        PlanarPose or SpatialPose.
    """
    lanes = coordinates["position"].shape[-1]
    time = Jet([jnp.full((1, lanes), instant)])
    columns = system.shape[1]

    def residual(pose: Any) -> Any:
        return system.residual(pose, time).coefficients[0]

    def unfinished(state: Any) -> Any:
        _, gaps, _, count = state
        return jnp.any(jnp.max(jnp.abs(gaps), axis=0) > CLOSED) & (count < STEPS)

    def iterate(state: Any) -> Any:
        current, gaps, damping, count = state
        pose = pose_at(current, pose_type)
        jacobian = system.jacobian(pose, time)
        normal = jnp.sum(jacobian[:, :, None] * jacobian[:, None], axis=0)
        normal = normal + jnp.eye(columns)[..., None] * damping[None, None]
        gradient = jnp.sum(jacobian * gaps[:, None], axis=0)
        step = -DenseFactor.of(normal).solve(gradient, refined=False)
        size = jnp.max(jnp.abs(step), axis=0, keepdims=True)
        step = step * jnp.minimum(1.0, LONGEST_STEP / jnp.maximum(size, 1e-300))
        displaced = pose.displaced(*system.coordinates(step, pose.shifts))
        trial_coordinates = {name: jet.coefficients[0] for name, jet in displaced.coordinates().items()}
        trial = residual(displaced)
        better = jnp.sum(trial**2, axis=0) < jnp.sum(gaps**2, axis=0)
        current = {name: jnp.where(better, trial_coordinates[name], x) for name, x in current.items()}
        eased = jnp.maximum(damping * EASED, SMALLEST_DAMPING)
        damping = jnp.where(better, eased, jnp.minimum(damping * STIFFENED, LARGEST_DAMPING))
        return current, jnp.where(better[None], trial, gaps), damping, count + 1

    gaps = residual(pose_at(coordinates, pose_type))
    start = (coordinates, gaps, np.full(lanes, FIRST_DAMPING), 0)
    assembled, gaps, _, _ = jax.lax.while_loop(unfinished, iterate, start)
    return assembled, jnp.max(jnp.abs(gaps), axis=0, initial=0.0)
