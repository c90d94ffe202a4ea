"""Where derivatives of laws jump, whatever the design: no series about an instant goes on beyond."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from jounce.mechanism import Mechanism
from jounce.mechanism.laws.law_breaks import breaks_of_laws
from jounce.trajectory.law_checks.smoothness import HIGHEST

MOST_KNOTS = 200  # more of them, as of a spline through many samples, are left where they are
SAME = 2e-11  # of a span of time: kinks of expressions are found to half of that


def law_knots(
    mechanism: Mechanism, bounds: Mapping[str, tuple[float, float]], first: float, last: float
) -> Float[np.ndarray, " knots"]:
    """Return the instants at which laws of drivers, or of the outputs they follow from, jump in some derivative, s.

    Laws of forces count where outputs are forces, unless there are too many knots.

    Parameters
    ----------
    mechanism : Mechanism
    bounds : dict of str to (low, high)
        Of parameters that vary; instants that depend on one are left out.
    first, last : float
        s.
    """
    knots = _common(mechanism, bounds, first, last, None)
    if len(knots) > MOST_KNOTS:
        knots = _common(mechanism, bounds, first, last, False)
    return knots if len(knots) <= MOST_KNOTS else knots[:0]


def _common(
    mechanism: Mechanism, bounds: Mapping[str, tuple[float, float]], first: float, last: float, forces: bool | None
) -> Float[np.ndarray, " knots"]:
    """Return the knots of all designs, those of laws of forces as `breaks_of_laws` takes them."""
    breaks = breaks_of_laws(mechanism, first, last, HIGHEST, forces=forces)
    ends = [mechanism.with_parameters(**{name: bound}) for name, pair in bounds.items() for bound in pair]
    for design in ends if len(breaks) else ():
        there = breaks_of_laws(design, first, last, HIGHEST, forces=forces)
        distances = np.abs(breaks[:, None] - there).min(axis=1, initial=np.inf)
        breaks = breaks[distances <= SAME * (abs(first) + abs(last))]
    return breaks
