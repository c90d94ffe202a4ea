"""Step control of the continuation: the length of the next step, and whether the last one is accepted.

Two limits apply to a step. The Taylor series must carry it: no term may move a body far. And the Jacobian must stay
away from singular ones, where branches meet and a smooth series may lead onto another branch: `advance` finds, to first
order, where the determinant vanishes next, and a step covers only part of that distance. A refused step is halved until
it is accepted or too small. Anything out of the ordinary ends the run and is decided outside.
"""

import enum
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jounce.base.shapes import Numbers
from jounce.execution.mapped import mapped
from jounce.kinematics.continuation.correct_and_differentiate import SAFE_FRACTION
from jounce.kinematics.status import Status

LARGEST_DET_RATE = 1.0  # bound of a step times the rate at its end; at its start, SAFE_FRACTION
# part of the radius of the series: this close to a singular position, it is clear whether the motion is smooth there
PASSAGE = 3e-3
CRAWLING = 1e-6  # part of the remaining motion: length of a step that is too short
# number of such steps in a row that end the run: a sharp turn takes a few dozen, an unbounded law more
LONGEST_CRAWL = 300
SLIVER = 0.1  # part of a step: a shorter remainder is added to the last step
GROWTH = 4.0  # largest ratio of a step to the one before

Lanes = Float[Numbers, "*batch"]
Truths = Bool[Numbers, "*batch"]


class StopReason(enum.IntEnum):
    """Why a run ended."""

    UNFINISHED = 0  # not ended
    ARRIVED = 1
    PASSAGE = 2  # a singular position is just ahead, and may be passed smoothly
    COLLAPSED = 3  # steps have become too small
    REFUSED = 4  # no step, however small, is accepted


class ExpansionPoint(NamedTuple):
    """Expansion point of a Taylor series: the instant, s, and the reach of the series; see `StepResult`."""

    instant: Lanes
    safe_step: Lanes
    radius: Lanes
    det_rate: Lanes

    @property
    def reach(self) -> Any:
        """Time to or from the nearest singular position, to first order, s."""
        rate = jnp.abs(self.det_rate)
        return jnp.where(rate > 0, 1 / jnp.where(rate > 0, rate, 1.0), jnp.inf)


class StepLimits(NamedTuple):
    """Limits of the steps: the last instant, s, and the smallest step, s."""

    stop: Lanes
    smallest: Lanes


class StepControl(NamedTuple):
    """The next step, and the outcome of earlier ones."""

    expansion_point: ExpansionPoint  # of the last anchor
    step: Lanes  # length of the next step, s; zero to solve the first instant itself
    target: Lanes  # end of the next step, s
    may_pass: Truths  # whether a singular position just ahead ends the run
    largest: Lanes  # longest step that the last one allows, s
    crawled: Int[Numbers, "*batch"]  # number of too short steps in a row
    refused: Lanes  # instant at which a law had no permitted value, s; NaN if none
    ending: Int[Numbers, "*batch"]  # see StopReason


def initial_control(point: ExpansionPoint, target: Float[np.ndarray, "*batch"]) -> StepControl:
    """Return the control that solves the first instant, s, itself; or, at a known expansion point, has no step yet."""
    blank = np.zeros(target.shape)
    none = np.zeros(target.shape, int)
    allowed, infinite, undefined = (np.full(target.shape, value) for value in (True, np.inf, np.nan))
    return StepControl(point, blank, target, allowed, infinite, none, undefined, none)


def plan_next_step(control: StepControl, limits: StepLimits) -> StepControl:
    """Plan the next step from an expansion point, or end the run with a reason."""
    point = control.expansion_point
    span = limits.stop - point.instant
    step = jnp.minimum(jnp.minimum(point.safe_step, SAFE_FRACTION * point.reach), jnp.minimum(control.largest, span))
    crawled = jnp.where(step < CRAWLING * span, control.crawled + 1, 0)
    singular = control.may_pass & (point.det_rate < 0) & (point.reach < PASSAGE * point.radius)
    endings = (
        ((crawled > LONGEST_CRAWL) | (point.instant + step == point.instant), StopReason.COLLAPSED),
        (singular, StopReason.PASSAGE),
        (~(span > 0), StopReason.ARRIVED),
    )
    ending = jnp.full(span.shape, int(StopReason.UNFINISHED))
    for condition, reason in endings:
        ending = jnp.where(condition, int(reason), ending)
    step = jnp.where(span - step < SLIVER * step, span, step)
    target = jnp.where(step == span, limits.stop, point.instant + step)
    crawled = jnp.where(ending == StopReason.PASSAGE, control.crawled, crawled)  # the step is planned again
    refused = jnp.full(span.shape, jnp.nan)
    return control._replace(step=step, target=target, ending=ending, crawled=crawled, refused=refused)


def is_accepted(control: StepControl, status: Int[Numbers, "*batch"], end_point: ExpansionPoint) -> Truths:
    """Return whether a step is accepted, by its status and the expansion point at its end."""
    passable = (status == int(Status.OK)) | (status == int(Status.UNDEFINED))
    return passable & ((control.step == 0) | (control.step * jnp.abs(end_point.det_rate) <= LARGEST_DET_RATE))


def next_control(
    control: StepControl,
    status: Int[Numbers, "*batch"],
    end_point: ExpansionPoint,
    limits: StepLimits,
    accepted: Truths,
    taken: Truths,
) -> StepControl:
    """Return the control after a step that was `accepted` or not, and made the next anchor (`taken`) or not.

    An accepted step that was not taken is repeated for more grid instants.
    """
    stuck = ~accepted & ((control.step < limits.smallest) | (control.target <= control.expansion_point.instant))
    inadmissible = ~accepted & (status == int(Status.INADMISSIBLE)) & jnp.isnan(control.refused)
    control = control._replace(
        ending=jnp.where(stuck, int(StopReason.REFUSED), int(StopReason.UNFINISHED)),
        refused=jnp.where(inadmissible, control.target, control.refused),
    )
    largest = jnp.where(control.step == 0, control.largest, GROWTH * control.step)
    arrived = control._replace(expansion_point=end_point, may_pass=jnp.ones_like(taken), largest=largest)
    halved = ~accepted & ~stuck
    step = jnp.where(halved, 0.5 * control.step, control.step)
    repeated = control._replace(
        step=step, target=jnp.where(halved, control.expansion_point.instant + step, control.target)
    )
    return jax.tree.map(lambda new, old: jnp.where(taken, new, old), plan_next_step(arrived, limits), repeated)


@mapped()
def next_controls(
    limits: StepLimits, lanes: tuple[StepControl, Int[Numbers, " batch"], ExpansionPoint]
) -> tuple[StepControl, Any]:
    """Return the next step of each of many designs, and whether the last one was accepted and thus taken.

    Parameters
    ----------
    limits : StepLimits
        Limits of all designs.
    lanes : tuple
        For each design, the step made, its status, and the expansion point at its end.
    """
    control, status, end_point = lanes
    accepted = is_accepted(control, status, end_point)
    return next_control(control, status, end_point, limits, accepted, accepted), accepted
