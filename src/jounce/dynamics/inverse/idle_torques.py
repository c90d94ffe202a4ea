"""The check that forces do not depend on idle motions: torques that would spin a body about an axis no joint holds."""

from typing import Any

import numpy as np

from jounce.base.shapes import Numbers
from jounce.constraints.spin_hold import SpinHold
from jounce.errors import MechanismError
from jounce.kinematics import Status

NOTHING = 1e-9  # fraction of the largest multiplier: less is rounding


def checked(forces: Any) -> Any:
    """Return the forces, or raise MechanismError if torques would spin a body about an axis that no joint holds.

    Parameters
    ----------
    forces : MotionForces
        Forces of a motion in which idle bodies move least.
    """
    model, motion = forces.model, forces.motion
    if not any(isinstance(group.element, SpinHold) for group in model.system.groups):
        return forces
    multipliers, solved = np.nan_to_num(forces.multipliers), motion.status == Status.OK
    max_torques = np.abs(multipliers[..., solved]).max(axis=(1, 2), initial=0.0) * model.length
    rate = _rate(forces, solved)
    for level in range(1, len(max_torques)):  # a level that vanishes is as exact as the level before
        max_torques[level] = max(max_torques[level], rate * max_torques[level - 1])
    for place in forces.indices.values():
        group = model.system.groups[place.group]
        if not isinstance(group.element, SpinHold):
            continue
        torque = np.abs(multipliers[:, list(place.own_rows)][..., solved]).max(axis=(1, 2), initial=0.0)
        if (torque > NOTHING * max_torques).any():
            body = model.bodies[group.bodies[0][place.instance] - 1]
            message = (
                "inertia or forces would spin this body about an axis of itself, which nothing prescribes, and the "
                "forces in the mechanism depend on it: simulate the motion, or hold the body by a joint or driver"
            )
            raise MechanismError(message, name=f"bodies.{body}")
    return forces


def _rate(forces: Any, solved: Numbers) -> float:
    """Return the rate of change of the motion, 1/s, from the sizes of its Taylor coefficients."""
    lengths = {"position": forces.model.length, "angle": 1.0, "quaternion": 1.0}
    sizes = [
        np.nan_to_num(np.abs(forces.coordinates[name][1:, ..., solved])).reshape(forces.levels + 1, -1) / scale
        for name, scale in lengths.items()
        if name in forces.coordinates
    ]
    powers = 1.0 / np.arange(1.0, forces.levels + 2)
    return float(max((size.max(axis=1, initial=0.0) ** powers).max() for size in sizes))
