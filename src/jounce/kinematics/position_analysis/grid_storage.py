"""Time grids of any length, solved chunk by chunk, of which only the requested results stay in memory."""

import itertools
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from jounce.execution.threads import Threads
from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics.continuation.change_points import half_width, spoiled_width
from jounce.kinematics.continuation.correct_and_differentiate import SolvedState
from jounce.kinematics.continuation.path_following import FollowedPath
from jounce.kinematics.continuation.solver import Solver
from jounce.kinematics.position_analysis.grid import GridSolver
from jounce.kinematics.position_analysis.grid_blocks import LONG_GRID, blocks_for, solve_blocks, stride_of
from jounce.kinematics.status import Status
from jounce.mechanism.time import Instants

CHUNK = 2**16  # instants


class Solved(NamedTuple):
    """The solution at all instants of a grid.

    Attributes
    ----------
    coordinates : dict of str to array, or callable
        Jets of the coordinates of all bodies, time last, or a function that computes them again.
    outputs : tuple of array
        Derivatives of the outputs, time last.
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
    """Solve all instants of a grid from the anchors of a path.

    Parameters
    ----------
    solver : Solver
        Solver that followed the path.
    path : FollowedPath
        The motion followed.
    time : array of shape (time,)
        Instants, s.
    progress : callable, optional
        Called with the number of instants done and their total.
    threads : int
        Number of threads that solve batches.
    keep : bool, optional
        Whether to keep the jets of all bodies; unless given, those of a grid that fits into one chunk. Others are
        computed again on request.
    """
    keeps_series = len(time) <= CHUNK if keep is None else keep
    status, faults = np.empty(len(time), int), {}
    store = None if len(time) <= CHUNK else _Store(path.anchors[0].state, len(time), keeps_series=keeps_series)
    report = None if progress is None else _without_decrease(progress)
    solved = frozenset() if store is None else _solved_at_once(solver, path, time, report, threads, (store, status))
    state: Any = None
    for first, part in solved_chunks(solver, path, time, report, threads, solved):
        status[first : first + len(part.time)] = part.status
        faults |= {first + lane: fault for lane, fault in part.faults.items()}
        if store is None:
            state = part.state
        else:
            store.put(slice(first, first + len(part.time)), *part.state)
    coordinates, outputs = state if store is None else store.state
    if keeps_series:
        return Solved(coordinates, outputs, status, faults)
    recomputed: Any = partial(solve_grid, solver, path, time, None, threads, keep=True)
    return Solved(lambda: recomputed().coordinates, outputs, status, faults)


def _without_decrease(progress: Callable[[int, int], None]) -> Callable[[int, int], None]:
    """Return a progress callback whose count never decreases, although some instants may be solved twice."""
    largest = 0

    def report(done: int, total: int) -> None:
        nonlocal largest
        largest = max(largest, done)
        progress(largest, total)

    return report


def _solved_at_once(
    solver: Solver,
    path: FollowedPath,
    time: Float[np.ndarray, " time"],
    progress: Callable[[int, int], None] | None,
    threads: int,
    results: "tuple[_Store, Int[np.ndarray, ' time']]",
) -> frozenset[int]:
    """Solve all chunks without known singular positions together, so that no thread waits at the end of a chunk.

    Return the first instants of the chunks in which all instants are OK; the others remain to be solved.
    """
    (store, status), blocks = results, {}
    if path.is_solved.any():
        return frozenset()
    points = [(point, half_width(point, solver.order)) for point in path.change_points]
    points += [(point, spoiled_width(point, solver.order)) for point in path.singular_positions_outside()]
    for first in range(0, len(time), CHUNK):
        chunk = time[first : first + CHUNK]
        start, end, count = chunk[0], chunk[-1], len(chunk)
        is_near = any(start - width < point.instant < end + width for point, width in points)
        if count > LONG_GRID and end < path.ended_at and not is_near:
            stride = stride_of(solver, count, count, len(path.anchors_around(start, end)))
            blocks[first] = blocks_for(solver, first, count, stride)
    done, queue = 0, [*itertools.chain(*blocks.values())]

    def put(lanes: slice, state: SolvedState, outcome: Int[np.ndarray, " lane"]) -> None:
        store.put(lanes, *state[:2], series=True)
        status[lanes] = outcome

    with Threads(threads, compiled=solver.is_compiled) as pool:
        for solved in solve_blocks(solver, path, time, queue, put, pool.map):
            done += solved
            if progress is not None:
                progress(done, len(time))
    return frozenset(first for first in blocks if np.all(status[first : first + CHUNK] == Status.OK))


class _Store:
    """Arrays for the states of all instants of a grid: outputs and, if kept, jets of the coordinates."""

    def __init__(self, like: SolvedState, count: int, *, keeps_series: bool):
        state = like[0] if keeps_series else {}, like[1]  # left untouched, so that each thread first touches its part
        self.state: Any = jax.tree.map(lambda x: np.empty((*x.shape[:-1], count)), state)

    def put(
        self, lanes: slice, coordinates: Mapping[str, Any], outputs: Sequence[Any], *, series: bool = False
    ) -> None:
        """Store instants: jets of the coordinates, and derivatives of the outputs, or their series.

        The series of a failed instant may overflow; the instant is solved again.
        """
        stored_coordinates, stored_outputs = self.state
        for name, array in stored_coordinates.items():
            array[..., lanes] = coordinates[name]
        for array, part in zip(stored_outputs, outputs, strict=True):
            if series:
                with np.errstate(over="ignore"):
                    plain_derivatives(part, out=array[..., lanes])
            else:
                array[..., lanes] = part


def solved_chunks(
    solver: Solver,
    path: FollowedPath,
    time: Instants,
    progress: Callable[[int, int], None] | None,
    threads: int,
    skipped: Collection[int] = (),
) -> Iterator[tuple[int, GridSolver]]:
    """Yield the solved chunks of a grid one after another, with the index of their first instant.

    Chunks that are solved already are skipped; `skipped` has the indices of their first instants.
    """
    for first in range(0, len(time), CHUNK):
        if first in skipped:
            continue

        def report(done: int, _: int, first: int = first) -> None:
            if progress is not None:
                progress(first + done, len(time))

        before = time[first - 1] if first else -np.inf
        part = GridSolver(solver, path, time[first : first + CHUNK], time[-1] - time[0])
        part.solve(None if progress is None else report, threads, explain=bool(before < path.ended_at))
        yield first, part
