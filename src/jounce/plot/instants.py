"""Selection of the instants of a motion to draw."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from jounce.errors import MechanismError
from jounce.kinematics import Motion

Indices = Int[np.ndarray, " chosen"]


def evenly_chosen(indices: Int[np.ndarray, " some"], most: int) -> Indices:
    """Return at most a number of indices, evenly chosen, with the first and the last one.

    Examples
    --------
    >>> evenly_chosen(np.arange(10, 17), 3).tolist()
    [10, 13, 16]
    """
    return indices[np.unique(np.linspace(0, len(indices) - 1, min(most, len(indices))).round().astype(int))]


def solved_instants(motion: Motion) -> Indices:
    """Return the indices of the solved instants.

    Raises
    ------
    MechanismError
        If no instant was solved.
    """
    solved = np.flatnonzero(np.asarray(motion.status) == 0)
    if not solved.size:
        raise MechanismError("no instant was solved, so that there is nothing to draw", name="motion")
    return solved


def unsolved_runs(motion: Motion) -> list[Indices]:
    """Return the indices of the unsolved instants, in runs."""
    failed = np.flatnonzero(np.asarray(motion.status))
    return np.split(failed, np.flatnonzero(np.diff(failed) > 1) + 1) if failed.size else []
