"""Many continuation steps of a motion in one compiled program, anchor to anchor, and the instants of a grid between.

Two things limit a step. The Taylor series must carry it: no term moves a body far. And the Jacobian must not come near
a singular one on the way, where branches meet and a series that looks smooth may lead over to another: `advance` tells
where its determinant vanishes next, to first order, and a step goes only part of that way. A step that is refused is
halved until it is not, or is too small to be halved. What is out of the ordinary ends the run and is decided outside.

The first lane of a batch makes the step; the others solve the next instants of the grid up to its end. Those that do
not fit into it are solved from the same anchor, in more batches, or from the next one if they are few.
"""

import enum
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.execution.compilation import compiled
from jounce.execution.mapped import called
from jounce.kinematics.continuation.correct_and_differentiate import (
    SAFE_FRACTION,
    SolvedState,
    StepResult,
    advance,
    predictor,
)
from jounce.kinematics.continuation.instant_program import finds_turnover
from jounce.kinematics.continuation.singularity_distance import turnover_at
from jounce.kinematics.status import Status
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose
from jounce.shapes import Numbers

LARGEST_TURNOVER = 1.0  # of the Jacobian over a step, seen from its end; from its start, SAFE_FRACTION
PASSAGE = 3e-3  # of the radius of the series: so near a singular position it is seen whether the motion is smooth there
CRAWLING = 1e-6  # of what is left of the motion: steps this short, and for so many anchors,
LONGEST_CRAWL = 300  # are no sharp turn, which takes a few dozen, but a law that grows beyond all bounds
SLIVER = 0.1  # of a step: the last one takes with it what is no longer than this
GROWTH = 4.0  # of a step over the last one

Number = Float[Numbers, ""]


class StopReason(enum.IntEnum):
    """Why a run ended."""

    UNFINISHED = 0  # it has made as many steps as it may
    ARRIVED = 1
    PASSAGE = 2  # a singular position is just ahead, and may be passed smoothly
    COLLAPSED = 3  # steps have become too small
    REFUSED = 4  # no step, however small, is accepted


class Settings(NamedTuple):
    """How exactly instants are solved; see `advance`."""

    tolerance: Number
    refine: Bool[Numbers, ""]
    survey: Bool[Numbers, ""]
    wanted: Int[Numbers, ""]


class Place(NamedTuple):
    """Where a motion has come to: the instant, s, and how far it may be followed from there; see `StepResult`."""

    instant: Number
    safe_step: Number
    radius: Number
    turnover: Number

    @property
    def reach(self) -> Any:
        """Time to or from the nearest singular position, to first order, s."""
        rate = jnp.abs(self.turnover)
        return jnp.where(rate > 0, 1 / jnp.where(rate > 0, rate, 1.0), jnp.inf)


class StepLimits(NamedTuple):
    """Where a run goes to, s; what step is too small to be halved, s; and the most batches that it may solve."""

    stop: Number
    smallest: Number
    batches: Int[Numbers, ""]


class StepState(NamedTuple):
    """How a run stands between two batches."""

    known: SolvedState  # what a prediction needs of the last anchor, in all lanes
    place: Place  # of the last anchor
    step: Number  # to be tried next, s; zero to solve the first instant itself
    away: Float[Numbers, " batch"]  # time from the last anchor that each lane is solved at, s
    instant: Float[Numbers, " batch"]  # when that is, s
    planned: Bool[Numbers, ""]  # whether they are decided
    may_pass: Bool[Numbers, ""]  # whether a singular position just ahead ends the run
    next_up: Int[Numbers, ""]  # among the instants of the grid
    largest: Number  # step that the last one allows, s
    crawled: Int[Numbers, ""]  # steps in sequence that were too short
    refused: Number  # instant at which a law had no permitted value, s; NaN if none
    ending: Int[Numbers, ""]  # see StopReason


class Records(NamedTuple):
    """What came of each batch, batches first; of a lane that solved an instant of the grid, which one, or -1."""

    coordinates: dict[str, Numbers]
    outputs: tuple[Numbers, ...]
    sign: Float[Numbers, "step batch"]
    status: Int[Numbers, "step batch"]
    lane: Int[Numbers, "step batch"]
    place: Place
    taken: Bool[Numbers, " step"]  # whether the first lane is the next anchor


class TakenSteps(NamedTuple):
    """What came of a run."""

    way: StepState
    records: Records
    last: StepResult  # the last batch
    count: Int[Numbers, ""]  # of batches solved


_batch = jax.jit(advance, static_argnames=("pose_type", "order"))  # traced once


def _calls_code(*_: Any, native: str | None, **__: Any) -> bool:
    """Tell whether batches are solved by machine code, and not within the program."""
    return native is not None


@compiled(
    *("pose_type", "order", "batches", "native"),
    narrow=True,
    alone=_calls_code,
    otherwise={"native": None},  # where there is no code for a run, XLA has none to call
)
def take_steps(
    system: System,
    way: StepState,
    grid: Float[Numbers, " time"],
    limits: StepLimits,
    settings: Settings,
    *,
    pose_type: type[Pose],
    order: int,
    batches: int,
    native: str | None = None,
) -> TakenSteps:
    """Go on along a way until it arrives, something is out of the ordinary, or enough batches are solved.

    Parameters
    ----------
    system : System
        The mechanism.
    way : StepState
        Where to go on from.
    grid : array of shape (time,)
        The next instants of the grid, s; infinite beyond the last. At least one batch more than can be solved.
    limits, settings
        See there.
    pose_type, order
        PlanarPose or SpatialPose; derivatives wanted.
    batches : int
        As many as there is room for.
    native : str, optional
        Name of the machine code that solves a batch, see `advance_instant`; unless it is given, the run does.
    """

    def solved(way: StepState) -> Any:
        if native is not None:
            tolerance, refine, survey, wanted = settings
            first = np.arange(len(way.instant)) == 0
            lanes = way.known, way.away, way.instant, survey & first
            arrival = called(native, (system, tolerance, refine, wanted), lanes)
            if finds_turnover(system):
                return arrival._replace(turnover=arrival.turnover[:1])
            there = partial(turnover_at, system, pose_type, arrival.coordinates, way.instant)
            return arrival._replace(turnover=jax.lax.cond(survey, there, lambda: jnp.zeros(1)))
        return _batch(system, *way.known, way.away, way.instant, *settings, pose_type=pose_type, order=order)

    def going(state: TakenSteps) -> Any:
        return (state.way.ending == int(StopReason.UNFINISHED)) & (state.count < limits.batches)

    def go_on(state: TakenSteps) -> TakenSteps:
        arrival = _typed(solved(state.way), blank)
        known = predictor(system, pose_type, (arrival.coordinates, arrival.outputs, arrival.sign))
        way, found = _after(state.way, arrival, known, grid, limits)
        put = jax.lax.dynamic_update_index_in_dim
        records = jax.tree.map(lambda xs, x: put(xs, x, state.count, 0), state.records, _typed(found, state.records))
        return TakenSteps(_typed(way, state.way), records, arrival, state.count + 1)

    shapes = jax.eval_shape(solved, way)
    blank = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
    yes, lanes, place = np.zeros((), bool), np.zeros(len(way.instant), int), Place(*map(np.asarray, np.zeros(4)))
    once = Records(shapes.coordinates, shapes.outputs, shapes.sign, shapes.status, lanes, place, yes)
    records = jax.tree.map(lambda x: jnp.zeros((batches, *x.shape), x.dtype), once)
    way = _typed(way, way)
    way = jax.lax.cond(way.planned, lambda: way, lambda: _typed(_planned(way, grid, limits), way))
    return jax.lax.while_loop(going, go_on, TakenSteps(way, records, blank, jnp.zeros((), int)))


def _typed(values: Any, like: Any) -> Any:
    """Return arrays of the types of others, as a loop wants them."""
    return jax.tree.map(lambda x, y: jax.lax.convert_element_type(x, np.result_type(y)), values, like)


def _planned(way: StepState, grid: Float[Numbers, " time"], limits: StepLimits) -> StepState:
    """Return the way with its next step, or why there is none."""
    place = way.place
    left = limits.stop - place.instant
    step = jnp.minimum(jnp.minimum(place.safe_step, SAFE_FRACTION * place.reach), jnp.minimum(way.largest, left))
    crawled = jnp.where(step < CRAWLING * left, way.crawled + 1, 0)
    singular = way.may_pass & (place.turnover < 0) & (place.reach < PASSAGE * place.radius)
    endings = (
        ((crawled > LONGEST_CRAWL) | (place.instant + step == place.instant), StopReason.COLLAPSED),
        (singular, StopReason.PASSAGE),
        (~(left > 0), StopReason.ARRIVED),
    )
    ending = jnp.full((), int(StopReason.UNFINISHED))
    for happened, why in endings:
        ending = jnp.where(happened, int(why), ending)
    step = jnp.where(left - step < SLIVER * step, left, step)
    target = jnp.where(step == left, limits.stop, place.instant + step)
    crawled = jnp.where(ending == StopReason.PASSAGE, way.crawled, crawled)  # the step is planned again
    way = way._replace(ending=ending, crawled=crawled, refused=jnp.full((), jnp.nan))
    return _aimed(way, step, target, grid)


def _aimed(way: StepState, step: Number, target: Number, grid: Float[Numbers, " time"]) -> StepState:
    """Return the way with a step to try, and in the other lanes the next instants of the grid within it."""
    instant = jnp.concatenate([target[None], jnp.minimum(_next_up(way, grid), target)])
    return way._replace(step=step, instant=instant, away=instant - way.place.instant, planned=jnp.ones((), bool))


def _next_up(way: StepState, grid: Float[Numbers, " time"]) -> Float[Numbers, " lane"]:
    return jax.lax.dynamic_slice_in_dim(grid, way.next_up, len(way.instant) - 1)


def _after(
    way: StepState,
    arrival: StepResult,
    known: SolvedState,
    grid: Float[Numbers, " time"],
    limits: StepLimits,
) -> tuple[StepState, Records]:
    """Return how the way stands after a batch, and what is recorded of it; `known` is of the arrival."""
    target, status, lanes = way.instant[0], arrival.status[0], len(way.instant) - 1
    there = Place(target, arrival.safe_step[0], arrival.radius[0], arrival.turnover[0])
    passable = (status == int(Status.OK)) | (status == int(Status.UNDEFINED))
    begins = way.step == 0
    accepted = passable & (begins | (way.step * jnp.abs(there.turnover) <= LARGEST_TURNOVER))
    within = accepted & (_next_up(way, grid) <= target)
    lane = jnp.where(within, way.next_up + np.arange(lanes), -1)
    way = way._replace(next_up=way.next_up + jnp.sum(within))
    behind = jnp.sum(_next_up(way, grid) <= target)  # a few are solved from the next anchor, which is near them
    taken = accepted & (behind <= jnp.where(target < limits.stop, lanes // 2, 0))  # else the same step with those left
    stuck = ~accepted & ((way.step < limits.smallest) | (target <= way.place.instant))
    inadmissible = ~accepted & (status == int(Status.INADMISSIBLE)) & jnp.isnan(way.refused)
    way = way._replace(
        ending=jnp.where(stuck, int(StopReason.REFUSED), int(StopReason.UNFINISHED)),
        refused=jnp.where(inadmissible, target, way.refused),
    )
    arrived = way._replace(
        known=jax.tree.map(lambda x: jnp.broadcast_to(x[..., :1], x.shape), known),
        place=there,
        may_pass=jnp.ones((), bool),
        largest=jnp.where(begins, way.largest, GROWTH * way.step),
    )
    halved = ~accepted & ~stuck
    step = jnp.where(halved, 0.5 * way.step, way.step)
    again = _aimed(way, step, jnp.where(halved, way.place.instant + step, target), grid)
    after = jax.tree.map(lambda new, old: jnp.where(taken, new, old), _planned(arrived, grid, limits), again)
    solved = (arrival.coordinates, arrival.outputs, arrival.sign, arrival.status)
    return after, Records(*solved, jnp.concatenate([jnp.full(1, -1), lane]), there, taken)
