"""Stability of an equilibrium from the matrices of its small motions."""

from typing import NamedTuple

import numpy as np

from jounce.dynamics.statics.eigenmodes import EPSILON, Square, eigenmodes, is_symmetric

DECAY = 1e-9  # fraction of the fastest rate: slower growth is rounding


class Verdict(NamedTuple):
    """The stability of small motions.

    Attributes
    ----------
    word : str
        ``stable``, ``unstable``, ``indifferent``, ``undetermined``, or ``held`` if nothing can move.
    reason : str
        The reason in words.
    direction : array of shape (coordinates,) or None
        The motion that grows, or that no force resists.
    """

    word: str
    reason: str
    direction: np.ndarray | None = None


def stability_of(stiffness: Square, noise: Square, damping: Square, damping_noise: Square, mass: Square) -> Verdict:
    """Return the stability of an equilibrium.

    Conservative forces are judged by the definiteness of the stiffness (Lagrange and Dirichlet; Kelvin and Tait with
    damping), other forces by the eigenvalues of the linear equations, which need a regular mass matrix.
    """
    if not len(stiffness):
        return Verdict("held", "nothing can move")
    even = _equilibration_factors(noise)
    stiffness, noise, damping, damping_noise = (x * even for x in (stiffness, noise, damping, damping_noise))
    mass = mass * even
    conservative = is_symmetric(stiffness, noise)
    brakes = np.linalg.eigvalsh((damping + damping.T) / 2)[0] >= -np.max(damping_noise)
    if conservative and brakes and is_symmetric(damping, damping_noise):
        values, vectors = np.linalg.eigh((stiffness + stiffness.T) / 2)
        error_bounds = np.einsum("ik,ij,jk->k", np.abs(vectors), noise, np.abs(vectors))
        error_bounds = error_bounds + 4 * EPSILON * np.abs(values).max()
        first = vectors[:, 0] * np.sqrt(np.diag(even))
        if values[0] < -error_bounds[0]:
            return Verdict("unstable", "energy falls", first)
        if values[0] <= error_bounds[0]:
            return Verdict("indifferent", "no stiffness", first)
        return Verdict("stable", "energy rises in all directions")
    return _by_eigenvalues(stiffness, noise, damping, damping_noise, mass)


def _equilibration_factors(noise: Square) -> Square:
    """Return factors that scale the entries of all coordinates to about one, so that m and rad count alike.

    They follow from the sizes of the summed terms, since a stiffness itself may be mere rounding.
    """
    size = np.sqrt(np.diag(noise))
    size = np.where(size > 0, size, size.max(initial=0.0) or 1.0)
    return 1 / np.outer(size, size)


def _by_eigenvalues(stiffness: Square, noise: Square, damping: Square, damping_noise: Square, mass: Square) -> Verdict:
    try:
        modes = eigenmodes(mass, damping, stiffness, (damping_noise, noise))
    except np.linalg.LinAlgError:
        return Verdict("undetermined", "the forces have no energy, and bodies that can move have no mass")
    growth = np.real(modes.eigenvalues)
    index = int(np.argmax(growth))
    threshold = DECAY * np.abs(modes.eigenvalues).max()
    if growth[index] > threshold:
        return Verdict("unstable", "small motions grow", modes.shapes[:, index])
    if np.any(modes.eigenvalues == 0):
        return Verdict("indifferent", "no stiffness", modes.shapes[:, 0])
    if growth[index] < -threshold:
        return Verdict("stable", "small motions die away")
    return Verdict("undetermined", "small motions neither grow nor die away, and the forces have no energy")
