"""Springs that keep a follower on its cam: how far they must be compressed at the speed of a motion."""

import dataclasses
from typing import Any

import numpy as np

from jounce.constraints import Cam
from jounce.dynamics.inverse.outputs.cam_outputs import CamForceOutput, CamTorqueOutput
from jounce.errors import MechanismError, check_name
from jounce.kinematics import solve
from jounce.mechanism import Mechanism, time_grid
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.laws.law_breaks import breaks_of_laws
from jounce.mechanism.resolve import resolve
from jounce.mechanism.time import TimeLike
from jounce.trajectory.law_checks.breaks import with_sides

SHARE = 0.1  # of a size, by which the spring is changed to see what it does
EXACT = 1e-7  # of the largest contact: what may be left of it at its least
PEAKS, POINTS, ROUNDS = 3, 15, 5  # highest maxima, instants on both sides of each, and how often these close in


@dataclasses.dataclass(frozen=True)
class ContactSpring:
    """The spring with which the least contact force of a cam is zero.

    Attributes
    ----------
    free : float
        Its `length`, m, or `angle`, rad, where it is at rest: with more compression the follower stays on its cam.
    instant : float
        When the contact force is zero then, s.
    margin : float
        The least contact force with the spring as it is, N or N m; negative where the follower lifts off.
    """

    free: float
    instant: float
    margin: float


def contact_spring(mechanism: Mechanism, cam: str, spring: str, time: TimeLike | None = None) -> ContactSpring:
    """Return the spring with the least preload that keeps a follower on its cam in a driven motion.

    The contact force is linear in where the spring is free, so two motions determine it. It presses in the sense that
    it has in the mean with the spring as it is. Besides the instants of the grid, those just before and after the knots
    of laws count, and around the highest maxima of the preload further instants, which close in on them.

    Parameters
    ----------
    mechanism : Mechanism
        Driven, with masses.
    cam : str
        Name of a joint that is a cam.
    spring : str
        Name of a force with a stiffness and a `length` or an `angle`.
    time : array_like or TimeGrid, optional
        Instants, s; those of the mechanism unless given.

    Raises
    ------
    MechanismError
        If they are no cam and no such spring, or the spring does nothing to the contact.

    Examples
    --------
    >>> import jounce as jn
    >>> found = jn.dynamics.contact_spring(jn.load("examples/camshaft.yaml"), "cam", "spring")
    >>> round(found.free, 6), round(found.margin, 2)  # 48 mm would do; with 30 mm 89.81 N are left
    (0.047962, 89.81)
    """
    check_name("joint", cam, mechanism.joints, MechanismError, name="cam")
    check_name("force", spring, mechanism.forces, MechanismError, name="spring")
    joint, force = mechanism.joints[cam], mechanism.forces[spring]
    if not isinstance(joint, Cam):
        raise MechanismError("is no cam", name="cam", value=cam)
    field = next((name for name in ("length", "angle") if hasattr(force, name) and hasattr(force, "stiffness")), None)
    if field is None:
        raise MechanismError("must be a spring, with a stiffness and a length or an angle", name="spring", value=spring)
    instants = time_grid(mechanism.time if time is None else time, mechanism.parameter_values)
    breaks = breaks_of_laws(mechanism, float(instants[0]), float(instants[-1]), 2, forces=True)
    instants = with_sides(instants, breaks) if len(instants) > 1 else instants
    output = (CamTorqueOutput if is_turning(joint.follower) else CamForceOutput)(cam)

    def contact(free: float) -> np.ndarray:
        changed: Any = {**mechanism.forces, spring: dataclasses.replace(force, **{field: free})}
        return solve(_with(mechanism, changed, output), instants, order=0).outputs["contact"][:, 0]

    given = float(resolve(getattr(force, field), mechanism.parameter_values))
    now = contact(given)
    step = SHARE * max(abs(given), float(np.ptp(now)) / _stiffness(mechanism, force), 1e-6)
    sense = 1.0 if np.mean(now) >= 0 else -1.0

    def required(now: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where the spring must be free at each instant, and its preload, up to a constant."""
        slope = (contact(given + step) - now) / step
        if (sense * slope).max() * (sense * slope).min() <= 0:
            message = "does nothing to the contact force, or presses at some instants and pulls at others"
            raise MechanismError(message, name="spring", value=spring)
        needed = given - now / slope
        return needed, -needed if sense * slope[0] < 0 else needed

    needed, preload = required(now)
    for _ in range(ROUNDS if len(instants) > 1 else 0):
        instants = _refined_at_maxima(instants, preload)
        now = contact(given)
        needed, preload = required(now)
    where = int(np.argmax(preload))
    left = contact(float(needed[where]))
    if abs((sense * left).min()) > EXACT * np.abs(left).max():
        raise MechanismError(
            "does not change the contact force in proportion to its free length or angle", name="spring", value=spring
        )
    return ContactSpring(float(needed[where]), float(instants[where]), float((sense * now).min()))


def _refined_at_maxima(instants: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return instants with further ones on both sides of the highest local maxima of values."""
    edge = [-np.inf]
    before, after = np.concatenate([edge, values[:-1]]), np.concatenate([values[1:], edge])
    maxima = np.flatnonzero((values > before) & (values >= after))
    last = len(instants) - 1
    further = [
        np.linspace(instants[max(k - 1, 0)], instants[min(k + 1, last)], 2 * POINTS + 1)
        for k in maxima[np.argsort(-values[maxima])][:PEAKS]
    ]
    return np.unique(np.concatenate([instants, *further]))


def _with(mechanism: Mechanism, forces: Any, output: Any) -> Mechanism:
    return dataclasses.replace(mechanism, forces=forces, outputs={"contact": output}, units={})


def _stiffness(mechanism: Mechanism, force: Any) -> float:
    return abs(float(resolve(force.stiffness, mechanism.parameter_values))) or 1.0
