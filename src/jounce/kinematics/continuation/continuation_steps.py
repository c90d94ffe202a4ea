"""Many continuation steps from anchor to anchor, and the grid instants between, in one compiled program.

The first lane of a batch makes the step; the other lanes solve the next grid instants up to its end. Instants that do
not fit are solved from the same anchor in more batches, or, if they are few, from the next anchor.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers
from jounce.execution.compilation import compiled
from jounce.execution.mapped import called
from jounce.kinematics.continuation.correct_and_differentiate import (
    Settings,
    SolvedState,
    StepResult,
    advance,
    predictor,
)
from jounce.kinematics.continuation.instant_program import finds_det_rate
from jounce.kinematics.continuation.singularity_distance import det_rate_at
from jounce.kinematics.continuation.step_control import (
    ExpansionPoint,
    StepControl,
    StepLimits,
    StopReason,
    is_accepted,
    next_control,
    plan_next_step,
)
from jounce.mechanism.system import System
from jounce.rigid.pose import Pose

NOWHERE = ExpansionPoint(*[np.full((), np.nan)] * 4)


class StepState(NamedTuple):
    """State of a run between two batches."""

    source: SolvedState  # data of the last anchor from which all lanes are predicted
    control: StepControl  # of the step tried next
    step: Float[Numbers, " batch"]  # time from the last anchor to the instant of each lane, s
    instant: Float[Numbers, " batch"]  # of each lane, s
    planned: Bool[Numbers, ""]  # whether step and instants are decided
    next_up: Int[Numbers, ""]  # index of the next grid instant
    arrived: ExpansionPoint  # end of the step, if an earlier batch has found it; else NaN


class Solved(NamedTuple):
    """Solved instants: states and outcomes, instants last."""

    coordinates: dict[str, Numbers]
    outputs: tuple[Numbers, ...]
    sign: Float[Numbers, " instant"]
    status: Int[Numbers, " instant"]


class Records(NamedTuple):
    """Records of a run: its anchors in order, and the grid instants, each in its place."""

    anchors: Solved
    expansion_point: ExpansionPoint
    grid: Solved


class TakenSteps(NamedTuple):
    """Outcome of a run."""

    run: StepState  # `next_up` is the first grid instant that is not among the records
    records: Records
    last: StepResult  # the last batch
    count: Int[Numbers, ""]  # of batches solved
    steps: Int[Numbers, ""]  # number of anchors reached


_batch = jax.jit(advance, static_argnames=("pose_type", "order"))  # traced once


@compiled(
    *("pose_type", "order", "batches", "native"),
    narrow=True,
    otherwise={"native": None},  # without machine code for a run, XLA has none to call
)
def take_steps(
    system: System,
    run: StepState,
    grid: Float[Numbers, " time"],
    limits: StepLimits,
    settings: Settings,
    search: Bool[Numbers, ""],
    batch_limit: Int[Numbers, ""],
    *,
    pose_type: type[Pose],
    order: int,
    batches: int,
    native: str | None = None,
) -> TakenSteps:
    """Continue a run until it arrives, needs a decision from outside, or has solved enough batches.

    Parameters
    ----------
    system : System
        The mechanism.
    run : StepState
        State from which to continue.
    grid : array of shape (time,)
        Next grid instants, s, infinite beyond the last; at least one batch more than can be solved.
    limits, settings, search
        See `StepLimits` and `advance`.
    batch_limit : int
        Largest number of batches to solve.
    pose_type, order
        PlanarPose or SpatialPose; derivatives requested.
    batches : int
        Number of batches for which memory is reserved.
    native : str, optional
        Name of the machine code that solves a batch, see `advance_instant`; by default, XLA solves it.
    """

    def solved(run: StepState) -> Any:
        unknown = jnp.isnan(run.arrived.instant)
        arrival = arrived_at(run, search & unknown)
        names = "safe_step", "radius", "det_rate"
        return arrival._replace(
            **{name: jnp.where(unknown, getattr(arrival, name), getattr(run.arrived, name)) for name in names}
        )

    def arrived_at(run: StepState, search: Any) -> Any:
        if native is not None:
            first = np.arange(len(run.instant)) == 0
            lanes = run.source, run.step, run.instant, None, search & first
            arrival = called(native, (system, settings), lanes)
            arrival = arrival._replace(safe_step=arrival.safe_step[:1], radius=arrival.radius[:1])
            if finds_det_rate(system):
                return arrival._replace(det_rate=arrival.det_rate[:1])
            find_det_rate = partial(det_rate_at, system, pose_type, arrival.coordinates, run.instant)
            return arrival._replace(det_rate=jax.lax.cond(search, find_det_rate, lambda: jnp.zeros(1)))
        return _batch(system, settings, run.source, run.step, run.instant, search, pose_type=pose_type, order=order)

    def going(state: TakenSteps) -> Any:
        return (state.run.control.ending == int(StopReason.UNFINISHED)) & (state.count < batch_limit)

    def go_on(state: TakenSteps) -> TakenSteps:
        arrival = _typed(solved(state.run), blank)
        arrival_source = predictor(system, pose_type, (arrival.coordinates, arrival.outputs, arrival.sign))
        run, arrived, taken = _after_batch(state.run, arrival, arrival_source, grid, limits)
        solved_now, (anchors, points, instants) = _solved(arrival), state.records
        anchors = put(anchors, jax.tree.map(lambda x: x[..., :1], solved_now), state.steps)
        points = put(points, jax.tree.map(lambda x: x[None], arrived), state.steps)
        instants = put(instants, jax.tree.map(lambda x: x[..., 1:], solved_now), state.run.next_up)
        records = Records(anchors, points, instants)  # later batches overwrite lanes that belong to no step
        return TakenSteps(_typed(run, state.run), records, arrival, state.count + 1, state.steps + jnp.sum(taken))

    def put(arrays: Any, values: Any, index: Any) -> Any:
        update = jax.lax.dynamic_update_slice_in_dim
        return jax.tree.map(lambda xs, x: update(xs, x, index, -1), arrays, _typed(values, arrays))

    def room(like: Any, length: int) -> Any:
        return jax.tree.map(lambda x: jnp.zeros((*x.shape[:-1], length), x.dtype), like)

    shapes = jax.eval_shape(solved, run)
    blank = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
    point = ExpansionPoint(*[np.zeros(batches)] * 4)
    records = Records(room(_solved(shapes), batches), point, room(_solved(shapes), len(grid)))
    run, none = _typed(run, run), jnp.zeros((), int)
    run = jax.lax.cond(run.planned, lambda: run, lambda: _typed(_planned(run, grid, limits), run))
    return jax.lax.while_loop(going, go_on, TakenSteps(run, records, blank, none, none))


def _solved(arrival: StepResult) -> Solved:
    return Solved(arrival.coordinates, arrival.outputs, arrival.sign, arrival.status)


def _typed(values: Any, like: Any) -> Any:
    """Convert arrays to the types of others, as loops require."""
    return jax.tree.map(lambda x, y: jax.lax.convert_element_type(x, np.result_type(y)), values, like)


def _planned(run: StepState, grid: Float[Numbers, " time"], limits: StepLimits) -> StepState:
    """Plan the next step of a run, or end it with a reason."""
    return _with_step(run._replace(arrived=NOWHERE), plan_next_step(run.control, limits), grid)


def _with_step(run: StepState, control: StepControl, grid: Float[Numbers, " time"]) -> StepState:
    """Return the run with a step to try, and the next grid instants within it in the other lanes."""
    instant = jnp.concatenate([control.target[None], jnp.minimum(_next_up(run, grid), control.target)])
    step = instant - control.expansion_point.instant
    return run._replace(control=control, instant=instant, step=step, planned=jnp.ones((), bool))


def _next_up(run: StepState, grid: Float[Numbers, " time"]) -> Float[Numbers, " lane"]:
    return jax.lax.dynamic_slice_in_dim(grid, run.next_up, len(run.instant) - 1)


def _after_batch(
    run: StepState, arrival: StepResult, arrival_source: SolvedState, grid: Float[Numbers, " time"], limits: StepLimits
) -> tuple[StepState, ExpansionPoint, Bool[Numbers, ""]]:
    """Return the state of a run after a batch, the end point of its first lane, and whether that is the next anchor.

    `arrival_source` has the data of the arrival for predictions.
    """
    control, status, lanes = run.control, arrival.status[0], len(run.instant) - 1
    target = control.target
    arrived = ExpansionPoint(target, arrival.safe_step[0], arrival.radius[0], arrival.det_rate[0])
    accepted = is_accepted(control, status, arrived)
    within = accepted & (_next_up(run, grid) <= target)
    run = run._replace(next_up=run.next_up + jnp.sum(within))
    count = jnp.sum(_next_up(run, grid) <= target)  # a few are solved from the next anchor, which is near
    taken = accepted & (count <= jnp.where(target < limits.stop, lanes // 2, 0))  # else repeat the step for the others
    source = jax.tree.map(lambda new, old: jnp.where(taken, new[..., :1], old), arrival_source, run.source)
    repeated = jax.tree.map(lambda x: jnp.where(accepted & ~taken, x, jnp.nan), arrived)
    control = next_control(control, status, arrived, limits, accepted, taken)
    return _with_step(run._replace(source=source, arrived=repeated), control, grid), arrived, taken
