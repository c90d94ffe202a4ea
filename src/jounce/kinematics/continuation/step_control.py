"""Step control of the continuation: the length of the next step, and whether the last one is taken.

Two things limit a step. The Taylor series must carry it: no term moves a body far. And the Jacobian must not come near
a singular one on the way, where branches meet and a series that looks smooth may lead over to another: `advance` tells
where its determinant vanishes next, to first order, and a step goes only part of that way. A step that is refused is
halved until it is not, or is too small to be halved. What is out of the ordinary ends the steps and is decided outside.
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

LARGEST_DET_RATE = 1.0  # times a step, as seen from its end, at most; as seen from its start, SAFE_FRACTION
# part of the radius of the series: so near a singular position it shows whether the motion is smooth there
PASSAGE = 3e-3
CRAWLING = 1e-6  # part of what is left of the motion: length of a step that is too short,
# and how many of them in a row end the steps: a sharp turn takes a few dozen, a law without bounds more
LONGEST_CRAWL = 300
SLIVER = 0.1  # part of a step: a remainder no longer than this is added to the last step
GROWTH = 4.0  # factor by which a step may be longer than the last one

Lanes = Float[Numbers, "*batch"]
Truths = Bool[Numbers, "*batch"]


class StopReason(enum.IntEnum):
    """Why steps ended."""

    UNFINISHED = 0  # they have not
    ARRIVED = 1
    PASSAGE = 2  # a singular position is just ahead, and may be passed smoothly
    COLLAPSED = 3  # steps have become too small
    REFUSED = 4  # no step, however small, is accepted


class ExpansionPoint(NamedTuple):
    """Expansion point of a Taylor series: the instant, s, and how far the series carries; see `StepResult`."""

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
    """The next step, and the outcome of those before."""

    expansion_point: ExpansionPoint  # of the last anchor
    step: Lanes  # to be tried next, s; zero to solve the first instant itself
    target: Lanes  # where it leads to, s
    may_pass: Truths  # whether a singular position just ahead ends the steps
    largest: Lanes  # step that the last one allows, s
    crawled: Int[Numbers, "*batch"]  # steps in sequence that were too short
    refused: Lanes  # instant at which a law had no permitted value, s; NaN if none
    ending: Int[Numbers, "*batch"]  # see StopReason


def initial_control(point: ExpansionPoint, target: Float[np.ndarray, "*batch"]) -> StepControl:
    """Return the step that solves the first instant itself, s; or, at a known expansion point, none that is planned."""
    blank = np.zeros(target.shape)
    none = np.zeros(target.shape, int)
    yes, far, unknown = (np.full(target.shape, value) for value in (True, np.inf, np.nan))
    return StepControl(point, blank, target, yes, far, none, unknown, none)


def plan_next_step(control: StepControl, limits: StepLimits) -> StepControl:
    """Plan the next step from an expansion point, or end the steps with a reason."""
    point = control.expansion_point
    left = limits.stop - point.instant
    step = jnp.minimum(jnp.minimum(point.safe_step, SAFE_FRACTION * point.reach), jnp.minimum(control.largest, left))
    crawled = jnp.where(step < CRAWLING * left, control.crawled + 1, 0)
    singular = control.may_pass & (point.det_rate < 0) & (point.reach < PASSAGE * point.radius)
    endings = (
        ((crawled > LONGEST_CRAWL) | (point.instant + step == point.instant), StopReason.COLLAPSED),
        (singular, StopReason.PASSAGE),
        (~(left > 0), StopReason.ARRIVED),
    )
    ending = jnp.full(left.shape, int(StopReason.UNFINISHED))
    for happened, why in endings:
        ending = jnp.where(happened, int(why), ending)
    step = jnp.where(left - step < SLIVER * step, left, step)
    target = jnp.where(step == left, limits.stop, point.instant + step)
    crawled = jnp.where(ending == StopReason.PASSAGE, control.crawled, crawled)  # the step is planned again
    refused = jnp.full(left.shape, jnp.nan)
    return control._replace(step=step, target=target, ending=ending, crawled=crawled, refused=refused)


def is_accepted(control: StepControl, status: Int[Numbers, "*batch"], there: ExpansionPoint) -> Truths:
    """Tell whether a step may be taken, by its status and the expansion point that it led to."""
    passable = (status == int(Status.OK)) | (status == int(Status.UNDEFINED))
    return passable & ((control.step == 0) | (control.step * jnp.abs(there.det_rate) <= LARGEST_DET_RATE))


def next_control(
    control: StepControl,
    status: Int[Numbers, "*batch"],
    there: ExpansionPoint,
    limits: StepLimits,
    good: Truths,
    taken: Truths,
) -> StepControl:
    """Return the step after one that was accepted, `good`, and taken, or not.

    One that was accepted but not taken is made again; see `is_accepted` for what is known of it.
    """
    stuck = ~good & ((control.step < limits.smallest) | (control.target <= control.expansion_point.instant))
    inadmissible = ~good & (status == int(Status.INADMISSIBLE)) & jnp.isnan(control.refused)
    control = control._replace(
        ending=jnp.where(stuck, int(StopReason.REFUSED), int(StopReason.UNFINISHED)),
        refused=jnp.where(inadmissible, control.target, control.refused),
    )
    largest = jnp.where(control.step == 0, control.largest, GROWTH * control.step)
    arrived = control._replace(expansion_point=there, may_pass=jnp.ones_like(taken), largest=largest)
    halved = ~good & ~stuck
    step = jnp.where(halved, 0.5 * control.step, control.step)
    again = control._replace(
        step=step, target=jnp.where(halved, control.expansion_point.instant + step, control.target)
    )
    return jax.tree.map(lambda new, old: jnp.where(taken, new, old), plan_next_step(arrived, limits), again)


@mapped()
def next_controls(
    limits: StepLimits, lanes: tuple[StepControl, Int[Numbers, " batch"], ExpansionPoint]
) -> tuple[StepControl, Any]:
    """Return the next step of each of many designs, and whether the last one was taken, all of which is decided by it.

    Parameters
    ----------
    limits : StepLimits
        Of all.
    lanes : tuple
        Of each the step that was made, its status, and the expansion point that it led to.
    """
    control, status, there = lanes
    good = is_accepted(control, status, there)
    return next_control(control, status, there, limits, good, good), good
