"""Following a motion: anchors in sequence by safe steps, then all instants of the grid in batches.

A long grid is not solved one instant after another. A few anchors are, at steps that the Taylor series of the last
anchor calls safe; the instants of the grid then start from their nearest anchor, in levels that halve the spacing, so
that most are predicted to rounding by an instant solved before and all of a level are solved together.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from jounce.kinematics.advance import Arrival, advance
from jounce.kinematics.status import Status
from jounce.mechanism import Model

SMALLEST_STEP = 1e-10  # of the span
NEARLY_SINGULAR_PIVOT = 1e-3  # where the steps had to become smallest
SMALL_BATCH, LARGE_BATCH, LONG_GRID = 64, 512, 1024  # lanes; a batch width compiles once, so a short grid uses one


@dataclasses.dataclass(frozen=True)
class Solver:
    """A model with the settings under which it is solved."""

    model: Model
    order: int
    tolerance: float
    refine: bool = True

    def __call__(self, known: Any, step: np.ndarray, instant: np.ndarray) -> Arrival:
        """Solve instants from known neighbours, as many as fit into a batch."""
        lanes = len(instant)
        width = SMALL_BATCH if lanes <= SMALL_BATCH else LARGE_BATCH
        filled = jax.tree.map(lambda x: _filled(x, width), (*self._predictor(known), step, instant))
        arrival = advance(
            self.model.system,
            *filled,
            self.tolerance,
            self.refine,
            pose_type=self.model.pose_type,
            order=self.order,
        )
        return jax.tree.map(lambda x: np.asarray(x)[..., :lanes], arrival)

    def culprit(self, arrival: Arrival, lane: int) -> str:
        """Return where to look for the fault: a driver without a permitted value, or the body farthest astray."""
        refused = np.flatnonzero(~arrival.admissible[:, lane])
        if refused.size:
            return ", ".join(self.model.drivers[k] for k in refused)
        return f"body {self.model.bodies[int(arrival.body[lane])]}"

    def _predictor(self, known: Any) -> tuple[dict[str, Any], tuple[Any, ...]]:
        """Return what a prediction needs of solved instants: the jets of the pose and of turning angles."""
        coordinates, outputs = known
        angles = [o for o, g in zip(outputs, self.model.system.outputs, strict=True) if g.element.turning]
        return {name: coordinates[name] for name in self.model.pose_type.predictor}, tuple(angles)


def _filled(x: np.ndarray, width: int) -> np.ndarray:
    """Repeat the last lane up to the width of a batch."""
    missing = width - x.shape[-1]
    return np.pad(x, [(0, 0)] * (x.ndim - 1) + [(0, missing)], mode="edge") if missing else x


@dataclasses.dataclass
class Track:
    """Solved instants, in order of time, and where and why following the motion ended early, if it did."""

    instants: list[float]
    states: list[Any]
    safe_step: float
    pivot_ratio: float = 1.0
    status: Status = Status.OK
    ended_at: float = np.inf
    culprit: str = ""


def follow(solver: Solver, start: Track, stop: float, span: float) -> Track:
    """Follow the motion from the last instant of a track to another instant, in safe steps, checked one by one.

    A step whose solution departs from its prediction is halved until it does not, or is too small to be halved.
    """
    track = Track(start.instants[-1:], start.states[-1:], start.safe_step)
    now, largest = track.instants[0], np.inf
    while now < stop:
        step = min(track.safe_step, largest, stop - now)
        if stop - now - step < 0.1 * step:
            step = stop - now  # no sliver of a step at the end
        refused = None
        while True:
            target = stop if step == stop - now else now + step
            arrival = solver(track.states[-1], np.array([target - now]), np.array([target]))
            if arrival.status[0] == Status.OK:
                break
            if arrival.status[0] == Status.INADMISSIBLE:
                refused = refused or (arrival, target)
            if step < SMALLEST_STEP * span or target <= now:
                arrival, target = refused or (arrival, target)
                track.status, track.ended_at = Status(int(arrival.status[0])), target
                track.culprit = solver.culprit(arrival, 0)
                if refused is None and track.pivot_ratio < NEARLY_SINGULAR_PIVOT:
                    track.status = Status.SINGULAR  # the range of the motion ends at a dead point
                return track
            step *= 0.5
        largest, now = 4 * step, target
        track.instants.append(now)
        track.states.append((arrival.coordinates, arrival.outputs))
        track.safe_step, track.pivot_ratio = float(arrival.safe_step[0]), float(arrival.pivot_ratio[0])
    return track


class Grid:
    """All instants of a time grid, solved from the anchors of a track.

    Attributes
    ----------
    status : array of int, shape (time,)
    culprits : dict of int to str
        For instants that failed, the body farthest from its prediction, or the driver without a permitted value.
    """

    def __init__(self, solver: Solver, track: Track, time: np.ndarray):
        self.solver, self.track, self.time = solver, track, time
        self.status = np.full(len(time), int(Status.NOT_REACHED))
        self.culprits: dict[int, str] = {}
        anchors = np.array(track.instants)
        self._instants = np.concatenate([time, anchors])
        self._nearest = len(time) + _nearest(anchors, time)
        self._store = jax.tree.map(
            lambda *xs: np.concatenate([np.zeros((*xs[0].shape[:-1], len(time))), *xs], axis=-1), *track.states
        )

    @property
    def state(self) -> tuple[dict[str, Any], tuple[Any, ...]]:
        """Jets of the coordinates and of the outputs, time last."""
        return jax.tree.map(lambda x: x[..., : len(self.time)], self._store)

    def solve(self, progress: Callable[[int, int], None] | None) -> None:
        """Solve level after level; an instant that its neighbour cannot predict is followed to from an anchor."""
        count = len(self.time)
        reached = self.time < self.track.ended_at
        width = LARGE_BATCH if count > LONG_GRID else SMALL_BATCH
        done = 0
        for level, distance in _levels(count, len(self.track.instants), width):
            lanes = level[reached[level]]
            source = self._nearest[lanes]
            if distance is not None:
                source = np.where(self.status[lanes - distance] == Status.OK, lanes - distance, source)
            for first in range(0, len(lanes), width):
                self._solve_batch(lanes[first : first + width], source[first : first + width])
                done += min(width, len(lanes) - first)
                if progress is not None:
                    progress(done, count)
        if not reached.all():
            self._explain_end(int(np.argmin(reached)))
        if progress is not None and done < count:
            progress(count, count)

    def _solve_batch(self, lanes: np.ndarray, source: np.ndarray) -> None:
        chosen = _slice_of(source)
        known = jax.tree.map(lambda x: x[..., chosen], self._store)
        arrival = self.solver(known, self.time[lanes] - self._instants[source], self.time[lanes])
        self.status[lanes] = arrival.status
        self._keep(_slice_of(lanes), (arrival.coordinates, arrival.outputs))
        for k in np.flatnonzero(arrival.status != Status.OK).tolist():
            self.culprits[int(lanes[k])] = self.solver.culprit(arrival, k)
            self._rescue(int(lanes[k]))

    def _keep(self, lanes: Any, state: Any) -> None:
        def put(whole: np.ndarray, part: np.ndarray) -> None:
            whole[..., lanes] = part

        jax.tree.map(put, self._store, state)

    def _rescue(self, lane: int) -> None:
        """Follow the motion to one instant from the anchor before it."""
        track, instant = self.track, float(self.time[lane])
        anchor = int(np.searchsorted(track.instants, instant, side="right")) - 1
        start = Track([track.instants[anchor]], [track.states[anchor]], (instant - track.instants[anchor]) / 2)
        local = follow(self.solver, start, instant, track.instants[-1] - self.time[0])
        if local.status != Status.OK:
            self.status[lane], self.culprits[lane] = local.status, local.culprit
        elif len(local.states) > 1:
            self.status[lane] = Status.OK
            self.culprits.pop(lane)
            self._keep(slice(lane, lane + 1), local.states[-1])

    def _explain_end(self, lost: int) -> None:
        """Say at the first instant that was not reached why the motion could not be followed to it."""
        track, instant = self.track, self.time[lost : lost + 1]
        self.status[lost], self.culprits[lost] = track.status, track.culprit
        arrival = self.solver(track.states[-1], instant - track.instants[-1], instant)
        if arrival.status[0] == Status.INADMISSIBLE:  # the fault is the law's, not that of the position before
            self.status[lost], self.culprits[lost] = Status.INADMISSIBLE, self.solver.culprit(arrival, 0)


def _slice_of(indices: np.ndarray) -> Any:
    """Return evenly spaced indices as a slice, with which NumPy copies several times faster."""
    first, last = int(indices[0]), int(indices[-1])
    step = (last - first) // (len(indices) - 1) if len(indices) > 1 else 1
    if step > 0 and np.array_equal(indices, np.arange(first, last + 1, step)):
        return slice(first, last + 1, step)
    return indices


def _nearest(anchors: np.ndarray, time: np.ndarray) -> np.ndarray:
    after = np.clip(np.searchsorted(anchors, time), 1, max(len(anchors) - 1, 1))
    if len(anchors) == 1:
        return np.zeros(len(time), int)
    return np.where(time - anchors[after - 1] <= anchors[after] - time, after - 1, after)


def _levels(count: int, anchors: int, width: int) -> list[tuple[np.ndarray, int | None]]:
    """Return the instants of each level, with the distance in the grid of the neighbour that each is predicted from.

    The first level starts from the anchors, and fills at least one batch.
    """
    stride = 1
    while count // (2 * stride) >= max(2 * anchors, width):
        stride *= 2
    levels: list[tuple[np.ndarray, int | None]] = [(np.arange(0, count, stride), None)]
    while stride > 1:
        half = stride // 2
        levels.append((np.arange(half, count, stride), half))
        stride = half
    return levels
