"""Breaks of laws, at which derivatives jump or bend, and the instants beside them for one-sided limits."""

from collections.abc import Iterable, Iterator

import numpy as np
from jaxtyping import Float, Int

from jounce.settings import under_own_settings
from jounce.trajectory.law_checks.observed import may_bend, observed_jumps
from jounce.trajectory.law_checks.smoothness import HIGHEST, LeaderValues, known_jumps
from jounce.trajectory.laws.composed import FollowingMotion
from jounce.trajectory.motion import AbstractMotion, ExpressionMotion

SIDE_OFFSET = 2e-11  # fraction of an interval: distance of the sides from a break; kinks are found to half of that
MOST = 1000  # breaks of the derivative above the requested ones; of more, as of a spline through samples, none is used

Times = Float[np.ndarray, " time"]
Breaks = Float[np.ndarray, " break"]


@under_own_settings
def law_breaks(laws: Iterable[AbstractMotion], first: float, last: float, order: int) -> Breaks:
    """Return the sorted instants at which a derivative up to an order jumps or bends, s.

    The instants at which pieces of a law meet are known, also those at which a leader passes them. Kinks of expressions
    and of Python functions are looked for, up to the fifth derivative.

    Parameters
    ----------
    laws : iterable of AbstractMotion
        Laws with numbers in the place of parameters.
    first, last : float
        Interval of time, s.
    order : int
        Highest derivative that matters.

    Examples
    --------
    >>> import jounce as jn
    >>> segments = [jn.laws.Segment("dwell", 0.25), jn.laws.Segment("cycloidal", 0.5, by=0.1)]
    >>> ramp = jn.laws.SegmentedMotion(segments, beyond="hold")
    >>> bent = jn.laws.ExpressionMotion(jn.laws.Expression("abs(t - 0.1)"), {})
    >>> law_breaks([ramp, bent], 0.0, 1.0, 4).round(9).tolist()
    [0.1, 0.25, 0.75]
    """
    breaks, leader_values = [np.zeros(0)], LeaderValues()
    distinct_laws = {id(law): law for law in _with_leaders(laws)}.values()  # several laws may have one leader
    for law in distinct_laws if last > first else ():
        level = min(order + 1, HIGHEST)
        instants, jumps, _ = known_jumps(law, first, last, level, leader_values)
        jump, bend = np.any(jumps[:-1] != 0, axis=0), jumps[-1] != 0
        breaks.append(instants[jump | bend if np.sum(jump | bend) <= MOST else jump])
        if may_bend(law):
            breaks.append(observed_jumps([law], first, last, order + 1).instants)
    return distinct_instants(np.concatenate(breaks), first, last)


def both_sides(
    breaks: Breaks, first: float, last: float
) -> tuple[Float[np.ndarray, " side"], Int[np.ndarray, " side"]]:
    """Return the instants just before and just after breaks, within an interval, and the indices of their breaks.

    Examples
    --------
    >>> instants, which = both_sides(np.array([0.5, 1.0]), 0.0, 1.0)
    >>> instants.round(9).tolist(), which.tolist()
    ([0.5, 0.5, 1.0], [0, 0, 1])
    """
    offset = _side_offset(first, last)
    instants = (breaks[:, None] + offset * np.array([-1.0, 1.0])).ravel()
    indices = np.repeat(np.arange(len(breaks)), 2)
    is_inside = (instants > first) & (instants < last)
    return instants[is_inside], indices[is_inside]


def with_sides(instants: Times, breaks: Breaks) -> Float[np.ndarray, " all"]:
    """Return a grid with the instants just before and just after breaks added."""
    return np.union1d(instants, both_sides(breaks, float(instants[0]), float(instants[-1]))[0])


def at_breaks(instants: Times, breaks: Breaks, first: float, last: float) -> Times:
    """Return instants in which those just beside a break are replaced by the break.

    Examples
    --------
    >>> at_breaks(np.array([0.3, 0.5 - 2e-11]), np.array([0.5]), 0.0, 1.0).tolist()
    [0.3, 0.5]
    """
    if not len(breaks):
        return instants
    next_index = np.clip(np.searchsorted(breaks, instants), 1, max(len(breaks) - 1, 1))
    pair = breaks[np.stack([next_index - 1, np.minimum(next_index, len(breaks) - 1)])]
    nearest_breaks = np.where(np.abs(pair[0] - instants) <= np.abs(pair[1] - instants), pair[0], pair[1])
    return np.where(np.abs(nearest_breaks - instants) <= 1.5 * _side_offset(first, last), nearest_breaks, instants)


def _side_offset(first: float, last: float) -> float:
    return max(SIDE_OFFSET * (last - first), 8 * float(np.spacing(max(abs(first), abs(last)))))


def distinct_instants(instants: Float[np.ndarray, " instant"], first: float, last: float) -> Times:
    """Return sorted instants, without those that differ from others by rounding only."""
    instants = np.unique(instants)
    return instants[np.diff(instants, prepend=-np.inf) > 2 * _side_offset(first, last)]


def _with_leaders(laws: Iterable[AbstractMotion]) -> Iterator[AbstractMotion]:
    """Yield laws, and the leaders of laws or of their parts."""
    for law in laws:
        yield law
        if isinstance(law, FollowingMotion):
            yield from _with_leaders(law.parts[1:])
        elif members := getattr(law, "parts", ()):
            yield from (x for member in members for x in _with_leaders([member]) if x is not member)


def may_break(law: AbstractMotion) -> bool:
    """Tell whether a law may jump or bend somewhere: all but expressions of smooth functions."""
    return not isinstance(law, ExpressionMotion) or may_bend(law)
