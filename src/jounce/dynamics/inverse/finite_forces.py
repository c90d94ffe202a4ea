"""Checks that forces of a motion are finite, which name the force and the instant at which one is not."""

from typing import Any

import numpy as np

from jounce.base.shapes import Numbers
from jounce.errors import MechanismError
from jounce.kinematics import Status
from jounce.mechanism.building.element_indices import force_names


def check_finite_values(forces: Any, values: Numbers, name: str | None = None) -> None:
    """Raise MechanismError for the first solved instant at which Taylor coefficients are not finite.

    Parameters
    ----------
    forces : MotionForces
        The forces of the motion.
    values : array of shape (levels, ..., time)
        Taylor coefficients.
    name : str, optional
        Name of the force; by default that of the applied force that is not finite.
    """
    if forces.motion.traced:
        return
    is_bad = ~np.isfinite(values).all(axis=tuple(range(1, values.ndim - 1))) & (forces.motion.status == Status.OK)
    if not is_bad.any():
        return
    lane = int(np.argmax(is_bad.any(axis=0)))
    level = int(np.argmax(is_bad[:, lane]))
    if name is None:
        unfit = [
            n
            for n in force_names(forces.model)
            if not np.isfinite(forces.applied_coefficients(n)[: level + 1, :, lane]).all()
        ]
        name = f"forces.{unfit[0]}" if unfit else "joints"
    phrase, advice = f"no finite value at t = {forces.motion.time[lane]:g} s", "check its law there"
    if level:
        raise MechanismError(f"its derivative {level} has {phrase}; {advice}, or take fewer derivatives", name=name)
    raise MechanismError(f"has {phrase}; {advice}", name=name)


def check_finite_forces(forces: Any, finite: Any) -> None:
    """Raise MechanismError for the first solved instant at which an applied force is not finite."""
    if forces.motion.traced:
        return
    failures = np.argwhere((~np.asarray(finite) & (forces.motion.status == Status.OK)).T)
    if len(failures):
        lane, force = failures[0]
        name, instant = force_names(forces.model)[force], forces.motion.time[lane]
        raise MechanismError(f"has no finite value at t = {instant:g} s; check its law", name=f"forces.{name}")
