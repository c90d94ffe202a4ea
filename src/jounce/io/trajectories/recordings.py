"""What a file recorded or ordered of joints at instants."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from jounce.errors import TrajectoryError, check_name

LEVELS = ("positions", "velocities", "accelerations")


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """Positions of joints at instants, with velocities and accelerations where a file has them.

    Parameters
    ----------
    path : str
        The file.
    names : tuple of str
        Of the joints.
    times : array of shape (row,)
        Strictly increasing, s.
    values : array of shape (row, level, joint)
        Positions, velocities and accelerations; NaN where there is none.
    lines : sequence of int
        The line of each row; empty where the file has none.
    points : bool
        Whether these are points that a controller goes to, and not samples of a motion.
    notes : tuple of str
        What of the file was not taken as it is.
    measures : dict of str to {"angle", "length"}
        What joints move by, where units say it.
    unnamed : bool
        Whether the file does not name its joints.
    others : frozenset of str
        Names by which columns say that they hold torques or the like, and no positions of a joint.
    """

    path: str
    names: tuple[str, ...]
    times: Float[np.ndarray, " row"]
    values: Float[np.ndarray, "row level joint"]
    lines: Sequence[int] | Int[np.ndarray, " row"] = ()
    points: bool = False
    notes: tuple[str, ...] = ()
    measures: Mapping[str, str] = dataclasses.field(default_factory=dict)
    unnamed: bool = False
    others: frozenset[str] = frozenset()

    def error(self, message: str, row: Any = None, **fields: object) -> TrajectoryError:
        """Return an error about a row of the file."""
        line = int(self.lines[row]) if row is not None and len(self.lines) else None
        return TrajectoryError(message, path=self.path, line=line, **fields)  # type: ignore[arg-type]

    def renamed(self, joints: Sequence[str]) -> Recording:
        """Return the recording with other names of the joints, in its order."""
        names = tuple(joints)
        if len(names) != len(self.names) or len(set(names)) < len(names):
            message = f"the file has {len(self.names)} joints; give as many different names, in its order"
            raise TrajectoryError(message, path=self.path, name="joints", value=list(names))
        return dataclasses.replace(self, names=names, unnamed=False)

    def selected(self, joints: Sequence[str]) -> Recording:
        """Return the recording of some of its joints alone, and without rows that say nothing of them."""
        for name in joints:
            check_name("joint", name, self.names, TrajectoryError, name="joints")
        columns = [self.names.index(name) for name in dict.fromkeys(joints)]
        values = self.values[:, :, columns]
        rows = ~np.isnan(values[:, 0]).all(axis=1)
        lines = np.asarray(self.lines)[rows] if len(self.lines) else ()
        names = tuple(self.names[k] for k in columns)
        return dataclasses.replace(self, names=names, times=self.times[rows], values=values[rows], lines=lines)
