"""Recordings: measured or commanded values of joints at instants, from a file."""

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
    """Positions of joints at instants, with velocities and accelerations if a file has them.

    Parameters
    ----------
    path : str
        Path of the file.
    names : tuple of str
        Names of the joints.
    times : array of shape (row,)
        Strictly increasing instants, s.
    values : array of shape (row, level, joint)
        Positions, velocities and accelerations; NaN for missing values.
    lines : sequence of int
        Line of each row; empty if the file has no lines.
    points : bool
        Whether the rows are points for a controller, instead of samples of a motion.
    notes : tuple of str
        Descriptions of parts of the file that were changed.
    measures : dict of str to {"angle", "length"}
        Kinds of the coordinates, if units state them.
    unnamed : bool
        Whether the file does not name its joints.
    others : frozenset of str
        Names of columns that state torques or the like instead of positions of a joint.
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
        """Return the recording with other names of its joints, in its order."""
        names = tuple(joints)
        if len(names) != len(self.names) or len(set(names)) < len(names):
            message = f"the file has {len(self.names)} joints; give as many different names, in its order"
            raise TrajectoryError(message, path=self.path, name="joints", value=list(names))
        return dataclasses.replace(self, names=names, unnamed=False)

    def selected(self, joints: Sequence[str]) -> Recording:
        """Return the recording of some joints, without the rows that have no values of them."""
        for name in joints:
            check_name("joint", name, self.names, TrajectoryError, name="joints")
        columns = [self.names.index(name) for name in dict.fromkeys(joints)]
        values = self.values[:, :, columns]
        rows = ~np.isnan(values[:, 0]).all(axis=1)
        lines = np.asarray(self.lines)[rows] if len(self.lines) else ()
        names = tuple(self.names[k] for k in columns)
        return dataclasses.replace(self, names=names, times=self.times[rows], values=values[rows], lines=lines)
