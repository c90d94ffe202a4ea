"""A mode as a visible motion: the bodies swing about the equilibrium with closed joints."""

import math

import jax
import numpy as np
from jaxtyping import Complex, Float

from jounce.dynamics.statics.independent_coordinates import Reduction
from jounce.errors import MechanismError, SolveError
from jounce.kinematics import Motion, Status
from jounce.kinematics.results.pose_outputs import output_values


def mode_motion(
    reduction: Reduction,
    shape: Complex[np.ndarray, " coordinate"],
    amplitude: float,
    instants: Float[np.ndarray, " time"],
    name: str,
) -> Motion:
    """Return one swing of a mode as a motion of order 0.

    Parameters
    ----------
    reduction : Reduction
        Equations of small motions about an equilibrium.
    shape : array of shape (coordinates,)
        Shape of the mode.
    amplitude : float
        Amplitude of the body that moves most, rad or sizes of the mechanism.
    instants : array of shape (time,)
        Instants of the motion, s; the last one is a whole swing after the first.
    name : str
        Name of the mode, for messages.

    Raises
    ------
    SolveError
        If joints cannot be closed so far from the equilibrium.
    """
    point = reduction.point
    columns = reduction.basis @ shape
    columns = columns * (amplitude / np.abs(columns).max())
    phases = np.exp(2j * math.pi * np.linspace(0.0, 1.0, len(instants)))
    displacements = np.real(columns[:, None] * phases / 1j)  # begins at the equilibrium
    model, changes, frames = point.model, point.changes(displacements[None])[0], []
    for k in range(len(instants)):
        coordinates = point.closed(point.displaced(changes[..., k : k + 1]))
        if coordinates is None:
            message = f"{name} cannot be shown with an amplitude of {amplitude:g}: joints stay open; choose less"
            raise SolveError(message, status=Status.NOT_ASSEMBLED)
        frames.append(coordinates)
    stacked_coordinates = jax.tree.map(lambda *xs: np.concatenate(xs, axis=-1)[None], *frames)
    groups = output_values(model.system.outputs, stacked_coordinates, model.pose_type)
    status = np.full(len(instants), int(Status.OK))
    return Motion(point.mechanism, model, instants, 0, (stacked_coordinates, groups), status, {})


def checked_amplitude(amplitude: object) -> float:
    """Return an amplitude, or raise MechanismError."""
    if isinstance(amplitude, bool) or not isinstance(amplitude, int | float) or not 0 < amplitude <= 1:
        message = "must be a number above zero and at most 1, rad or sizes of the mechanism"
        raise MechanismError(message, name="amplitude", value=amplitude)
    return float(amplitude)
