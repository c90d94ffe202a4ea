"""Recordings of joint states, each of some joints at one stamp."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from decimal import Decimal
from typing import Any

import numpy as np

from jounce.errors import TrajectoryError
from jounce.io.trajectories.recordings import Recording
from jounce.io.trajectories.stamps import epoch


@dataclasses.dataclass(frozen=True)
class State:
    """The positions of some joints at a stamp, with velocities if available.

    Parameters
    ----------
    stamp : Decimal
        Exact stamp, s.
    names : sequence of str
        Names of the joints.
    levels : sequence of array_like
        Positions, then velocities if available.
    line : int, default 0
        Line in the file; 0 if there is none.
    """

    stamp: Decimal
    names: Sequence[str]
    levels: Sequence[Any]
    line: int = 0


def recorded_states(path: str, states: Sequence[State]) -> Recording:
    """Return the recording of states, which need not all contain the same joints.

    Raises
    ------
    TrajectoryError
        If some stamps are zero, and others are counted from an epoch.
    """
    unstamped = [k for k, state in enumerate(states) if not state.stamp]
    if unstamped and epoch(max(state.stamp for state in states)) is not None:
        k = unstamped[0]
        message = (
            f"{len(unstamped)} of {len(states)} messages have no stamp, the first is message {k + 1}; leave them out"
        )
        raise TrajectoryError(message, path=path, line=states[k].line or None, name="stamp", value=0)
    names = list(dict.fromkeys(name for state in states for name in state.names))
    columns = {name: k for k, name in enumerate(names)}
    values = np.full((len(states), 2, len(names)), np.nan)
    for k, state in enumerate(states):
        indices = [columns[name] for name in state.names]
        for level, numbers in enumerate(state.levels):
            values[k, level, indices] = numbers
    first = states[0].stamp
    epoch_unit = epoch(first)
    times = np.array([float(state.stamp - (first if epoch_unit else 0)) for state in states])
    moving = ~np.isnan(values[:, 0])
    levels = 2 if (~np.isnan(values[:, 1]) == moving).all() else 1
    lines = [state.line for state in states] if states[0].line else ()
    return Recording(
        path, tuple(names), times, values[:, :levels], lines, notes=() if epoch_unit is None else (epoch_unit[1],)
    )
