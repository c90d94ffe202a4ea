"""The motion over more instants than fit into memory, solved chunk by chunk; each chunk is a `Motion`."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from jounce.kinematics.continuation.path_following import FollowedPath, history_of
from jounce.kinematics.continuation.solver import Solver
from jounce.kinematics.position_analysis import grid_storage
from jounce.kinematics.position_analysis.grid_storage import solved_chunks
from jounce.kinematics.results.actuation import actuated
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.status import Status
from jounce.mechanism import Mechanism
from jounce.mechanism.building.belts import check_room
from jounce.mechanism.time import Instants, instants_of


class ChunkedMotion:
    """The motion of a mechanism, solved chunk by chunk during iteration; no chunk stays in memory.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism solved.
    time : sequence of float
        All instants, s.
    order : int
        Highest derivative of the outputs.
    status : numpy.ndarray of int8, shape (time,)
        Outcome at each instant, see `Status`; OK at the instants of chunks that are not solved yet.
    faults : dict of int to str
        Faults of the instants that failed so far, by index, as in a `Motion`.
    change_points : numpy.ndarray of shape (points,)
        Instants at which the motion passes a singular position smoothly, s, as in a `Motion`; known from the start.
    passages : tuple of ChangePoint
        The change points, each with the radius of the Taylor series of the motion there, as in a `Motion`.
    backend : str
        Backend that computes the numbers, as in a `Motion`.
    derived : dict
        Values computed from the chunks and kept for reuse, by name.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        followed: tuple[Solver, FollowedPath],
        time: Instants,
        order: int,
        progress: Callable[[int, int], None] | None,
        threads: int,
        backend: str,
    ):
        self.backend = backend
        self.mechanism, self.time, self.order = mechanism, time, order
        self.status = np.zeros(len(time), np.int8)  # pages of zeros take no memory
        self.faults: dict[int, str] = {}
        self.derived: dict[str, Any] = {}
        (self._solver, self._path), self._progress, self._threads = followed, progress, threads
        self.passages = tuple(self._path.change_points)
        self.change_points = np.array([point.instant for point in self.passages])

    def __len__(self) -> int:
        """Return the number of instants."""
        return len(self.time)

    def __iter__(self) -> Iterator[Motion]:
        """Solve and yield one chunk after another, with the same results as `jounce.solve`."""
        history, model = history_of(self._path.anchors), self._solver.model
        for first, part in solved_chunks(self._solver, self._path, self.time, self._progress, self._threads):
            failed = np.flatnonzero(part.status != Status.OK)
            self.status[first + failed] = part.status[failed]
            self.faults |= {first + lane: fault for lane, fault in part.faults.items()}
            outcome = part.status, part.faults, self.passages, history, self.backend
            motion = actuated(Motion(self.mechanism, model, part.time, self.order, part.state, *outcome))
            check_room(motion)
            yield motion


def needs_chunks(mechanism: Mechanism) -> bool:
    """Return whether the time grid of a mechanism is longer than one chunk."""
    if mechanism.time is None:
        return False  # the solve reports the missing grid
    return len(instants_of(mechanism.time, mechanism.parameter_values)) > grid_storage.CHUNK
