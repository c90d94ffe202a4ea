"""Following a motion from anchor to anchor: steps that no singular position hides in, checked one by one.

Two things limit a step. The Taylor series must carry it: no term moves a body far. And the Jacobian must not come near
a singular one on the way, where branches meet and a series that looks smooth may lead over to another: `advance` tells
where its determinant vanishes next, to first order, and a step goes only part of that way. Towards a dead point steps
become shorter and shorter, and the motion ends there; a near miss is followed through its sharp turn. Where the steps
shrink while the motion itself stays smooth, two branches cross: a change point. It is passed on the series that leads
through it, if that arrives on the other side to rounding, and is told.
"""

import dataclasses
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int, Shaped

from jounce.kinematics.advance import SAFE_FRACTION, Arrival, SolvedState, advance
from jounce.kinematics.device import on_processor
from jounce.kinematics.status import Status
from jounce.mechanism import Model
from jounce.mechanism.axis_angles import AttitudeHistory

PASSABLE = (Status.OK, Status.UNDEFINED)
SMALLEST_STEP = 1e-10  # of the span
LARGEST_TURNOVER = 1.0  # of the Jacobian over a step, seen from its end; from its start, SAFE_FRACTION
PASSAGE = 3e-3  # of the radius of the series: so near a singular position it is seen whether the motion is smooth there
PASSAGE_ORDER = 4  # of the series that leads through: rounding spoils higher derivatives near a singular position
PASSAGE_DEVIATION = 1e-8  # from that series, as a part of the way: two branches a gap of g apart deviate by (g / way)^2
CRAWLING = 1e-6  # of what is left of the motion: steps this short, and for so many anchors,
LONGEST_CRAWL = 300  # are no sharp turn, which takes a few dozen, but a law that grows beyond all bounds
NEARLY_SINGULAR = 1e-6  # of the span: a motion that ends so short before a singular position ends at it
NEARBY = 0.1  # radii: a singular position nearer than this spoils high derivatives, if the motion is smooth there
PLACES = 8  # in each step at which attitudes are looked at for turns: nowhere between them a body turns by half a turn
SMALL_BATCH, LARGE_BATCH = 16, 512  # lanes; a batch width compiles once, so a short grid uses one, and so do anchors
GPU_BATCH = 2**15  # the large one of a GPU


def large_batch() -> int:
    """Return how many instants of a long grid are solved side by side on the device that JAX computes on."""
    return LARGE_BATCH if on_processor() else GPU_BATCH


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
        width = SMALL_BATCH if lanes <= SMALL_BATCH else large_batch()
        filled = jax.tree.map(lambda x: _filled(x, width), (*self._predictor(known), step, instant))
        arrival = advance(
            self.model.system,
            *filled,
            self.tolerance,
            self.refine,
            survey,
            self.wanted,
            pose_type=self.model.pose_type,
            order=self.order,
        )
        return jax.tree.map(lambda x: np.asarray(x)[..., :lanes], arrival)

    def fault(self, arrival: Arrival, lane: int) -> str:
        """Return where to look for the fault: a driver without a permitted value, an output, the farthest body."""
        refused = np.flatnonzero(~arrival.admissible[:, lane])
        if refused.size:
            return ", ".join(self.model.drivers[k] for k in refused)
        if arrival.status[lane] == Status.UNDEFINED and arrival.finite[0, lane]:
            names = [name for group in self.model.outputs for name in group]
            return f"output {names[int(np.argmin(arrival.finite[1:, lane]))]}"
        return f"body {self.model.bodies[int(arrival.body[lane])]}"

    def _predictor(self, known: SolvedState) -> SolvedState:
        """Return what a prediction needs of solved instants: jets of the pose and of turning angles, and the sign."""
        coordinates, outputs, sign = known
        angles = [o for o, g in zip(outputs, self.model.system.outputs, strict=True) if g.element.turning]
        return {name: coordinates[name] for name in self.model.pose_type.predictor}, tuple(angles), sign


def _filled(x: Shaped[np.ndarray, "*rest batch"], width: int) -> Shaped[np.ndarray, "*rest width"]:
    """Repeat the last lane up to the width of a batch."""
    lanes = x.shape[-1]
    if lanes == width:
        return x
    filled = np.empty((*x.shape[:-1], width), x.dtype)
    filled[..., :lanes], filled[..., lanes:] = x, x[..., -1:]
    return filled


@dataclasses.dataclass(frozen=True)
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
        return 1 / abs(self.turnover) if self.turnover else np.inf

    @property
    def longest_step(self) -> float:
        """Longest step from here, s."""
        return min(self.safe_step, SAFE_FRACTION * self.reach)


@dataclasses.dataclass(frozen=True)
class ChangePoint:
    """A singular position that a motion passes smoothly: when, s, and the radius of its Taylor series there, s."""

    instant: float
    radius: float


@dataclasses.dataclass
class FollowedPath:
    """Anchors in order of time, the change points passed, and where and why following the motion ended, if it did.

    Instants of a grid that were solved on the way are told by their indices, each with the batch that it was solved in.
    """

    anchors: list[Anchor]
    on_the_way: list[tuple[Int[np.ndarray, " lane"], Arrival]] = dataclasses.field(default_factory=list)
    change_points: list[ChangePoint] = dataclasses.field(default_factory=list)
    status: Status = Status.OK
    ended_at: float = np.inf
    fault: str = ""

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


NO_GRID = np.empty(0)


def follow(
    solver: Solver,
    start: Anchor,
    stop: float,
    span: float,
    first_step: float = np.inf,
    grid: Float[np.ndarray, " time"] = NO_GRID,
) -> FollowedPath:
    """Follow the motion from an anchor to another instant, in steps checked one by one.

    A step that is refused is halved until it is not, or is too small to be halved. The lanes of a batch that a step
    leaves free solve the next instants of a grid on the way.

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
    path, largest, crawled = FollowedPath([start]), first_step, 0
    while path.anchors[-1].instant < stop:
        here = path.anchors[-1]
        passed = _passed(solver, here, stop)
        if passed is not None:
            far_side, change_point = passed
            path.anchors.append(far_side)
            path.change_points.append(change_point)
            continue
        left = stop - here.instant
        step = min(here.longest_step, largest, left)
        crawled = crawled + 1 if step < CRAWLING * left else 0
        if crawled > LONGEST_CRAWL or here.instant + step == here.instant:
            beyond = float(np.nextafter(here.instant, np.inf))
            return path.ended(Status.COLLAPSED, beyond, ", ".join(solver.model.drivers))
        if left - step < 0.1 * step:
            step = left  # no sliver of a step at the end
        taken = _taken(solver, here, stop, step, SMALLEST_STEP * span, grid)
        status = Status(int(taken.arrival.status[0]))
        if not taken.accepted:
            if status != Status.INADMISSIBLE and here.reach < NEARLY_SINGULAR * span:
                status = Status.SINGULAR  # the range of the motion ends at a dead point
            return path.ended(status, taken.target, solver.fault(taken.arrival, 0))
        largest = 4 * taken.step
        path.anchors.append(Anchor.of(taken.arrival, taken.target))
        if taken.lanes.size:
            path.on_the_way.append((taken.lanes, taken.arrival))
    return path


class _Step(NamedTuple):
    """A step from an anchor: where it led, how long it was, which instants of the grid were solved beside it."""

    arrival: Arrival
    target: float
    step: float
    lanes: np.ndarray
    accepted: bool


def _taken(
    solver: Solver, here: Anchor, stop: float, step: float, smallest: float, grid: Float[np.ndarray, " time"]
) -> _Step:
    """Return the step from an anchor, halved until it is accepted, or too small to be halved.

    Of one that is not accepted, what is told is where a law was first refused, if it was.
    """
    refused, left = None, stop - here.instant
    while True:
        target = stop if step == left else here.instant + step
        first, end = np.searchsorted(grid, (here.instant, target), side="right")
        lanes = np.arange(first, min(end, first + SMALL_BATCH - 1))
        instants = np.concatenate([[target], grid[lanes]])
        arrival = solver(here.state, instants - here.instant, instants, survey=True)
        if arrival.status[0] in PASSABLE and step * abs(arrival.turnover[0]) <= LARGEST_TURNOVER:
            return _Step(arrival, target, step, lanes, accepted=True)
        if arrival.status[0] == Status.INADMISSIBLE:
            refused = refused or (arrival, target)
        if step < smallest or target <= here.instant:
            return _Step(*(refused or (arrival, target)), step, lanes, accepted=False)
        step *= 0.5


def _passed(solver: Solver, here: Anchor, stop: float) -> tuple[Anchor, ChangePoint] | None:
    """Return the anchor beyond a change point just ahead, as far from it as this one is, if there is one to pass.

    The far side must lie on the series that leads there, to rounding, and the Jacobian must leave the singular position
    as fast as it came near: two branches that only come near each other, and a dead point, do neither.
    """
    if not (here.turnover < 0 and here.reach < PASSAGE * here.radius):
        return None
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
