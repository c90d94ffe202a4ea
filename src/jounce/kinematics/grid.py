"""All instants of a time grid, solved in batches from the anchors of a motion that was followed.

A long grid is not solved one instant after another. The instants start from their nearest anchor, in levels that halve
the spacing, so that most are predicted to rounding by an instant solved before and all of a level are solved together.
Between two anchors lies no singular position, so that the sign of the determinant tells an instant on another branch.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.kinematics.advance import Arrival, SolvedState
from jounce.kinematics.change_points import LARGEST_DISAGREEMENT, bridged, half_width, spoiled_width
from jounce.kinematics.path_following import (
    PASSABLE,
    FollowedPath,
    Passage,
    follow,
)
from jounce.kinematics.solver import SMALL_BATCH, Solver
from jounce.kinematics.status import Status
from jounce.kinematics.threads import Threads
from jounce.mechanism.time import nearest_instants

Indices = Int[np.ndarray, " lane"]
LONG_GRID = 1024  # instants: from here on in large batches
FEW_BATCHES = 4  # of instants: no level of its own for each halving of the spacing


class GridSolver:
    """The instants of a time grid, or of a stretch of one, solved from the anchors of a path that lasts for a span, s.

    Attributes
    ----------
    status : array of int, shape (time,)
    faults : dict of int to str
        For instants that failed, the body farthest from its prediction, or the driver without a permitted value.
    """

    def __init__(self, solver: Solver, path: FollowedPath, time: Float[np.ndarray, " time"], span: float):
        self.solver, self.path, self.time, self.span = solver, path, time, span
        self.status = np.full(len(time), int(Status.NOT_REACHED))
        self.faults: dict[int, str] = {}
        self._anchors = path.anchors_around(time[0], time[-1])
        anchors = np.array([anchor.instant for anchor in self._anchors])
        self._instants = np.concatenate([time, anchors])
        self._nearest = len(time) + nearest_instants(anchors, time)
        self._store = jax.tree.map(partial(_with_room, len(time)), *(anchor.state for anchor in self._anchors))
        for lanes, state in path.on_the_way:
            self._keep(lanes, state)
            self.status[lanes] = Status.OK

    @property
    def state(self) -> tuple[dict[str, Any], tuple[Any, ...]]:
        """Jets of the coordinates and of the outputs, time last."""
        coordinates, outputs, _ = jax.tree.map(lambda x: x[..., : len(self.time)], self._store)
        return coordinates, outputs

    def solve(self, progress: Callable[[int, int], None] | None, threads: int, *, explain: bool) -> None:
        """Solve level after level; an instant that its neighbour cannot predict is followed to from an anchor.

        The batches of a level are solved in several threads; what comes of it does not depend on how many. To `explain`
        is to say at the first instant that was not reached why.
        """
        count = len(self.time)
        reached = self.time < self.path.ended_at
        width, most = SMALL_BATCH, 1
        if count > LONG_GRID:
            width, most = self.solver.width, self.solver.together // self.solver.width
        left = reached & (self.status != Status.OK)
        done = count - int(np.count_nonzero(left))
        with Threads(threads, compiled=count > LONG_GRID and self.solver.is_compiled) as pool:
            for lanes, distance in _levels(left, len(self._anchors), width):
                source = self._sources(lanes, distance)
                size = width * _lots(len(lanes), width, most, threads)
                batches = [(lanes[k : k + size], source[k : k + size]) for k in range(0, len(lanes), size)]
                for (batch, _), arrival in zip(batches, pool.map(self._solved, batches), strict=True):
                    self._take(batch, arrival)
                    done += len(batch)
                    if progress is not None:
                        progress(done, count)
        for point in self.path.change_points:
            self._bridge(point)
        for point in self.path.singular_positions_outside():
            self._refuse(np.abs(self.time - point.instant) < spoiled_width(point, self.solver.order))
        if explain and not reached.all():
            self._explain_end(int(np.argmin(reached)))
        if progress is not None and done < count:
            progress(count, count)

    def _sources(self, lanes: Indices, distance: int | None) -> Indices:
        """Return from where each instant is predicted: its neighbour, where that is solved, or its nearest anchor."""
        source = self._nearest[lanes]
        if distance is None:
            return source
        neighbour = lanes - distance
        nearer = self._away(lanes, neighbour) <= self._away(lanes, source)
        return np.where(nearer & (self.status[neighbour] == Status.OK), neighbour, source)

    def _solved(self, batch: tuple[Indices, Indices]) -> Arrival:
        """Return what comes of a batch of instants, with their sources; nothing is kept but the state at its lanes."""
        lanes, source = batch
        chosen = _slice_of(source)
        known = jax.tree.map(lambda x: x[..., chosen], self.solver.needed(self._store))
        arrival = self.solver(known, self.time[lanes] - self._instants[source], self.time[lanes])
        self._keep(_slice_of(lanes), arrival.state(slice(None)))
        return arrival

    def _take(self, lanes: Indices, arrival: Arrival) -> None:
        """Keep the outcome of a batch, and follow the motion to the instants that failed."""
        self.status[lanes] = arrival.status
        for k in np.flatnonzero(arrival.status != Status.OK).tolist():
            self.faults[int(lanes[k])] = self.solver.fault(arrival, k)
            if arrival.status[k] not in PASSABLE:
                self._rescue(int(lanes[k]))

    def _away(self, lanes: Indices, source: Indices) -> Float[np.ndarray, " lane"]:
        return np.abs(self.time[lanes] - self._instants[source])

    def _keep(self, lanes: slice | Indices, state: SolvedState) -> None:
        def put(whole: np.ndarray, part: np.ndarray) -> None:
            whole[..., lanes] = part

        jax.tree.map(put, self._store, state)

    def _rescue(self, lane: int) -> None:
        """Follow the motion to one instant from the anchor before it."""
        anchors, instant = self._anchors, float(self.time[lane])
        before = int(np.searchsorted([a.instant for a in anchors], instant, side="right")) - 1
        start = anchors[before]
        local = follow(self.solver, start, instant, self.span, (instant - start.instant) / 2)
        if local.status != Status.OK:
            self.status[lane], self.faults[lane] = local.status, local.fault
        elif len(local.anchors) > 1:
            self.status[lane] = local.anchors[-1].status
            self.faults.pop(lane)
            self._keep(slice(lane, lane + 1), local.anchors[-1].state)

    def _bridge(self, point: Passage) -> None:
        """Replace the instants next to a change point, and the one at it, by what the motion on both sides gives."""
        away = np.abs(self.time - point.instant)
        lanes = np.flatnonzero((away < half_width(point, self.solver.order)) & (self.time < self.path.ended_at))
        if not lanes.size:
            return
        state = bridged(self.solver, self.path, point, self.time[lanes])
        if state is None:
            self._refuse(away < spoiled_width(point, self.solver.order))
            return
        solved = self.status[lanes] == Status.OK
        names = self.solver.model.pose_type.predictor
        apart = [np.abs(state[0][name][0] - self._store[0][name][0][..., lanes])[..., solved] for name in names]
        if max(np.max(x, initial=0.0) for x in apart) > LARGEST_DISAGREEMENT:
            self._refuse(away < spoiled_width(point, self.solver.order))
            return
        self.status[lanes] = Status.OK
        for lane in lanes.tolist():
            self.faults.pop(lane, None)
        self._keep(lanes, (*state, self._store[2][lanes]))

    def _refuse(self, lanes: Bool[np.ndarray, " time"]) -> None:
        self.status[lanes & (self.status == Status.OK)] = Status.SINGULAR

    def _explain_end(self, lost: int) -> None:
        """Say at the first instant that was not reached why the motion could not be followed to it."""
        path, instant = self.path, self.time[lost : lost + 1]
        self.status[lost], self.faults[lost] = path.status, path.fault
        last = path.anchors[-1]
        arrival = self.solver(self.solver.needed(last.state), instant - last.instant, instant)
        if arrival.status[0] == Status.INADMISSIBLE:  # the fault is the law's, not that of the position before
            self.status[lost], self.faults[lost] = Status.INADMISSIBLE, self.solver.fault(arrival, 0)


def _with_room(count: int, *arrays: np.ndarray) -> np.ndarray:
    """Return arrays one after another along the last axis, behind room for as many lanes as asked for."""
    parts = np.concatenate(arrays, axis=-1)
    whole = np.zeros((*parts.shape[:-1], count + parts.shape[-1]))
    whole[..., count:] = parts
    return whole


def _lots(count: int, width: int, most: int, threads: int) -> int:
    """Return how many lots go into a call, so that all threads have as many of them to solve."""
    lots = -(-count // width)
    rounds = -(-lots // (most * threads))
    return max(1, -(-lots // (rounds * threads))) if lots else 1


def _slice_of(indices: Indices) -> slice | Indices:
    """Return evenly spaced indices as a slice, with which NumPy copies several times faster."""
    first, last = int(indices[0]), int(indices[-1])
    step = (last - first) // (len(indices) - 1) if len(indices) > 1 else 1
    if step > 0 and np.array_equal(indices, np.arange(first, last + 1, step)):
        return slice(first, last + 1, step)
    return indices


def _levels(left: Bool[np.ndarray, " time"], anchors: int, width: int) -> list[tuple[Indices, int | None]]:
    """Return the instants of each level, with the distance in the grid of the neighbour that each is predicted from.

    The first level starts from the anchors, and fills at least one batch. Where few instants are left, it is the only
    one.
    """
    count, stride = len(left), 1
    if np.count_nonzero(left) <= FEW_BATCHES * width:
        return [(np.flatnonzero(left), None)]
    while count // (2 * stride) >= max(2 * anchors, width):
        stride *= 2
    levels: list[tuple[Indices, int | None]] = [(np.arange(0, count, stride), None)]
    while stride > 1:
        half = stride // 2
        levels.append((np.arange(half, count, stride), half))
        stride = half
    return [(level[left[level]], distance) for level, distance in levels]
