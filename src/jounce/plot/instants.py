"""Which instants of a motion are drawn."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from jounce.errors import MechanismError
from jounce.kinematics import Motion

Indices = Int[np.ndarray, " chosen"]


def evenly_chosen(indices: Int[np.ndarray, " some"], most: int) -> Indices:
    """Return all of some indices, or as many as there may be, evenly spread, the first and the last among them.

    Examples
    --------
    >>> evenly_chosen(np.arange(10, 17), 3).tolist()
    [10, 13, 16]
    """
    return indices[np.unique(np.linspace(0, len(indices) - 1, min(most, len(indices))).round().astype(int))]


def solved_instants(motion: Motion) -> Indices:
    """Return the indices of the instants that were solved.

    Raises
    ------
    MechanismError
        There is none.
    """
    solved = np.flatnonzero(np.asarray(motion.status) == 0)
    if not solved.size:
        raise MechanismError("no instant was solved, so that there is nothing to draw", name="motion")
    return solved


def unsolved_runs(motion: Motion) -> list[Indices]:
    """Return the indices of the instants that were not solved, in runs."""
    failed = np.flatnonzero(np.asarray(motion.status))
    return np.split(failed, np.flatnonzero(np.diff(failed) > 1) + 1) if failed.size else []
