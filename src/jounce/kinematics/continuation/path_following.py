"""Continuation of a motion from anchor to anchor, in checked steps that pass no singular position unnoticed.

A run makes the ordinary steps (see `continuation_steps`). Toward a dead point steps become ever shorter, and the motion
ends there; after a near miss it is followed through its sharp turn. If steps shrink while the motion stays smooth, two
branches cross at a change point. The motion passes it along its series, provided that the series meets the far side to
rounding, and the change point is recorded.
"""

import bisect
import dataclasses
import itertools
from collections.abc import Sequence
from functools import partial
from operator import attrgetter
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.execution.backends import backend_of
from jounce.kinematics.continuation.anchors import (
    DOUBLE_ZERO,
    NEARBY,
    SIMPLE_ZERO,
    Anchor,
    ChangePoint,
    hidden_zero,
    multiplicity_ahead,
)
from jounce.kinematics.continuation.continuation_steps import StepState, TakenSteps
from jounce.kinematics.continuation.solver import NO_GRID, Solver
from jounce.kinematics.continuation.step_control import ExpansionPoint, StopReason
from jounce.kinematics.status import Status
from jounce.mechanism.transmissions.axis_angles import AttitudeHistory

OK = int(Status.OK)  # NumPy takes long to compare with a member of an enumeration
PASSABLE = (OK, Status.UNDEFINED)
SMALLEST_STEP = 1e-10  # part of the span
PASSAGE_ORDER = 4  # of the series through a change point; rounding spoils higher derivatives near it
PASSAGE_DEVIATION = 1e-8  # relative: two branches separated by a gap g deviate from that series by (g / distance)^2
NEARLY_SINGULAR = 1e-6  # part of the span: a motion that stops this close to a singular position ends at it
TOUCH_DEVIATION = 2e-5  # the same at a double zero, where rounding is larger, and a gap deviates by (g / distance^2)^2
TOUCHING = 1e-3  # radii: nearer to a multiple zero, positions are as uncertain as the branches are far apart
LEAST_PASSAGE = 0.2  # part of the distance to a change point by which the motion must continue beyond it
INSTANT = attrgetter("instant")  # of an anchor
SAMPLES_A_STEP = 8  # attitudes per step for counting turns: no body turns by half a turn between two of them


@dataclasses.dataclass
class FollowedPath:
    """Anchors in order of time, the change points passed, and the instant and cause of an early end.

    `is_solved` marks the grid instants that the steps have solved, `solved_leaves` has the leaves of their states, and
    `backends` names the backends used.
    """

    anchors: list[Anchor]
    is_solved: Bool[np.ndarray, " time"] = dataclasses.field(default_factory=lambda: np.zeros(0, bool))
    solved_leaves: list[np.ndarray] = dataclasses.field(default_factory=list)
    change_points: list[ChangePoint] = dataclasses.field(default_factory=list)
    status: Status = Status.OK
    ended_at: float = np.inf
    fault: str = ""
    hidden: ChangePoint | None = None  # multiple zero of the determinant at which the path ends
    backends: set[str] = dataclasses.field(default_factory=set)

    def add(self, result: TakenSteps, first: int) -> None:
        """Add the anchors of a run, and the grid instants that it solved, starting with index `first`."""
        (anchors, points, grid), steps, count = result.records, int(result.steps), int(result.run.next_up)
        self.backends.add(backend_of(anchors.status))
        leaves, structure = jax.tree.flatten(anchors[:3])
        states = [np.array(np.asarray(x)[..., :steps]) for x in leaves]  # copies, which do not keep the records alive
        values, passed_status = [np.asarray(x)[:steps].tolist() for x in (*points, anchors.status)], Status.OK
        for lane, (instant, safe_step, radius, det_rate, status) in enumerate(zip(*values, strict=True)):
            outcome = passed_status if status == OK else Status(status)
            self.anchors.append(Anchor(instant, states, lane, structure, safe_step, radius, det_rate, outcome))
        if not count:
            return
        parts, lanes = [np.asarray(x)[..., :count] for x in jax.tree.leaves(grid[:3])], slice(first, first + count)
        self.solved_leaves = self.solved_leaves or [np.empty((*x.shape[:-1], len(self.is_solved))) for x in parts]
        self.is_solved[lanes] = np.asarray(grid.status)[:count] == OK
        for array, part in zip(self.solved_leaves, parts, strict=True):
            array[..., lanes] = part

    def anchors_around(self, first: float, last: float) -> list[Anchor]:
        """Return the anchors between two instants, with the one before and the one after, where they exist."""
        start = bisect.bisect_right(self.anchors, first, key=INSTANT) - 1
        end = bisect.bisect_left(self.anchors, last, key=INSTANT)
        return self.anchors[max(min(start, len(self.anchors) - 1), 0) : end + 1]

    def ended(self, status: Status, instant: float, fault: str) -> "FollowedPath":
        """End the path with a status, instant and fault."""
        self.status, self.ended_at, self.fault = status, instant, fault
        return self

    def ended_at_multiple_zero(self, first: int, grid: Float[np.ndarray, " time"], drivers: Sequence[str]) -> bool:
        """End the path at the first of its anchors, from an index on, at which rounding hides a multiple zero ahead."""
        for k in range(max(first, 2), len(self.anchors)):
            point = hidden_zero(self.anchors[k - 2 : k + 1])
            if point is not None:
                del self.anchors[k + 1 :]
                self.hidden, end = point, float(np.nextafter(self.anchors[k].instant, np.inf))
                self.is_solved[grid >= end] = False
                self.ended(Status.SINGULAR, end, ", ".join(drivers))
                return True
        return False

    def singular_positions_outside(self) -> list[ChangePoint]:
        """Return singular positions just before the start or just after the end that the motion would pass smoothly."""
        first = self.anchors[0]
        points = self._just_ahead() if self.status == Status.OK else [self.hidden] if self.hidden else []
        if _is_just_behind(first):
            points.append(ChangePoint(first.instant - first.reach, first.radius))
        return points

    def _just_ahead(self) -> list[ChangePoint]:
        """Return the singular position that the motion was approaching when it ended, as a list of at most one.

        Rounding spoils the data of anchors next to it, so an anchor farther off is used.
        """
        end, passed = self.anchors[-1].instant, self.change_points[-1].instant if self.change_points else -np.inf
        later = itertools.takewhile(lambda anchor: anchor.instant > passed, reversed(self.anchors))
        approaching = [x for x in later if x.det_rate < 0 and _is_just_beyond(x, end)]
        largest = max((x.radius for x in approaching), default=0.0)
        return [ChangePoint(x.instant + x.reach, x.radius) for x in approaching if x.radius >= 0.5 * largest][:1]


def history_of(anchors: Sequence[Anchor]) -> AttitudeHistory | None:
    """Return the attitudes of spatial bodies along a motion, by the series of its anchors; None in the plane."""
    if "quaternion" not in anchors[0].state[0]:
        return None
    times = np.array([anchor.instant for anchor in anchors])
    series = np.concatenate([anchor.state[0]["quaternion"] for anchor in anchors], axis=-1)
    interpolated = partial(attitudes_between, times, np.where(np.isfinite(series), series, 0.0))
    instants = within_steps(times, SAMPLES_A_STEP)
    return AttitudeHistory(interpolated(instants), instants, between=interpolated)


def _is_just_behind(point: "Anchor | ExpansionPoint") -> Any:
    """Return whether a singular position lies just behind an expansion point."""
    return (point.det_rate > 0) & (point.det_rate * point.radius > 1 / NEARBY)


def _is_just_ahead(point: "Anchor | ExpansionPoint") -> Any:
    """Return whether a singular position lies just ahead of an expansion point."""
    return (point.det_rate < 0) & (-point.det_rate * point.radius > 1 / NEARBY)


def _is_just_beyond(point: "Anchor | ExpansionPoint", end: float) -> Any:
    """Return whether a singular position lies just ahead, and the motion ends near or before it."""
    return _is_just_ahead(point) & ((end - point.instant) * -point.det_rate < 1 + LEAST_PASSAGE)


def is_next_to_singular(point: ExpansionPoint, is_start: Bool[np.ndarray, " lane"]) -> Bool[np.ndarray, " lane"]:
    """Return which motions come close to a singular position at an expansion point, or begin close behind one.

    This test is conservative: elsewhere no multiple zero ends a motion, and `singular_positions_outside` finds nothing.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of failed steps
        return is_start & _is_just_behind(point) | _is_just_ahead(point)


def follow(
    solver: Solver,
    start: Anchor | StepState,
    stop: float,
    span: float,
    first_step: float = np.inf,
    grid: Float[np.ndarray, " time"] = NO_GRID,
) -> FollowedPath:
    """Follow the motion from an anchor to another instant in checked steps.

    Parameters
    ----------
    solver : Solver
        Solver of the motion.
    start : Anchor or StepState
        A solved instant, or a run whose first batch solves the start; the path has no anchors if that fails.
    stop : float
        Final instant, s.
    span : float
        Duration of the whole motion, s, relative to which steps are too small.
    first_step : float, optional
        Longest first step from an anchor, s.
    grid : array of shape (time,), optional
        Instants to solve on the way, s, from the start on.
    """
    if isinstance(start, Anchor):
        path, run = FollowedPath([start]), solver.run_from(start.state, start.expansion_point, first_step)
    else:
        path, run = FollowedPath([]), start
    first, path.is_solved = 0, np.zeros(len(grid), bool)
    while not path.anchors or path.anchors[-1].instant < stop:
        result = solver.take_steps(run, grid[first:], stop, SMALLEST_STEP * span)
        known_count = len(path.anchors)
        path.add(result, first)
        if path.ended_at_multiple_zero(known_count, grid, solver.model.drivers):
            return path
        run = result.run
        if not path.anchors:
            arrival = jax.tree.map(np.asarray, result.last)
            return path.ended(Status(int(arrival.status[0])), float(run.instant[0]), solver.fault(arrival, 0))
        last = path.anchors[-1]
        control = run.control
        ending = int(control.ending)
        first += int(run.next_up)
        if ending == StopReason.PASSAGE:
            multiplicity = multiplicity_ahead(path.anchors)
            if multiplicity > SIMPLE_ZERO and last.reach < TOUCHING * last.radius:
                end = float(np.nextafter(last.instant, np.inf))
                path.hidden = ChangePoint(last.instant + 2 * last.reach, last.radius, 2)
                return path.ended(Status.SINGULAR, end, ", ".join(solver.model.drivers))
            passage = _far_side(solver, last, multiplicity, stop) if multiplicity <= DOUBLE_ZERO else None
            if passage is None:
                false = np.zeros((), bool)
                control = control._replace(may_pass=false, ending=np.asarray(int(StopReason.UNFINISHED)))
                run = run._replace(planned=false, control=control)
                continue
            far_side, change_point = passage
            path.anchors.append(far_side)
            path.change_points.append(change_point)
            run = solver.run_from(
                far_side.state, far_side.expansion_point, float(control.largest), int(control.crawled)
            )
            first = int(np.searchsorted(grid, far_side.instant, side="right"))
        elif ending == StopReason.COLLAPSED:
            end = float(np.nextafter(last.instant, np.inf))
            return path.ended(Status.COLLAPSED, end, ", ".join(solver.model.drivers))
        elif ending == StopReason.REFUSED:
            return _end_path(solver, path, result, span)
    return path


def _end_path(solver: Solver, path: FollowedPath, result: TakenSteps, span: float) -> FollowedPath:
    """End a path that cannot be continued, at the instant where a law was first refused, if any."""
    last, refused = path.anchors[-1], float(result.run.control.refused)
    if np.isnan(refused):
        target, arrival = float(result.run.instant[0]), jax.tree.map(np.asarray, result.last)
    else:
        target, instant = refused, np.array([refused])
        arrival = solver(solver.needed(last.state), instant - last.instant, instant, search=True)
    status = Status(int(arrival.status[0]))
    if status != Status.INADMISSIBLE and last.reach < NEARLY_SINGULAR * span:
        status = Status.SINGULAR  # the motion ends at a dead point
    return path.ended(status, target, solver.fault(arrival, 0))


def _far_side(solver: Solver, near_side: Anchor, estimate: float, stop: float) -> tuple[Anchor, ChangePoint] | None:
    """Return the anchor beyond a change point just ahead, and the change point; None if there is none to pass.

    The far anchor is as distant from the change point as this one. It must lie on the series to rounding, and the
    Jacobian must leave the singular position as fast as it approached it. Neither holds at a dead point, or where two
    branches only come close. The multiplicity of the zero of the determinant is one or two, by its `estimate`; where
    the motion turns back near the change point, a pair of zeros, real or complex, is as good as a double one.
    """
    multiplicity = 1 if estimate <= SIMPLE_ZERO else 2
    distance = multiplicity * near_side.reach
    middle = near_side.instant + distance
    target = min(middle + distance, stop)
    if target - middle < LEAST_PASSAGE * distance:
        return None  # the motion stops before
    coordinates, outputs, sign = near_side.state
    shortened = jax.tree.map(_shortened, (coordinates, outputs))
    source = (*shortened, np.zeros_like(sign) if multiplicity == 1 else sign)  # at a simple zero the sign may change
    arrival = solver(solver.needed(source), np.array([target - near_side.instant]), np.array([target]), search=True)
    far_side = Anchor.of(arrival, target)
    largest = PASSAGE_DEVIATION if multiplicity == 1 else TOUCH_DEVIATION
    if arrival.status[0] not in PASSABLE or not arrival.deviation[0] <= largest:
        return None
    distance_past = multiplicity * far_side.reach
    if not (far_side.det_rate > 0 and abs(distance_past - (target - middle)) <= 0.5 * (target - middle)):
        return None
    located = 0.5 * (middle + target - distance_past)  # first-order errors of the two sides cancel
    return far_side, ChangePoint(located, min(near_side.radius, far_side.radius), multiplicity)


def within_steps(times: Float[np.ndarray, " anchor"], count: int) -> Float[np.ndarray, " time"]:
    """Return `count` evenly spaced instants from each anchor to the next, and the last anchor."""
    offsets = np.diff(times)[:, None] * (np.arange(count) / count)
    return np.append((times[:-1, None] + offsets).ravel(), times[-1])


def attitudes_between(
    times: Float[np.ndarray, " anchor"],
    series: Float[np.ndarray, "order component bodies anchor"],
    instants: Float[np.ndarray, " time"],
) -> Float[np.ndarray, "component bodies time"]:
    """Return attitudes, or positions, at instants between anchors in order of time, by their series."""
    after = np.clip(np.searchsorted(times, instants, side="right"), 1, max(len(times) - 1, 1))
    return blended_attitudes(times, series, (after - 1, np.minimum(after, len(times) - 1)), instants)


def blended_attitudes(
    times: Float[np.ndarray, " anchor"],
    series: Float[np.ndarray, "order component bodies anchor"],
    neighbors: tuple[Int[np.ndarray, " time"], Int[np.ndarray, " time"]],
    instants: Float[np.ndarray, " time"],
) -> Float[np.ndarray, "component bodies time"]:
    """Return attitudes, or positions, at instants, blended from the series of the anchors before and after each.

    At a fraction s of the way between the two anchors, their errors grow as s^n and (1 - s)^n; each is weighted by the
    error of the other.
    """
    before, after = neighbors
    durations = times[after] - times[before]
    fractions = np.clip((instants - times[before]) / np.where(durations > 0, durations, 1.0), 0.0, 1.0)
    growth, decay = fractions ** len(series), (1.0 - fractions) ** len(series)
    blended = np.zeros((*series.shape[1:-1], len(instants)))
    for anchor, weight in ((before, decay / (decay + growth)), (after, growth / (decay + growth))):
        part = np.zeros_like(blended)
        for coefficient in series[::-1]:
            part = part * (instants - times[anchor]) + coefficient[..., anchor]
        blended += weight * part
    return blended


def _shortened(jet: Float[np.ndarray, "order *rest"]) -> Float[np.ndarray, "order *rest"]:
    """Return Taylor coefficients with those above `PASSAGE_ORDER` set to zero."""
    low = jet.copy()
    low[PASSAGE_ORDER + 1 :] = 0
    return low
