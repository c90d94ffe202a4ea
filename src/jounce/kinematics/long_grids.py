"""Time grids of any length, solved stretch by stretch, so that no more is kept of each than what is asked for."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from jounce.kinematics.grid import GridSolver, room_for
from jounce.kinematics.path_following import FollowedPath
from jounce.kinematics.solver import Solver
from jounce.mechanism.time import Instants

STRETCH = 2**16  # instants


class Solved(NamedTuple):
    """What is known of all instants of a grid.

    Attributes
    ----------
    coordinates : dict of str to array, or callable
        Jets of the coordinates of all bodies, time last, or what computes them again.
    outputs : tuple of array
        Jets of the outputs, time last.
    status : array of int, shape (time,)
    faults : dict of int to str
    """

    coordinates: dict[str, Any] | Callable[[], dict[str, Any]]
    outputs: tuple[Any, ...]
    status: Int[np.ndarray, " time"]
    faults: dict[int, str]


def solve_grid(
    solver: Solver,
    path: FollowedPath,
    time: Float[np.ndarray, " time"],
    progress: Callable[[int, int], None] | None,
    threads: int,
    *,
    keep: bool | None,
) -> Solved:
    """Return all instants of a grid, solved from the anchors of a path.

    Parameters
    ----------
    solver : Solver
        What solved the path.
    path : FollowedPath
        The motion followed.
    time : array of shape (time,)
        Instants, s.
    progress : callable, optional
        Called with the number of instants done and their total.
    threads : int
        That solve batches.
    keep : bool, optional
        Whether the jets of all bodies are kept; where they fit into one stretch, unless given. They are computed again
        when they are asked for.
    """
    kept = len(time) <= STRETCH if keep is None else keep
    status, faults = np.empty(len(time), int), {}
    store = None if len(time) <= STRETCH else _Store(path, len(time), kept=kept)
    state: Any = None
    for first, part in stretches(solver, path, time, progress, threads, store):
        status[first : first + len(part.time)] = part.status
        faults |= {first + lane: fault for lane, fault in part.faults.items()}
        state = part.state
    coordinates, outputs = state if store is None else store.state
    if kept:
        return Solved(coordinates, outputs, status, faults)
    return Solved(lambda: _coordinates(solver, path, time, threads), outputs, status, faults)


class _Store:
    """Arrays for the states of a grid of several stretches; of coordinates, unless kept, for one stretch after another.

    Behind those of a stretch are those of its anchors, which make room for those of the next one.
    """

    def __init__(self, path: FollowedPath, count: int, *, kept: bool):
        self._count, self._kept = count, kept
        rooms = [count if kept else STRETCH, count, STRETCH]
        states = zip(path.anchors[0].state, rooms, strict=True)
        self._arrays: Any = tuple(room_for(part, room + len(path.anchors)) for part, room in states)

    def of_stretch(self, first: int) -> Any:
        """Return the arrays of a stretch, by its first instant."""
        begins = first if self._kept else 0, first, 0
        parts = zip(self._arrays, begins, strict=True)
        return tuple(jax.tree.map(lambda x, begin=begin: x[..., begin:], part) for part, begin in parts)

    @property
    def state(self) -> tuple[dict[str, Any], tuple[Any, ...]]:
        """Jets of the coordinates, if they are kept, and of the outputs, time last."""
        coordinates, outputs, _ = jax.tree.map(lambda x: x[..., : self._count], self._arrays)
        return coordinates, outputs


def _coordinates(
    solver: Solver, path: FollowedPath, time: Float[np.ndarray, " time"], threads: int
) -> dict[str, np.ndarray]:
    """Return the jets of the coordinates of all bodies, solved once more."""
    found: Any = solve_grid(solver, path, time, None, threads, keep=True).coordinates
    return found


def stretches(
    solver: Solver,
    path: FollowedPath,
    time: Instants,
    progress: Callable[[int, int], None] | None,
    threads: int,
    store: _Store | None = None,
) -> Iterator[tuple[int, GridSolver]]:
    """Yield the stretches of a grid one after another, solved, with the index of their first instant.

    Their states go into a store, unless each has arrays of its own.
    """
    for first in range(0, len(time), STRETCH):

        def told(done: int, _: int, first: int = first) -> None:
            if progress is not None:
                progress(first + done, len(time))

        before = time[first - 1] if first else -np.inf
        arrays = None if store is None else store.of_stretch(first)
        part = GridSolver(solver, path, time[first : first + STRETCH], time[-1] - time[0], arrays)
        part.solve(None if progress is None else told, threads, explain=bool(before < path.ended_at))
        yield first, part
