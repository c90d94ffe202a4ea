"""What friction in a motion needs, and where it locks: told by the names of its joints."""

from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.dynamics.friction.coupling import joints_with_friction, rubs
from jounce.dynamics.inverse.tooth_flanks import listed
from jounce.errors import MechanismError
from jounce.kinematics import Motion, Status
from jounce.mechanism.system import Group, System, holding

NONE = 1e-12  # of the largest normal force: less is rounding


def friction_left_out(group: Group) -> Group:
    """Return a group without friction."""
    return holding(group, "friction", None) if rubs(group) else group


def check_not_locked(motion: Motion, system: System, found: Float[Numbers, "order row time"]) -> None:
    """Raise MechanismError at the first instant at which no forces fulfill the laws of friction."""
    names = [] if motion.traced else joints_with_friction(motion.model, system)
    if not names:
        return
    locked = np.isnan(np.asarray(found)[0, -len(names) :]).any(axis=0) & (motion.status == Status.OK)
    if locked.any():
        lane = int(np.argmax(locked))
        message = (
            f"friction locks at t = {motion.time[lane]:g} s: no force of the drivers moves the mechanism as they "
            "prescribe, as friction grows as fast as what presses the joints; give a smaller coefficient or radius, or "
            "more advantage to what drives"
        )
        raise MechanismError(message, name=", ".join(f"{name}.friction" for name in names))


def without_open_rates(forces: Any, found: Float[Numbers, "case order row time"]) -> Numbers:
    """Return multipliers and normal forces, of which rates are NaN where the force that presses a joint passes zero.

    Its size has no derivative there. Where it is zero with all its rates, there is no friction, and none is missing.

    Parameters
    ----------
    forces : MotionForces
        Of which they are.
    found : array of shape (1, levels, rows, time)
        Multipliers, and below them normal forces.
    """
    names = [] if forces.motion.traced else forces.friction.names
    if not names or found.shape[1] == 1:
        return found
    normal = np.asarray(found)[0, 0, -len(names) :]
    size = np.abs(normal).max(initial=0.0)
    lanes = np.flatnonzero((normal <= NONE * size).any(axis=0))
    if not len(lanes):
        return found
    open_ = np.zeros(found.shape[-1], bool)
    for name in names:
        held = forces.friction.pressing_force(
            name, found[0, :, : len(forces.model.rows), lanes].transpose(1, 2, 0), lanes
        )
        sizes = np.abs(held).max(axis=1) / forces.rates[lanes] ** np.arange(len(held))[:, None]
        passed = (sizes[0] <= NONE * size) & (sizes[1:].max(axis=0, initial=0.0) > NONE * size)
        open_[lanes[passed]] = True
        forces.passing.setdefault(name, forces.motion.time[lanes[passed]])
    return np.where(open_ & (np.arange(found.shape[1]) > 0)[:, None, None], np.nan, found)


def passing_words(forces: Any) -> str:
    """Say where rates of friction are open, as `without_open_rates` found them; nothing where none are."""
    told = [
        f"what presses {name} passes zero at t = {listed(times)}: rates of its friction are not determined"
        for name, times in forces.passing.items()
        if len(times)
    ]
    return "; ".join(told)
