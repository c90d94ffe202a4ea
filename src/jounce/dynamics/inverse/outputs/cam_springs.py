"""Springs that keep a follower on its cam: the preload required at the speed of a motion."""

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

SHARE = 0.1  # relative change of the spring for its slope
EXACT = 1e-7  # fraction of the largest contact force: tolerance of the least one
PEAKS, POINTS, ROUNDS = 3, 15, 5  # maxima that are refined, instants on both sides of each, and rounds of refinement


@dataclasses.dataclass(frozen=True)
class ContactSpring:
    """The spring for which the least contact force of a cam is zero.

    Attributes
    ----------
    free : float
        Free `length`, m, or `angle`, rad; with more compression the follower stays on its cam.
    instant : float
        Instant at which the contact force with this spring is zero, s.
    margin : float
        Least contact force with the given spring, N or N m; negative if the follower lifts off.
    """

    free: float
    instant: float
    margin: float


def contact_spring(mechanism: Mechanism, cam: str, spring: str, time: TimeLike | None = None) -> ContactSpring:
    """Return the spring with the least preload that keeps a follower on its cam in a driven motion.

    The contact force is linear in the free length or angle of the spring, so two motions determine it. Its pressing
    sense is that of the mean contact force with the given spring. The instants are those of the grid, those just before
    and after the knots of laws, and refined ones around the highest maxima of the preload.

    Parameters
    ----------
    mechanism : Mechanism
        Driven mechanism with masses.
    cam : str
        Name of a joint that is a cam.
    spring : str
        Name of a force with a stiffness and a `length` or an `angle`.
    time : array_like or TimeGrid, optional
        Instants, s; by default those of the mechanism.

    Raises
    ------
    MechanismError
        If the joint is no cam, the force is no such spring, or the spring has no effect on the contact.

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

    def contact(value: float) -> np.ndarray:
        changed: Any = {**mechanism.forces, spring: dataclasses.replace(force, **{field: value})}
        return solve(_with(mechanism, changed, output), instants, order=0).outputs["contact"][:, 0]

    given_value = float(resolve(getattr(force, field), mechanism.parameter_values))
    contact_forces = contact(given_value)
    step = SHARE * max(abs(given_value), float(np.ptp(contact_forces)) / _stiffness(mechanism, force), 1e-6)
    sense = 1.0 if np.mean(contact_forces) >= 0 else -1.0

    def required(contact_forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the required free length or angle at each instant, and the preload up to a constant."""
        slope = (contact(given_value + step) - contact_forces) / step
        if (sense * slope).max() * (sense * slope).min() <= 0:
            message = "does nothing to the contact force, or presses at some instants and pulls at others"
            raise MechanismError(message, name="spring", value=spring)
        required_values = given_value - contact_forces / slope
        return required_values, -required_values if sense * slope[0] < 0 else required_values

    required_values, preload = required(contact_forces)
    for _ in range(ROUNDS if len(instants) > 1 else 0):
        instants = _refined_at_maxima(instants, preload)
        contact_forces = contact(given_value)
        required_values, preload = required(contact_forces)
    peak = int(np.argmax(preload))
    result = contact(float(required_values[peak]))
    if abs((sense * result).min()) > EXACT * np.abs(result).max():
        raise MechanismError(
            "does not change the contact force in proportion to its free length or angle", name="spring", value=spring
        )
    return ContactSpring(float(required_values[peak]), float(instants[peak]), float((sense * contact_forces).min()))


def _refined_at_maxima(instants: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the instants, with more on both sides of the highest local maxima of values."""
    edge = [-np.inf]
    before, after = np.concatenate([edge, values[:-1]]), np.concatenate([values[1:], edge])
    maxima = np.flatnonzero((values > before) & (values >= after))
    last_index = len(instants) - 1
    refined = [
        np.linspace(instants[max(k - 1, 0)], instants[min(k + 1, last_index)], 2 * POINTS + 1)
        for k in maxima[np.argsort(-values[maxima])][:PEAKS]
    ]
    return np.unique(np.concatenate([instants, *refined]))


def _with(mechanism: Mechanism, forces: Any, output: Any) -> Mechanism:
    return dataclasses.replace(mechanism, forces=forces, outputs={"contact": output}, units={})


def _stiffness(mechanism: Mechanism, force: Any) -> float:
    return abs(float(resolve(force.stiffness, mechanism.parameter_values))) or 1.0
