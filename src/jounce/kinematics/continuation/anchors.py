"""Anchors of a followed motion, change points, and how the determinant of the Jacobian vanishes ahead of anchors.

Where a driver turns back or rests at a change point, the determinant has a multiple zero there, which is farther away
than its rate says. The motion goes on along its series, the only continuation that is analytic in time. Rounding leaves
positions uncertain by eps / d^m at a distance of d radii from a zero of multiplicity m, and branches lie d^m apart.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jounce.kinematics.continuation.correct_and_differentiate import SolvedState, StepResult
from jounce.kinematics.status import Status

SIMPLE_ZERO = 1.6  # largest estimate of the multiplicity of a simple zero of the determinant,
DOUBLE_ZERO = 2.4  # and of a double one
STEADY = 0.1  # largest relative change of the estimate from step to step toward a multiple zero
HIDDEN = 2e-12  # d^(2 m), below which rounding hides which branch is which
NEARBY = 0.1  # radii: closer singular positions spoil high derivatives of a smooth motion


class Anchor(NamedTuple):
    """A solved instant of a followed motion, with the reach of its Taylor series.

    Attributes
    ----------
    instant : float
        Time, s.
    states, lane, structure
        Leaves of the states of several anchors, the index of this one, and the tree structure of a state; most states
        are never built.
    safe_step, radius : float
        Reach of the Taylor series, s: by all its terms, and by the time at which the first three terms grow to one.
    det_rate : float
        Rate at which the Jacobian approaches a singular one (below zero) or leaves it, 1/s.
    status : Status
        OK, or UNDEFINED if an output has no finite value; the motion continues there.
    """

    instant: float
    states: Sequence[np.ndarray]
    lane: int
    structure: Any
    safe_step: float
    radius: float
    det_rate: float
    status: Status

    @property
    def leaves(self) -> list[np.ndarray]:
        """Leaves of the state."""
        return [x[..., self.lane : self.lane + 1] for x in self.states]

    @property
    def state(self) -> SolvedState:
        """Jets of the coordinates and outputs, and the sign of the determinant of the Jacobian."""
        return jax.tree.unflatten(self.structure, self.leaves)

    @classmethod
    def of(cls, arrival: StepResult, instant: float) -> "Anchor":
        """Return the anchor of the first lane of a batch that was searched for singular positions."""
        safe_step, radius, det_rate = (float(x[0]) for x in (arrival.safe_step, arrival.radius, arrival.det_rate))
        status = Status(int(arrival.status[0]))
        leaves, structure = jax.tree.flatten(arrival.state(slice(1)))
        return cls(float(instant), leaves, 0, structure, safe_step, radius, det_rate, status)

    @property
    def expansion_point(self) -> tuple[float, float, float, float]:
        """Instant, safe step, radius and rate of the determinant."""
        return self.instant, self.safe_step, self.radius, self.det_rate

    @property
    def reach(self) -> float:
        """Time to or from the nearest singular position, to first order, s."""
        return 1 / abs(self.det_rate) if abs(self.det_rate) > 0 else np.inf


@dataclasses.dataclass(frozen=True)
class ChangePoint:
    """A singular position that a motion passes smoothly.

    Attributes
    ----------
    instant, radius : float
        Instant, and radius of the Taylor series there, s.
    multiplicity : int
        Multiplicity of the zero of the determinant: 2 where a driver turns back.
    """

    instant: float
    radius: float
    multiplicity: int = 1


def multiplicity_ahead(anchors: Sequence[Anchor]) -> float:
    """Return the estimated multiplicity of the zero of the determinant ahead; NaN before two anchors approach it.

    A multiple zero, as where a driver turns back, is farther away than its rate says: a passage by that rate would end
    at the zero itself, where rounding chooses the branch.
    """
    if len(anchors) < 2 or not anchors[-2].det_rate < 0:
        return np.nan
    before, last = anchors[-2:]
    decrease = before.reach - last.reach
    return (last.instant - before.instant) / decrease if decrease > 0 else np.inf


def hidden_zero(anchors: Sequence[Anchor]) -> ChangePoint | None:
    """Return the zero of multiplicity above two ahead of three anchors, if rounding hides it; else None.

    The estimate is steady toward such a zero. It grows toward a pair of zeros that the motion misses.
    """
    last = anchors[-1]
    if not (last.det_rate < 0 and last.reach < NEARBY * last.radius):
        return None
    before, multiplicity = multiplicity_ahead(anchors[:-1]), multiplicity_ahead(anchors)
    if not (DOUBLE_ZERO < multiplicity < np.inf and abs(multiplicity - before) < STEADY * multiplicity):
        return None
    distance = multiplicity * last.reach
    hidden = (distance / last.radius) ** (2 * multiplicity) < HIDDEN
    return ChangePoint(last.instant + distance, last.radius, round(multiplicity)) if hidden else None
