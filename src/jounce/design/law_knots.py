"""Where derivatives of motion laws jump, whatever the design: no series about an instant goes on beyond."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from jounce.mechanism import Mechanism, with_outputs_held
from jounce.mechanism.resolve import resolve_motion
from jounce.trajectory.smoothness import knots

MOST_KNOTS = 200  # more of them, as of a spline through many samples, are left where they are
SAME = 1e-12  # of a span of time


def law_knots(
    mechanism: Mechanism, bounds: Mapping[str, tuple[float, float]], first: float, last: float
) -> Float[np.ndarray, " knots"]:
    """Return the instants at which laws of drivers, or of the outputs they follow from, jump in some derivative, s.

    Parameters
    ----------
    mechanism : Mechanism
    bounds : dict of str to (low, high)
        Of parameters that vary; instants that depend on one are left out.
    first, last : float
        s.
    """
    found = _of_design(mechanism, first, last)
    ends = [mechanism.with_parameters(**{name: bound}) for name, pair in bounds.items() for bound in pair]
    for design in ends if len(found) else ():
        there = _of_design(design, first, last)
        apart = np.abs(found[:, None] - there).min(axis=1, initial=np.inf)
        found = found[apart <= SAME * (abs(first) + abs(last))]
    return found if len(found) <= MOST_KNOTS else found[:0]


def _of_design(mechanism: Mechanism, first: float, last: float) -> Float[np.ndarray, " knots"]:
    values, laws = mechanism.parameter_values, with_outputs_held(mechanism).drivers.values()
    motions = (getattr(driver, "motion", None) for driver in laws)
    each = [knots(resolve_motion(motion, values), first, last) for motion in motions if motion is not None]
    return np.unique(np.concatenate([np.zeros(0), *each]))
