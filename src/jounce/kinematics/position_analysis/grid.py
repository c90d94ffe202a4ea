"""The instants of a time grid, solved from the anchors of a followed motion.

An instant of a long grid starts from its nearest anchor, or from a neighbor solved before. Most are thus predicted to
rounding, and many are solved side by side (see `grid_blocks`). An instant that fails there, and all that start from
it, are solved once more in order of dependence, as are the few instants of a short grid that were not solved on the
way. No singular position lies between two anchors, so the sign of the determinant reveals an instant on another
branch.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.execution.buffer_pool import arrays_in, bytes_needed, lend
from jounce.execution.threads import Threads
from jounce.jet.derivatives import plain_derivatives
from jounce.kinematics.continuation.anchors import ChangePoint
from jounce.kinematics.continuation.change_points import LARGEST_DISAGREEMENT, bridged, half_width, spoiled
from jounce.kinematics.continuation.correct_and_differentiate import SolvedState, StepResult
from jounce.kinematics.continuation.path_following import OK, PASSABLE, FollowedPath, follow
from jounce.kinematics.continuation.solver import SMALL_BATCH, Solver
from jounce.kinematics.position_analysis.grid_blocks import LONG_GRID, blocks_for, neighbors, solve_blocks, stride_of
from jounce.kinematics.status import Status
from jounce.mechanism.time import nearest_instants

Indices = Int[np.ndarray, " lane"]


class GridSolver:
    """Solver of the instants of a time grid, or of a chunk of one, from the anchors of a path over a span, s.

    Attributes
    ----------
    status : array of int, shape (time,)
    faults : dict of int to str
        Body farthest from its prediction, or driver without a permitted value, for each instant that failed.
    """

    def __init__(self, solver: Solver, path: FollowedPath, time: Float[np.ndarray, " time"], span: float):
        self.solver, self.path, self.time, self.span = solver, path, time, span
        self.status = np.full(len(time), int(Status.NOT_REACHED))
        self.faults: dict[int, str] = {}
        self._anchors = path.anchors_around(time[0], time[-1])
        self._reached = time < path.ended_at
        like, solved = self._anchors[0], np.flatnonzero(path.is_solved)
        self.status[solved] = OK
        if len(solved) == len(time) and not path.change_points and self._reached.all():
            self._leaves = path.solved_leaves  # the path has solved every instant
        else:
            shapes = [(*x.shape[:-1], len(time) + len(self._anchors)) for x in like.leaves]
            self._leaves = arrays_in(lend(bytes_needed(shapes)), shapes, [float] * len(shapes))
            if solved.size:
                self._store_lanes(solved, [x[..., solved] for x in path.solved_leaves])
        self._store: SolvedState = jax.tree.unflatten(like.structure, self._leaves)

    @cached_property
    def _instants(self) -> Float[np.ndarray, " time"]:
        """Instants of the grid, followed by those of the anchors, s."""
        return np.concatenate([self.time, [anchor.instant for anchor in self._anchors]])

    @property
    def state(self) -> tuple[dict[str, Any], tuple[Any, ...]]:
        """Jets of the coordinates, and derivatives of the outputs, time last."""
        coordinates, outputs, _ = self._store
        count = len(self.time)
        solved = {name: x[..., :count] for name, x in coordinates.items()}
        return solved, tuple([plain_derivatives(x[..., :count]) for x in outputs])

    def solve(self, progress: Callable[[int, int], None] | None, threads: int, *, explain: bool) -> None:
        """Solve the instants; where prediction from a neighbor fails, follow the motion from an anchor.

        The result does not depend on the number of threads. With `explain`, the first instant that was not reached gets
        the reason.
        """
        count = len(self.time)
        unsolved = self._reached & (self.status != OK)
        remaining = int(np.count_nonzero(unsolved))
        done = count - remaining

        def report(solved: int) -> None:
            nonlocal done
            done = min(done + solved, count)
            if progress is not None:
                progress(done, count)

        if remaining or not self._reached.all():
            self._solve_remaining(unsolved, threads, report)
        for point in self.path.change_points:
            self._bridge(point)
        self._refuse(self.path.singular_positions_outside())
        if explain and not self._reached.all():
            self._explain_end(int(np.argmin(self._reached)))
        if progress is not None and done < count:
            progress(count, count)

    def _solve_remaining(self, mask: Bool[np.ndarray, " time"], threads: int, report: Callable[[int], None]) -> None:
        """Solve the instants marked in a mask."""
        count = len(self.time)
        stride = stride_of(self.solver, int(np.count_nonzero(mask)), count, len(self._anchors))
        with Threads(threads, compiled=self.solver.is_compiled) as pool:
            if count > LONG_GRID:
                mask = self._in_blocks(mask, stride, pool, report)
            if mask.any() or not self._reached.all():
                self._insert_anchors()
            for lanes in _levels(mask, stride):
                size = self.solver.together if count > LONG_GRID else SMALL_BATCH
                source = self._sources(lanes, stride)
                batches = [(lanes[k : k + size], source[k : k + size]) for k in range(0, len(lanes), size)]
                for (batch, _), arrival in zip(batches, pool.map(self._solve_batch, batches), strict=True):
                    self._finish_batch(batch, arrival)
                    report(len(batch))

    def _in_blocks(
        self, unsolved: Bool[np.ndarray, " time"], stride: int, pool: Threads, report: Callable[[int], None]
    ) -> Bool[np.ndarray, " time"]:
        """Solve instants in rounds, and return those left: the failures, and the instants that start from them.

        Blocks report only that an instant failed; solving these once more finds the cause.
        """
        count = int(np.count_nonzero(unsolved))  # a long grid is reached up to some instant, and nothing is solved yet

        def put(lanes: slice, state: SolvedState, status: Indices) -> None:
            self._store_lanes(lanes, jax.tree.leaves(state))
            self.status[lanes] = status

        blocks = blocks_for(self.solver, 0, count, stride)
        for solved in solve_blocks(self.solver, self.path, self.time, blocks, put, pool.map):
            report(solved)
        failed = unsolved & (self.status != OK)
        if failed.any():
            for lanes in _levels(unsolved, stride):
                neighbor, has_neighbor = neighbors(lanes, stride)
                failed[lanes] |= failed[neighbor] & has_neighbor
        return failed

    def _sources(self, lanes: Indices, stride: int) -> Indices:
        """Return the source of each prediction: the neighbor, where it is solved and nearer, or the nearest anchor."""
        neighbor, has_neighbor = neighbors(lanes, stride)
        has_neighbor &= self.status[neighbor] == OK
        time = self.time[lanes]
        nearest = len(self.time) + nearest_instants(self._instants[len(self.time) :], time)
        nearer = np.abs(time - self._instants[neighbor]) <= np.abs(time - self._instants[nearest])
        return np.where(nearer & has_neighbor, neighbor, nearest)

    def _solve_batch(self, batch: tuple[Indices, Indices]) -> StepResult:
        """Solve a batch of instants from their sources, and store their states."""
        lanes, source = batch
        source_data = jax.tree.map(lambda x: x[..., source], self.solver.needed(self._store))
        arrival = self.solver(source_data, self.time[lanes] - self._instants[source], self.time[lanes])
        self._store_lanes(lanes, jax.tree.leaves((arrival.coordinates, arrival.outputs, arrival.sign)))
        return arrival

    def _finish_batch(self, lanes: Indices, arrival: StepResult) -> None:
        """Store the outcome of a batch, and follow the motion to the instants that failed."""
        self.status[lanes] = arrival.status
        for k in np.flatnonzero(arrival.status != OK).tolist():
            self.faults[int(lanes[k])] = self.solver.fault(arrival, k)
            if arrival.status[k] not in PASSABLE:
                self._rescue(int(lanes[k]))

    def _insert_anchors(self) -> None:
        """Append the anchors behind the instants, and set the states of unreached instants to zero."""
        count, reached_count = len(self.time), int(np.count_nonzero(self._reached))
        for array, *parts in zip(self._leaves, *(x.leaves for x in self._anchors), strict=True):
            array[..., reached_count:count] = 0
            array[..., count:] = np.concatenate(parts, axis=-1)

    def _store_lanes(self, lanes: slice | Indices, leaves: Sequence[np.ndarray]) -> None:
        for array, part in zip(self._leaves, leaves, strict=True):
            array[..., lanes] = part

    def _rescue(self, lane: int) -> None:
        """Follow the motion to one instant from the anchor before it."""
        anchors, instant = self._anchors, float(self.time[lane])
        before = int(np.searchsorted([a.instant for a in anchors], instant, side="right")) - 1
        start = anchors[before]
        local = follow(self.solver, start, instant, self.span, (instant - start.instant) / 2)
        if local.status != OK:
            self.status[lane], self.faults[lane] = local.status, local.fault
        elif len(local.anchors) > 1:
            self.status[lane] = local.anchors[-1].status
            self.faults.pop(lane)
            self._store_lanes(slice(lane, lane + 1), local.anchors[-1].leaves)

    def _bridge(self, point: ChangePoint) -> None:
        """Replace the instants at and next to a change point by interpolation of the motion on both sides."""
        is_near = np.abs(self.time - point.instant) < half_width(point, self.solver.order)
        lanes = np.flatnonzero(is_near & (self.time < self.path.ended_at))
        if not lanes.size:
            return
        state = bridged(self.solver, self.path, point, self.time[lanes])
        if state is None or self._disagreement(state[0], lanes) > LARGEST_DISAGREEMENT:
            self._refuse([point])
            return
        self.status[lanes] = OK
        for lane in lanes.tolist():
            self.faults.pop(lane, None)
        self._store_lanes(lanes, jax.tree.leaves((*state, self._store[2][lanes])))

    def _disagreement(self, coordinates: dict[str, np.ndarray], lanes: Indices) -> float:
        """Return the largest difference of coordinates from the positions already solved, rad or m."""
        solved, names = self.status[lanes] == OK, self.solver.model.pose_type.predictor
        differences = [
            np.abs(coordinates[name][0] - self._store[0][name][0][..., lanes])[..., solved] for name in names
        ]
        return max(np.max(x, initial=0.0) for x in differences)

    def _refuse(self, points: Sequence[ChangePoint]) -> None:
        """Mark instants next to singular positions as SINGULAR, where rounding dominates the results."""
        self.status[spoiled(points, self.time, self.solver.order) & (self.status == OK)] = Status.SINGULAR

    def _explain_end(self, lane: int) -> None:
        """Store, at the first instant that was not reached, why the motion could not be followed there."""
        path, instant = self.path, self.time[lane : lane + 1]
        self.status[lane], self.faults[lane] = path.status, path.fault
        last = path.anchors[-1]
        arrival = self.solver(self.solver.needed(last.state), instant - last.instant, instant)
        if arrival.status[0] == Status.INADMISSIBLE:  # the law is at fault, not the position before
            self.status[lane], self.faults[lane] = Status.INADMISSIBLE, self.solver.fault(arrival, 0)


def _levels(unsolved: Bool[np.ndarray, " time"], stride: int) -> Iterator[Indices]:
    """Yield instants in groups, each after those it starts from; the depth is the number of ones in the index."""
    lanes = np.flatnonzero(unsolved)
    depth = np.bitwise_count(lanes & (stride - 1))
    for level in np.unique(depth).tolist() if lanes.size else ():
        yield lanes[depth == level]
