"""Bodies put together at one instant, from a starting guess, by damped Gauss-Newton on the host."""

from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from jounce.jet import Jet
from jounce.kinematics.compilation import compiled
from jounce.kinematics.host_jacobian import HostJacobian
from jounce.kinematics.initial_turns import Coordinates, DriverLag, Mover, Place
from jounce.mechanism import Model
from jounce.mechanism.builder import pose_at
from jounce.mechanism.modules import with_fields
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose
from jounce.shapes import Numbers

MAX_STEPS = 100
NEXT_STEP = 1e-3  # of the tolerance: a step that would be this short, as residuals fall, is left out


@compiled("pose_type", narrow=True)
def _moved(
    system: System,
    coordinates: dict[str, Numbers],
    increment: Float[Numbers, " column"],
    instant: Float[Numbers, ""],
    pose_type: type[Pose],
) -> Any:
    """Return the coordinates after an increment, with residual and entries of the Jacobian, for one instant."""
    pose = pose_at(coordinates, pose_type)
    pose = pose.displaced(*system.coordinates(increment[:, None], pose.shifts))
    time = Jet([instant[None, None]])
    moved = {name: jet.coefficients[0] for name, jet in pose.coordinates().items()}
    return moved, system.residual(pose, time).coefficients[0][:, 0], system.entries(pose, time)[:, 0]


class Trial(NamedTuple):
    """How far bodies could be put together.

    Attributes
    ----------
    coordinates : dict of str to array
        Of all bodies, the ground first: assembled, or as near to it as they came.
    scale : array of shape (rows,)
        By which the rows are multiplied.
    gaps : array of shape (rows,)
        By how much each row is open, rad or sizes of the mechanism.
    jacobian : HostJacobian
        Scaled, there.
    closed : bool
        Whether all gaps are closed, to the tolerance of the last correction.
    """

    coordinates: Coordinates
    scale: Float[np.ndarray, " row"]
    gaps: Float[np.ndarray, " row"]
    jacobian: HostJacobian
    closed: bool


def mover(model: Model, instant: float) -> Mover:
    """Return what takes coordinates and an increment to coordinates, residual and Jacobian, all on the host."""
    system = with_fields(model.system, outputs=(), forces=(), fronts=None, pattern=None)  # all that the program needs
    pattern, scale = model.system.pattern, np.asarray(model.system.row_scale)[:, 0]

    def moved(coordinates: dict[str, Any], increment: np.ndarray) -> Any:
        result = _moved(system, coordinates, increment, np.float64(instant), model.pose_type)
        to, residual, entries = jax.tree.map(np.asarray, result)
        return to, residual, HostJacobian.of(pattern, entries).scaled(scale)

    return moved


def put_together(
    model: Model,
    instant: float,
    tolerance: float,
    start: Coordinates | None = None,
    *,
    lag: DriverLag | None = None,
    known: Place | None = None,
) -> Trial:
    """Return how far the bodies can be put together at one instant; nothing is refused.

    Parameters
    ----------
    model : Model
        The mechanism, with at least one row.
    instant : float
        s.
    tolerance : float
        Of the last correction, rad or sizes of the mechanism.
    start : dict of str to array, optional
        Coordinates to start from instead of the guess.
    lag : DriverLag, optional
        What drivers may still lack.
    known : Place, optional
        Where to start from, in the place of coordinates, if it is known whole.
    """
    still, free = np.zeros(model.system.shape[1]), mover(model, instant)

    def opened(place: Place) -> Place:
        return place if lag is None else (place[0], lag.open(place[1], 1.0), place[2])

    known = free(model.guess if start is None else start, still) if known is None else known
    coordinates, residual, jacobian = opened(known)
    scale = jacobian.row_scale
    for _ in range(MAX_STEPS):
        step = jacobian.step(residual)
        if step is None:
            break  # told by name
        size = np.max(np.abs(step), initial=0.0)
        step *= min(1.0, 0.5 / max(size, 1e-300))  # at most half a radian, or half the mechanism, at a time
        now = np.linalg.norm(scale * residual)
        for _halving in range(12):
            trial = opened(free(coordinates, step))
            left = np.linalg.norm(scale * trial[1])
            if left < now or size <= tolerance:
                break
            step *= 0.5
        else:
            break
        coordinates, residual, jacobian = trial
        scale = jacobian.row_scale
        if size <= tolerance or size * left <= NEXT_STEP * tolerance * now:
            break
    gaps = np.where(jacobian.finite(), scale * residual, np.nan)
    closed = bool(np.all(np.abs(gaps) <= max(1e3 * tolerance, 1e-9)))
    return Trial(coordinates, scale, gaps, jacobian.scaled(scale), closed)
