"""Checks of joint friction in a motion: instants at which it locks, and at which its rates are not determined."""

import copy
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jounce.base.shapes import Numbers
from jounce.dynamics.friction.coupling import has_friction, joints_with_friction
from jounce.dynamics.inverse.tooth_flanks import listed
from jounce.errors import SolveError
from jounce.kinematics import Motion, Status
from jounce.mechanism.system import Group, System, with_field

NONE = 1e-12  # fraction of the largest normal force: less is rounding


def friction_left_out(group: Group) -> Group:
    """Return a group without friction."""
    return with_field(group, "friction", None) if has_friction(group) else group


def check_not_locked(motion: Motion, system: System, multipliers: Float[Numbers, "order row time"]) -> None:
    """Raise SolveError, with the motion marked LOCKED, if at some instants no forces satisfy the laws of friction."""
    names = [] if motion.traced else joints_with_friction(motion.model, system)
    if not names:
        return
    locked = np.isnan(np.asarray(multipliers)[0, -len(names) :]).any(axis=0) & (motion.status == Status.OK)
    if locked.any():
        lane = int(np.argmax(locked))
        message = (
            f"friction locks at t = {motion.time[lane]:g} s: no force of the drivers moves the mechanism as they "
            "prescribe, as friction grows as fast as the normal forces in joints; give a smaller coefficient or "
            "radius, gears a larger efficiency, or drivers more mechanical advantage"
        )
        locations = ", ".join(f"{name}.friction" for name in names)
        raise SolveError(message, name=locations, motion=_locked_at(motion, np.asarray(locked)), status=Status.LOCKED)


def _locked_at(motion: Motion, locked: Bool[np.ndarray, " time"]) -> Motion:
    """Return a copy of the motion with the status LOCKED at given instants."""
    twin = copy.copy(motion)
    twin.__dict__.pop("dataset", None)
    twin.derived, twin._known_outputs = {}, {}
    twin.status = np.where(locked, int(Status.LOCKED), motion.status)
    return twin


def without_undetermined_rates(forces: Any, multipliers: Float[Numbers, "case order row time"]) -> Numbers:
    """Return multipliers and normal forces, with NaN rates where the force in a joint passes through zero.

    The magnitude of the force has no derivative at such an instant. Where the force and all its rates are zero, so are
    friction and its rates.

    Parameters
    ----------
    forces : MotionForces
        The forces of the motion.
    multipliers : array of shape (1, levels, rows, time)
        Multipliers, and below them normal forces.
    """
    names = [] if forces.motion.traced else forces.friction.names
    if not names or multipliers.shape[1] == 1:
        return multipliers
    normal = np.asarray(multipliers)[0, 0, -len(names) :]
    size = np.abs(normal).max(initial=0.0)
    lanes = np.flatnonzero((normal <= NONE * size).any(axis=0))
    if not len(lanes):
        return multipliers
    is_undetermined = np.zeros(multipliers.shape[-1], bool)
    for name in names:
        joint_force = forces.friction.pressing_force(
            name, multipliers[0, :, : len(forces.model.rows), lanes].transpose(1, 2, 0), lanes
        )
        sizes = np.abs(joint_force).max(axis=1) / forces.rates[lanes] ** np.arange(len(joint_force))[:, None]
        passes_zero = (sizes[0] <= NONE * size) & (sizes[1:].max(axis=0, initial=0.0) > NONE * size)
        is_undetermined[lanes[passes_zero]] = True
        forces.passing.setdefault(name, forces.motion.time[lanes[passes_zero]])
    return np.where(is_undetermined & (np.arange(multipliers.shape[1]) > 0)[:, None, None], np.nan, multipliers)


def passing_words(forces: Any) -> str:
    """Return a sentence on the instants at which rates of friction are not determined; empty if there are none."""
    phrases = [
        f"what presses {name} passes zero at t = {listed(times)}: rates of its friction are not determined"
        for name, times in forces.passing.items()
        if len(times)
    ]
    return "; ".join(phrases)
