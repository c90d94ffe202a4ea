"""Whether small motions about an equilibrium stay small, judged from the matrices of their equations."""

from typing import NamedTuple

import numpy as np

from jounce.dynamics.statics.eigenmodes import EPSILON, Square, eigenmodes, is_symmetric

DECAY = 1e-9  # of the fastest rate: growth that is slower is rounding


class Verdict(NamedTuple):
    """What small motions do.

    Attributes
    ----------
    word : str
        ``stable``, ``unstable``, ``indifferent``, ``undetermined``, or ``held`` where nothing can move.
    reason : str
        In words.
    direction : array of shape (coordinates,) or None
        The motion that grows, or that no force resists.
    """

    word: str
    reason: str
    direction: np.ndarray | None = None


def stability_of(stiffness: Square, noise: Square, damping: Square, damping_noise: Square, mass: Square) -> Verdict:
    """Return whether an equilibrium is stable.

    Where the forces have an energy, by the sign of the stiffness (Lagrange and Dirichlet; Kelvin and Tait with
    damping). Elsewhere by the eigenvalues of the linear equations, for which the mass matrix must be regular.
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
        bound = np.einsum("ik,ij,jk->k", np.abs(vectors), noise, np.abs(vectors))
        bound = bound + 4 * EPSILON * np.abs(values).max()
        first = vectors[:, 0] * np.sqrt(np.diag(even))
        if values[0] < -bound[0]:
            return Verdict("unstable", "energy falls", first)
        if values[0] <= bound[0]:
            return Verdict("indifferent", "no stiffness", first)
        return Verdict("stable", "energy rises in all directions")
    return _by_eigenvalues(stiffness, noise, damping, damping_noise, mass)


def _equilibration_factors(noise: Square) -> Square:
    """Return factors of the entries by which those of all coordinates come near to one: m and rad count alike.

    They follow from what the entries are sums of, as a stiffness may be zero but for rounding.
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
    worst = int(np.argmax(growth))
    bound = DECAY * np.abs(modes.eigenvalues).max()
    if growth[worst] > bound:
        return Verdict("unstable", "small motions grow", modes.shapes[:, worst])
    if np.any(modes.eigenvalues == 0):
        return Verdict("indifferent", "no stiffness", modes.shapes[:, 0])
    if growth[worst] < -bound:
        return Verdict("stable", "small motions die away")
    return Verdict("undetermined", "small motions neither grow nor die away, and the forces have no energy")
