"""A motion over more instants than fit into memory: solved chunk by chunk, each chunk a motion."""

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
    """The motion of a mechanism in chunks: iterating solves them one after another, and none stays in memory.

    Attributes
    ----------
    mechanism : Mechanism
        What is solved.
    time : sequence of float
        All instants, s.
    order : int
        Highest derivative of the outputs.
    status : numpy.ndarray of int8, shape (time,)
        Outcome at each instant of the chunks so far, see `Status`; OK at those to come.
    faults : dict of int to str
        For the instants that failed so far, by index, as those of a `Motion`.
    change_points : numpy.ndarray of shape (points,)
        When the motion passes a singular position smoothly, s, as those of a `Motion`; known from the start.
    passages : tuple of ChangePoint
        The change points, with how far the motion carries as a Taylor series at each, as those of a `Motion`.
    backend : str
        Which arithmetic gives the numbers, as that of a `Motion`.
    derived : dict
        Values computed from the chunks that may be needed again, by name.
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
        """Solve and yield one chunk after another; the results of an instant are those of `jounce.solve`."""
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
    """Tell whether the time grid of a mechanism is longer than one chunk."""
    if mechanism.time is None:
        return False  # which a solve complains of
    return len(instants_of(mechanism.time, mechanism.parameter_values)) > grid_storage.CHUNK
