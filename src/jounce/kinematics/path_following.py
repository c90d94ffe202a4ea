"""Following a motion from anchor to anchor: steps that no singular position hides in, checked one by one.

A leg makes the steps that are in the ordinary (see `legs`). Towards a dead point steps become shorter and shorter, and
the motion ends there; a near miss is followed through its sharp turn. Where the steps shrink while the motion itself
stays smooth, two branches cross: a change point. It is passed on the series that leads through it, if that arrives on
the other side to rounding, and is told.
"""

import bisect
import dataclasses
import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import jax
import numpy as np
from jaxtyping import Float, Int, Shaped

from jounce.kinematics.advance import LARGEST_GAP, Arrival, SolvedState, advance, predictor
from jounce.kinematics.device import on_processor
from jounce.kinematics.legs import Ending, Leg, Limits, Place, Settings, Way, leg
from jounce.kinematics.status import Status
from jounce.mechanism import Model
from jounce.mechanism.axis_angles import AttitudeHistory
from jounce.mechanism.system import System

PASSABLE = (Status.OK, Status.UNDEFINED)
SMALLEST_STEP = 1e-10  # of the span
PASSAGE_ORDER = 4  # of the series that leads through: rounding spoils higher derivatives near a singular position
PASSAGE_DEVIATION = 1e-8  # from that series, as a part of the way: two branches a gap of g apart deviate by (g / way)^2
NEARLY_SINGULAR = 1e-6  # of the span: a motion that ends so short before a singular position ends at it
NEARBY = 0.1  # radii: a singular position nearer than this spoils high derivatives, if the motion is smooth there
PLACES = 8  # in each step at which attitudes are looked at for turns: nowhere between them a body turns by half a turn
SMALL_BATCH = 16  # lanes; a batch width compiles once, so a short grid uses one, and so do anchors
LARGE_BATCHES = 128, 512  # lanes of a long grid: as many as the cache holds, within these bounds
CACHED_ENTRIES = 2**16  # of the factors of a batch: half a megabyte
LONGEST_LEG = 32  # batches
LEG_ENTRIES = 2**19  # of what a leg keeps: a large mechanism has shorter ones
GPU_BATCH = 2**15  # the large one of a GPU
NO_GRID = np.empty(0)


def large_batch(system: System) -> int:
    """Return how many instants of a long grid are solved side by side: a power of two.

    On a processor so many that the factors of their Jacobians fit into the cache, on a GPU so many that they fill it.
    """
    if not on_processor():
        return GPU_BATCH
    entries = math.prod(system.shape if system.fronts is None else system.fronts.shape)
    least, most = LARGE_BATCHES
    return max(least, min(most, 2 ** int(math.log2(max(1, CACHED_ENTRIES // max(1, entries))))))


@dataclasses.dataclass(frozen=True)
class Solver:
    """A model with the settings under which it is solved."""

    model: Model
    order: int
    tolerance: float
    refine: bool = True
    wanted: int = 0  # highest derivative that must be finite

    def __call__(
        self,
        known: SolvedState,
        step: Float[np.ndarray, " batch"],
        instant: Float[np.ndarray, " batch"],
        *,
        survey: bool = False,
    ) -> Arrival:
        """Solve instants from known neighbours, as many as fit into a batch; `survey` looks for singular positions."""
        lanes = len(instant)
        if lanes <= SMALL_BATCH:
            known, step, instant = jax.tree.map(
                lambda x: _filled(x, SMALL_BATCH), (self._predictor(known), step, instant)
            )
            way = _way(known, (0.0,) * 4, away=step, instant=instant, planned=True)
            arrival = self._leg(way, NO_GRID, _limits(0.0, 0.0, 1), survey=survey).last
        else:
            filled = jax.tree.map(lambda x: _filled(x, self.large_batch), (*self._predictor(known), step, instant))
            settings = self._settings._replace(survey=np.asarray(survey))
            arrival = advance(self.model.system, *filled, *settings, pose_type=self.model.pose_type, order=self.order)
        return jax.tree.map(lambda x: np.asarray(x)[..., :lanes], arrival)

    def leg(self, way: Way, grid: Float[np.ndarray, " time"], stop: float, smallest: float) -> Leg:
        """Go on along a way with the next instants of a grid, as far as they fit; see `legs.leg`."""
        way = way._replace(next_up=np.zeros((), int))
        return self._leg(way, grid, _limits(stop, smallest, self._batches), survey=True)

    def way(self, start: "Anchor", largest: float, crawled: int = 0) -> Way:
        """Return the way that begins at an anchor, with a largest first step, s."""
        known = jax.tree.map(lambda x: _filled(x, SMALL_BATCH), self._predictor(start.state))
        place = start.instant, start.safe_step, start.radius, start.turnover
        return _way(known, place, largest=largest, crawled=crawled)

    @cached_property
    def large_batch(self) -> int:
        """How many instants of a long grid are solved side by side."""
        return large_batch(self.model.system)

    @cached_property
    def _batches(self) -> int:
        """How many batches a leg may have; static, so that each mechanism compiles one program."""
        entries = (self.order + 1) * SMALL_BATCH * sum(x.size for x in self.model.guess.values())
        return min(LONGEST_LEG, max(1, LEG_ENTRIES // entries))

    @cached_property
    def _settings(self) -> Settings:
        return Settings(*map(np.asarray, (self.tolerance, self.refine, True, self.wanted)))

    def _leg(self, way: Way, grid: Float[np.ndarray, " time"], limits: Limits, *, survey: bool) -> Leg:
        room = (self._batches + 1) * (SMALL_BATCH - 1)
        window = np.full(room, np.inf)
        window[: len(grid)] = grid[:room]
        settings, kind = self._settings._replace(survey=np.asarray(survey)), self.model.pose_type
        return leg(
            self.model.system, way, window, limits, settings, pose_type=kind, order=self.order, batches=self._batches
        )

    def fault(self, arrival: Arrival, lane: int) -> str:
        """Return where to look for the fault: a driver without a permitted value, an output, the farthest body."""
        refused = np.flatnonzero(~arrival.admissible[:, lane])
        if refused.size:
            return ", ".join(self.model.drivers[k] for k in refused)
        if arrival.status[lane] == Status.INCONSISTENT:
            return self._contradicting(np.asarray(arrival.gaps[..., lane]))
        if arrival.status[lane] == Status.UNDEFINED and arrival.finite[0, lane]:
            names = [name for group in self.model.outputs for name in group]
            return f"output {names[int(np.argmin(arrival.finite[1:, lane]))]}"
        return f"body {self.model.bodies[int(arrival.body[lane])]}"

    def _contradicting(self, gaps: Float[np.ndarray, "2 row"]) -> str:
        """Name the joints and drivers that contradict each other, and by how much they are open."""
        size, over = gaps
        names = dict.fromkeys(self.model.rows[k] for k in np.argsort(-over) if over[k] > 0.1 * over.max())
        wide = size.max()
        told = f"open by {wide:.2g} rad, or sizes of the mechanism" if wide > LARGEST_GAP else "in their rates"
        return f"{', '.join(list(names)[:4])} ({told})"

    def _predictor(self, known: SolvedState) -> SolvedState:
        return predictor(self.model.system, self.model.pose_type, known)


def _way(known: SolvedState, place: Sequence[float], **given: Any) -> Way:
    """Return a way that begins; of one type whatever is given, so that it is compiled once."""
    lanes, nothing, no = np.zeros(SMALL_BATCH), np.zeros(()), np.zeros((), bool)
    way = Way(
        known,
        Place(*map(np.asarray, place)),
        step=nothing,
        away=lanes,
        instant=lanes,
        planned=no,
        may_pass=~no,
        next_up=np.zeros((), int),
        largest=np.asarray(np.inf),
        crawled=np.zeros((), int),
        refused=np.asarray(np.nan),
        ending=np.zeros((), int),
    )
    return way._replace(**{name: np.asarray(value) for name, value in given.items()})


def _limits(stop: float, smallest: float, batches: int) -> Limits:
    return Limits(*map(np.asarray, (stop, smallest, batches)))


def _filled(x: Shaped[np.ndarray, "*rest batch"], width: int) -> Shaped[np.ndarray, "*rest width"]:
    """Repeat the last lane up to the width of a batch."""
    lanes = x.shape[-1]
    if lanes == width:
        return x
    filled = np.empty((*x.shape[:-1], width), x.dtype)
    filled[..., :lanes], filled[..., lanes:] = x, x[..., -1:]
    return filled


@dataclasses.dataclass(frozen=True, slots=True)
class Anchor:
    """A solved instant of a motion that is followed, and how far it may be followed from there.

    Parameters
    ----------
    instant : float
        s.
    state : tuple
        Jets of the coordinates and of the outputs, and the sign of the determinant of the Jacobian.
    safe_step, radius : float
        How far the Taylor series carries, s: with all its terms, and with the first three where its terms grow to one.
    turnover : float
        Rate at which the Jacobian nears a singular one (below zero) or leaves it, 1/s.
    status : Status
        OK, or UNDEFINED, where an output has no finite value: the motion goes on there.
    """

    instant: float
    state: SolvedState
    safe_step: float
    radius: float
    turnover: float
    status: Status

    @classmethod
    def of(cls, arrival: Arrival, instant: float) -> "Anchor":
        """Build the anchor from the first lane of a batch that was surveyed."""
        safe_step, radius, turnover = (float(x[0]) for x in (arrival.safe_step, arrival.radius, arrival.turnover))
        return cls(float(instant), arrival.state(slice(1)), safe_step, radius, turnover, Status(int(arrival.status[0])))

    @property
    def reach(self) -> float:
        """Time to or from the nearest singular position, to first order, s."""
        return 1 / abs(self.turnover) if abs(self.turnover) > 0 else np.inf


def _instant(anchor: Anchor) -> float:
    return anchor.instant


@dataclasses.dataclass(frozen=True)
class ChangePoint:
    """A singular position that a motion passes smoothly: when, s, and the radius of its Taylor series there, s."""

    instant: float
    radius: float


@dataclasses.dataclass
class FollowedPath:
    """Anchors in order of time, the change points passed, and where and why following the motion ended, if it did.

    Instants of a grid that were solved on the way are told by their indices, with their states.
    """

    anchors: list[Anchor]
    on_the_way: list[tuple[Int[np.ndarray, " lane"], SolvedState]] = dataclasses.field(default_factory=list)
    change_points: list[ChangePoint] = dataclasses.field(default_factory=list)
    status: Status = Status.OK
    ended_at: float = np.inf
    fault: str = ""

    def add(self, done: Leg, first: int) -> None:
        """Add the anchors of a leg, and the instants of the grid that it solved, which begin with the first."""
        count = int(done.count)
        records = jax.tree.map(lambda x: np.asarray(x)[:count], done.records)
        leaves, structure = jax.tree.flatten((records.coordinates, records.outputs, records.sign))
        steps = np.flatnonzero(records.taken)
        taken = [x[steps, ..., :1] for x in leaves]  # copies: an anchor is kept for long, the other lanes are not
        for number, k in enumerate(steps.tolist()):
            state = jax.tree.unflatten(structure, [x[number] for x in taken])
            instant, safe_step, radius, turnover = (float(x[k]) for x in records.place)
            status = Status(int(records.status[k, 0]))
            self.anchors.append(Anchor(instant, state, safe_step, radius, turnover, status))
        solved = (records.lane >= 0) & (records.status == Status.OK)
        if solved.any():
            found = [np.moveaxis(x, 0, -2)[..., solved] for x in leaves]
            self.on_the_way.append((first + records.lane[solved], jax.tree.unflatten(structure, found)))

    def anchors_around(self, first: float, last: float) -> list[Anchor]:
        """Return the anchors between two instants, with one before them and one after, where there are some."""
        begin = bisect.bisect_right(self.anchors, first, key=_instant) - 1
        end = bisect.bisect_left(self.anchors, last, key=_instant)
        return self.anchors[max(min(begin, len(self.anchors) - 1), 0) : end + 1]

    def history(self) -> AttitudeHistory | None:
        """Return the attitudes of all bodies in space along the motion: at the anchors, and by their series beyond."""
        if "quaternion" not in self.anchors[0].state[0]:
            return None
        times = np.array([anchor.instant for anchor in self.anchors])
        series = np.concatenate([anchor.state[0]["quaternion"] for anchor in self.anchors], axis=-1)[..., None]
        series = np.where(np.isfinite(series), series, 0.0)
        since = np.diff(times, append=times[-1])[:, None] * (np.arange(PLACES) / PLACES)
        place = np.zeros((*series.shape[1:-1], PLACES))
        for coefficient in series[::-1]:
            place = place * since + coefficient
        count = (len(times) - 1) * PLACES + 1  # the last anchor is the end
        place = place.reshape(*place.shape[:2], -1)[..., :count]
        return AttitudeHistory(place, (times[:, None] + since).ravel()[:count])

    def ended(self, status: Status, instant: float, fault: str) -> "FollowedPath":
        """Return the path, with where and why it could not be followed any further."""
        self.status, self.ended_at, self.fault = status, instant, fault
        return self

    def singular_positions_outside(self) -> list[ChangePoint]:
        """Return where the motion would be singular just before its start or after its end, and smooth all the same."""
        first, last = self.anchors[0], self.anchors[-1]
        found = [
            ChangePoint(anchor.instant + sense * anchor.reach, anchor.radius)
            for anchor, sense in ((first, -1), (last, 1))
            if sense * anchor.turnover < 0 and anchor.reach < NEARBY * anchor.radius
        ]
        return found if self.status == Status.OK else found[:1]


def follow(
    solver: Solver,
    start: Anchor,
    stop: float,
    span: float,
    first_step: float = np.inf,
    grid: Float[np.ndarray, " time"] = NO_GRID,
) -> FollowedPath:
    """Follow the motion from an anchor to another instant, in steps checked one by one.

    Parameters
    ----------
    solver : Solver
        What solves an instant from another.
    start : Anchor
        Where to begin.
    stop : float
        Instant to arrive at, s.
    span : float
        Duration of the whole motion, by which steps are too small, s.
    first_step : float, optional
        Longest first step, s.
    grid : array of shape (time,), optional
        Instants to be solved on the way, s.
    """
    path, way = FollowedPath([start]), solver.way(start, first_step)
    before, first = (int(np.searchsorted(grid, start.instant, side=side)) for side in ("left", "right"))
    if first > before and start.status == Status.OK:
        path.on_the_way.append((np.arange(before, first), start.state))
    while path.anchors[-1].instant < stop:
        done = solver.leg(way, grid[first:], stop, SMALLEST_STEP * span)
        path.add(done, first)
        way, here = jax.tree.map(np.asarray, done.way), path.anchors[-1]
        ending = int(way.ending)
        first += int(way.next_up)
        if ending == Ending.PASSAGE:
            passed = _passed(solver, here, stop)
            if passed is None:
                no = np.zeros((), bool)
                way = way._replace(planned=no, may_pass=no, ending=np.asarray(int(Ending.UNFINISHED)))
                continue
            far_side, change_point = passed
            path.anchors.append(far_side)
            path.change_points.append(change_point)
            way = solver.way(far_side, float(way.largest), int(way.crawled))
            first = int(np.searchsorted(grid, far_side.instant, side="right"))
        elif ending == Ending.COLLAPSED:
            beyond = float(np.nextafter(here.instant, np.inf))
            return path.ended(Status.COLLAPSED, beyond, ", ".join(solver.model.drivers))
        elif ending == Ending.REFUSED:
            return _ended(solver, path, done, span)
    return path


def _ended(solver: Solver, path: FollowedPath, done: Leg, span: float) -> FollowedPath:
    """Return the path that cannot be followed any further: where a law was first refused, if it was."""
    here, refused = path.anchors[-1], float(done.way.refused)
    if np.isnan(refused):
        target, arrival = float(done.way.instant[0]), jax.tree.map(np.asarray, done.last)
    else:
        target, instant = refused, np.array([refused])
        arrival = solver(here.state, instant - here.instant, instant, survey=True)
    status = Status(int(arrival.status[0]))
    if status != Status.INADMISSIBLE and here.reach < NEARLY_SINGULAR * span:
        status = Status.SINGULAR  # the range of the motion ends at a dead point
    return path.ended(status, target, solver.fault(arrival, 0))


def _passed(solver: Solver, here: Anchor, stop: float) -> tuple[Anchor, ChangePoint] | None:
    """Return the anchor beyond a change point just ahead, as far from it as this one is, if there is one to pass.

    The far side must lie on the series that leads there, to rounding, and the Jacobian must leave the singular position
    as fast as it came near: two branches that only come near each other, and a dead point, do neither.
    """
    middle = here.instant + here.reach
    target = min(middle + here.reach, stop)
    if target - middle < 0.2 * here.reach:
        return None  # the motion stops before
    coordinates, outputs, sign = here.state
    shortened = jax.tree.map(_shortened, (coordinates, outputs))
    known = (*shortened, np.zeros_like(sign))  # the sign may change
    arrival = solver(known, np.array([target - here.instant]), np.array([target]), survey=True)
    beyond = Anchor.of(arrival, target)
    if arrival.status[0] not in PASSABLE or not arrival.deviation[0] <= PASSAGE_DEVIATION:
        return None
    if not (beyond.turnover > 0 and abs(beyond.reach - (target - middle)) <= 0.5 * (target - middle)):
        return None
    located = 0.5 * (middle + target - beyond.reach)  # what each side errs by cancels to the second order
    return beyond, ChangePoint(located, min(here.radius, beyond.radius))


def _shortened(jet: Float[np.ndarray, "order *rest"]) -> Float[np.ndarray, "order *rest"]:
    """Return Taylor coefficients with those above a low order set to zero."""
    low = jet.copy()
    low[PASSAGE_ORDER + 1 :] = 0
    return low
