"""Instants at which derivatives of laws jump in every design, beyond which no Taylor series extends."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from jounce.mechanism import Mechanism
from jounce.mechanism.laws.law_breaks import breaks_of_laws
from jounce.trajectory.law_checks.smoothness import HIGHEST

MOST_KNOTS = 200  # more knots, as of a spline through many samples, are ignored
SAME = 2e-11  # fraction of the duration: kinks of expressions are found to half of it


def law_knots(
    mechanism: Mechanism, bounds: Mapping[str, tuple[float, float]], first: float, last: float
) -> Float[np.ndarray, " knots"]:
    """Return the instants at which a derivative of a driver law, or of the law of an output driver, jumps, s.

    Laws of forces are included if outputs are forces, unless they have too many knots.

    Parameters
    ----------
    mechanism : Mechanism
    bounds : dict of str to (low, high)
        Bounds of the parameters that vary; instants that depend on one are left out.
    first, last : float
        First and last instant, s.
    """
    knots = _common(mechanism, bounds, first, last, None)
    if len(knots) > MOST_KNOTS:
        knots = _common(mechanism, bounds, first, last, False)
    return knots if len(knots) <= MOST_KNOTS else knots[:0]


def _common(
    mechanism: Mechanism, bounds: Mapping[str, tuple[float, float]], first: float, last: float, forces: bool | None
) -> Float[np.ndarray, " knots"]:
    """Return the knots that all designs have; `forces` is as for `breaks_of_laws`."""
    breaks = breaks_of_laws(mechanism, first, last, HIGHEST, forces=forces)
    ends = [mechanism.with_parameters(**{name: bound}) for name, pair in bounds.items() for bound in pair]
    for design in ends if len(breaks) else ():
        jumps = breaks_of_laws(design, first, last, HIGHEST, forces=forces)
        distances = np.abs(breaks[:, None] - jumps).min(axis=1, initial=np.inf)
        breaks = breaks[distances <= SAME * (abs(first) + abs(last))]
    return breaks
