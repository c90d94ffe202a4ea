"""Continuity of motion laws: the continuous derivatives, and the jumps of the others, which are heard as a ping."""

import dataclasses
import math

import numpy as np
from jaxtyping import Float, Int

from jounce.base.padding import padded, power_of_two
from jounce.jet import Jet
from jounce.trajectory.checks import whole_number
from jounce.trajectory.knots import SMOOTH, Jumps, derivative_sizes, knot_jumps
from jounce.trajectory.law_checks.observed import may_bend, observed_jumps
from jounce.trajectory.laws.composed import FollowingMotion, OutputMotion
from jounce.trajectory.laws.integrated import IntegratedMotion
from jounce.trajectory.laws.piecewise import PiecewiseMotion
from jounce.trajectory.laws.profiles import AbstractProfile
from jounce.trajectory.motion import AbstractMotion, SplineMotion

HIGHEST = 10  # highest derivative that is examined
MOST_CROSSINGS = 10_000
INTERVALS = 4000  # samples of a leader, for its passages of knots of the law that follows it
STEPS = 24  # largest number of refinements of a passage between two samples, down to rounding
AMONG, CLOSE = (
    np.arange(1, 8) / 8,
    10.0 ** -np.arange(2, 16, 2),
)  # fractions of an interval evaluated together
SLACK = 1e-6  # fraction of the sampling interval by which a passage may be beyond an end
LOOKED = "its kinks and jumps are those seen between 2000 instants"
TOO_FAST = "it varies too fast for all of its kinks and jumps to be seen"
SAME = 1e-7  # fraction of the duration: observed jumps this near to a known one are that one
ROUNDING = 1e-9  # fraction of the rise of a profile over powers of its duration: smaller jumps are rounding


@dataclasses.dataclass(frozen=True)
class DerivativeJumps:
    """The jumps of one derivative of a law.

    Attributes
    ----------
    order : int
        Order of the derivative.
    count : int
        Number of jumps in the interval.
    size, instant : float
        Largest jump, m or rad per s to the power of the order, and its instant, s; NaN if there is none.
    """

    order: int
    count: int
    size: float
    instant: float


@dataclasses.dataclass(frozen=True)
class Continuity:
    """The continuity of a law and its derivatives.

    Attributes
    ----------
    derivatives : tuple of DerivativeJumps
        Jumps of the law itself up to its jounce, or up to the first derivative that jumps if that is higher.
    unknown : str
        Why there may be more jumps; empty if there are none.
    """

    derivatives: tuple[DerivativeJumps, ...]
    unknown: str = ""

    @property
    def smoothness(self) -> int | None:
        """The highest continuous derivative; -1 if the law itself jumps, None if no known derivative jumps."""
        broken = [x.order for x in self.derivatives if x.count]
        return min(broken) - 1 if broken else None


def continuity(law: AbstractMotion, first: float, last: float, order: int = 4, *, periodic: bool = False) -> Continuity:
    """Return the continuity of a law and its derivatives between two instants.

    Parameters
    ----------
    law : AbstractMotion
        Law with numbers in the place of parameters.
    first, last : float
        Interval of time, s.
    order : int, default 4
        Order up to which all derivatives are examined.
    periodic : bool, default False
        Whether the law begins again after the last instant, as that of a cam after a turn.

    Returns
    -------
    Continuity
        Continuity of the law; between samples, that of its spline.

    Raises
    ------
    TrajectoryError
        If the order is no integer from 0 to 10, or the law has parameters without values.

    Examples
    --------
    >>> import jounce as jn
    >>> segments = [jn.laws.Segment("cycloidal", 0.5, by=0.1), jn.laws.Segment("dwell", 0.5)]
    >>> law = jn.laws.SegmentedMotion(segments, beyond="advance")
    >>> found = jn.laws.continuity(law, 0.0, 2.0)
    >>> found.smoothness, [(x.order, x.count, x.instant) for x in found.derivatives if x.count]
    (2, [(3, 5, 0.0)])
    """
    whole_number("order", order, 0, HIGHEST)
    instants, jumps, remark = _jumps(law, first, last)
    if remark and last > first:
        instants, jumps, remark = _with_seen(law, instants, jumps, first, last, order)
    repeats = getattr(law, "beyond", "") in ("repeat", "advance")
    if periodic:  # the end is the beginning, and counts once, at which the law begins again
        tolerance = SLACK * (last - first)
        is_inside = (instants < last - tolerance) & ((instants > first + tolerance) | repeats)
        instants, jumps = instants[is_inside], jumps[:, is_inside]
    if periodic and not repeats:
        ends = [np.asarray(law(Jet.variable(np.asarray(jump, float), HIGHEST)).derivatives()) for jump in (last, first)]
        rounding = SMOOTH * derivative_sizes(law, first, last, HIGHEST)
        # where a law has no derivatives at its ends, how they close is not known
        closing = np.where(np.abs(ends[1] - ends[0]) > rounding, ends[1] - ends[0], 0.0)
        instants, jumps = np.append(instants, first), np.column_stack([jumps, closing])
    broken = np.flatnonzero(np.any(jumps != 0, axis=1))
    highest_order = max(order, int(broken[0])) if len(broken) else order
    summaries = []
    for level in range(highest_order + 1):
        sizes = np.abs(jumps[level])
        index = int(np.argmax(sizes >= 0.999999 * sizes.max())) if sizes.any() else -1
        jump = (float(jumps[level, index]), float(instants[index])) if index >= 0 else (np.nan, np.nan)
        summaries.append(DerivativeJumps(level, int(np.count_nonzero(sizes)), *jump))
    return Continuity(tuple(summaries), remark)


def _with_seen(
    law: AbstractMotion, instants: np.ndarray, jumps: np.ndarray, first: float, last: float, order: int
) -> tuple[np.ndarray, np.ndarray, str]:
    """Return known and observed jumps, and a remark on what is not known."""
    observed = observed_jumps([law], first, last, order + 1)
    distances = np.abs(observed.instants[:, None] - instants).min(axis=1, initial=np.inf)
    is_new = distances > SAME * (last - first)
    sizes = np.zeros((len(jumps), np.count_nonzero(is_new)))
    sizes[: observed.sizes.shape[1]] = observed.sizes[is_new, :, 0].T[: len(jumps)]
    all_instants, sizes = np.append(instants, observed.instants[is_new]), np.concatenate([jumps, sizes], axis=1)
    sequence = np.argsort(all_instants, kind="stable")
    return all_instants[sequence], sizes[:, sequence], LOOKED if observed.everywhere else TOO_FAST


def knots(law: AbstractMotion, first: float, last: float) -> Float[np.ndarray, " knots"]:
    """Return the instants in an interval at which a derivative up to the tenth is known to jump.

    Parameters
    ----------
    law : AbstractMotion
        Law with numbers in the place of parameters.
    first, last : float
        Interval of time, s.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.laws.SegmentedMotion([jn.laws.Segment("dwell", 0.5), jn.laws.Segment("cycloidal", 0.5, by=0.1)])
    >>> knots(law, 0.0, 2.0).tolist()
    [0.5, 1.0]
    """
    instants, jumps, _ = _jumps(law, first, last)
    return np.unique(instants[np.any(jumps != 0, axis=0)])


class LeaderValues:
    """Values of leaders that several laws follow, each evaluated only once; kept during one computation."""

    def __init__(self) -> None:
        self._values: dict[tuple[int, int, bytes], tuple[AbstractMotion, list[np.ndarray]]] = {}

    def coefficients(self, leader: AbstractMotion, instants: np.ndarray, order: int = 0) -> list[np.ndarray]:
        """Return the Taylor coefficients of a leader at instants."""
        key = id(leader), order, instants.tobytes()
        if key not in self._values:
            wide = padded(instants, power_of_two(len(instants), 16))
            jet = leader(Jet.variable(wide, order) if order else Jet([wide])).dense()
            self._values[key] = leader, [np.asarray(c)[: len(instants)] for c in jet.coefficients]
        return self._values[key][1]


def known_jumps(
    law: AbstractMotion, first: float, last: float, order: int, leader_values: LeaderValues | None = None
) -> tuple[Float[np.ndarray, " knots"], Float[np.ndarray, "levels knots"], bool]:
    """Return the instants of known jumps of derivatives up to an order, the jumps, and whether these are all jumps.

    Parameters
    ----------
    law : AbstractMotion
        Law with numbers in the place of parameters.
    first, last : float
        Interval of time, s.
    order : int
        Highest derivative.
    leader_values : LeaderValues, optional
        Known values of leaders, for calls with several laws.

    Examples
    --------
    >>> import jounce as jn
    >>> instants, sizes, all_of_them = known_jumps(jn.laws.PiecewiseMotion(["t", "2*t - 1"], until=[1.0]), 0.0, 2.0, 2)
    >>> instants.tolist(), sizes[:, 0].tolist(), all_of_them  # expressions may have kinks of their own
    ([1.0], [0.0, 1.0, 0.0], False)
    """
    instants, sizes, _ = _jumps(law, first, last, order, leader_values)
    return instants, sizes, _is_of_polynomials(law)


def _is_of_polynomials(law: AbstractMotion) -> bool:
    """Return whether a law consists of smooth pieces with known ends."""
    if isinstance(law, PiecewiseMotion | IntegratedMotion):
        return all(map(_is_of_polynomials, law.parts))
    return isinstance(law, SplineMotion | AbstractProfile)


def _jumps(
    law: AbstractMotion, first: float, last: float, order: int = HIGHEST, leader_values: LeaderValues | None = None
) -> tuple[np.ndarray, Float[np.ndarray, "levels knots"], str]:
    """Return the instants in an interval at which derivatives jump, the jumps, and a description of unknown ones."""
    no_jumps, leader_values = (np.zeros(0), np.zeros((order + 1, 0))), leader_values or LeaderValues()
    match law:
        case OutputMotion() if law.parts:
            return _jumps(law.parts[0], first, last, order, leader_values)
        case FollowingMotion() if law.parts:
            following, leader = law.parts
            return _followed(following, leader, first, last, order, leader_values)
        case IntegratedMotion() if law.parts:
            instants, sizes, remark = _jumps(law.parts[0], first, last, max(order - 1, 0), leader_values)
            return instants, np.concatenate([np.zeros((1, len(instants))), sizes])[: order + 1], remark
        case PiecewiseMotion() if law.parts:
            return _of_pieces(law, first, last, order)
        case SplineMotion():
            start = float(np.asarray(law.breakpoints)[0])
            repeats = law.beyond == "repeat"
            return *_repeated(knot_jumps(law, order), start, float(law.stop), first, last, repeats=repeats), ""
        case AbstractProfile():
            return *_within(*_profile_jumps(law, order), first, last), ""
    return *no_jumps, LOOKED if may_bend(law) else ""


def _repeated(
    jumps: Jumps, start: float, stop: float, first: float, last: float, *, repeats: bool
) -> tuple[Float[np.ndarray, " all"], Float[np.ndarray, "levels all"]]:
    """Return the jumps within an interval, those of all periods for a law that repeats."""
    instants, sizes = jumps
    if repeats and len(instants):
        period = stop - start
        periods = np.arange(np.floor((first - start) / period), np.floor((last - start) / period) + 1)
        periods = periods[: max(MOST_CROSSINGS // len(instants), 1)]
        instants = (instants + period * periods[:, None]).ravel()
        sizes = np.tile(sizes, (1, len(periods)))
    return _within(instants, sizes, first, last)


def _within(instants: np.ndarray, sizes: np.ndarray, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    slack = 1e-12 * max(abs(first), abs(last))
    is_inside = (instants >= first - slack) & (instants <= last + slack)
    return instants[is_inside], sizes[:, is_inside]


def _profile_jumps(law: AbstractProfile, order: int) -> Jumps:
    """Return the jumps at the ends of a profile, which is symmetric up to the sign."""
    initial = np.asarray(law(Jet.variable(np.asarray(law.start_time, float), order)).dense().derivatives(), float)
    threshold = ROUNDING * abs(law.end - law.start) / law.duration ** np.arange(order + 1)
    initial = np.where(np.abs(initial) <= threshold, 0.0, initial)
    initial[0] = 0.0
    ends = np.array([law.start_time, law.stop_time], float)
    return ends, np.stack([initial, initial * (-1.0) ** np.arange(order + 1)], axis=1)


def _of_pieces(law: PiecewiseMotion, first: float, last: float, order: int) -> tuple[np.ndarray, np.ndarray, str]:
    """Return the jumps between pieces, and the jumps of the pieces themselves."""
    law_jumps = [(*law.jumps(order), "")]
    bounded = law.beyond != "continue"
    domain = (float(law.start), float(law.until[-1])) if bounded else (first, last)
    inner = law.until[: len(law.parts) - 1]
    begins, ends = (domain[0] if bounded else -np.inf, *inner), (*inner, domain[1] if bounded else np.inf)
    for piece, begin, end in zip(law.parts, begins, ends, strict=True):
        if domain[0] < end and domain[1] > begin:
            piece_instants, jumps, remark = _jumps(piece, max(domain[0], begin), min(domain[1], end), order)
            is_within = (piece_instants > begin) & (piece_instants < end)
            law_jumps.append((piece_instants[is_within], jumps[:, is_within], remark))
    columns = list(zip(*law_jumps, strict=True))
    jumps = np.concatenate(columns[0]), np.concatenate(columns[1], axis=1)
    repeats = law.beyond in ("repeat", "advance")
    is_within = _repeated(jumps, *domain, first, last, repeats=repeats)
    return *is_within, "; ".join(dict.fromkeys(filter(None, columns[2])))


def _followed(
    law: AbstractMotion, leader: AbstractMotion, first: float, last: float, order: int, leader_values: LeaderValues
) -> tuple[np.ndarray, np.ndarray, str]:
    """Return the jumps of a law of the coordinate of a leader, at the instants at which the leader passes its knots.

    The jump is a polynomial of the distance of the leader from the knot, so that its time derivatives follow from the
    jet of the leader at the passage.
    """
    no_jumps = np.zeros(0), np.zeros((order + 1, 0))
    leader_instants, _, remark = _jumps(leader, first, last, order, leader_values)
    if len(leader_instants):
        remark = LOOKED
    if isinstance(law, SplineMotion) and not knot_jumps(law, order)[1].any():
        return *no_jumps, remark
    looks = np.linspace(first, last, INTERVALS + 1)
    values = leader_values.coefficients(leader, looks)[0]
    knots, jumps, law_remark = _jumps(law, float(values.min()), float(values.max()), order, leader_values)
    if not jumps.any():
        return *no_jumps, remark or law_remark
    peaks = [np.abs(c).max(where=np.isfinite(c), initial=0.0) for c in leader_values.coefficients(leader, looks, order)]
    step = (last - first) / INTERVALS
    # the leader may begin or end at a knot, which it then passes outside the interval
    looks = np.concatenate([[first - step], looks, [last + step]])
    values = leader_values.coefficients(leader, looks)[0]
    jumping = jumps.any(axis=0)
    knots, jumps = knots[jumping], jumps[:, jumping]
    knot_index, cell = _knots_between(values, knots)
    if not len(knot_index):
        return *no_jumps, remark or law_remark
    times = _crossings(leader, knots[knot_index], looks[cell], looks[cell + 1], leader_values)
    is_inside = (times > first - SLACK * step) & (times < last + SLACK * step)
    sequence = np.flatnonzero(is_inside)[np.argsort(times[is_inside])]
    knot_index, cell, times = knot_index[sequence], cell[sequence], np.clip(times[sequence], first, last)
    leader_jet = leader_values.coefficients(leader, times, order)
    change = _composed(jumps[:, knot_index], np.stack([0 * times, *leader_jet[1:]]))  # exactly at the knot
    bounds = _composed(np.abs(jumps), np.stack([0.0, *peaks[1:]])[:, None])[:, knot_index]
    direction = np.where(values[cell] < knots[knot_index], 1.0, -1.0)
    return times, np.where(np.abs(change) <= 1e-9 * bounds, 0.0, direction * change), remark or law_remark


def _knots_between(
    values: Float[np.ndarray, " look"], knots: Float[np.ndarray, " knot"]
) -> tuple[Int[np.ndarray, " crossing"], Int[np.ndarray, " crossing"]]:
    """Return the knots between consecutive values, and the index of the value before; non-finite values pass none."""
    sequence = np.argsort(knots)
    low, high = np.minimum(values[:-1], values[1:]), np.maximum(values[:-1], values[1:])
    start, stop = (np.searchsorted(knots[sequence], x, side="right") for x in (low, high))
    count = np.where(np.isfinite(low) & np.isfinite(high), stop - start, 0)
    cells = np.repeat(np.arange(len(count)), count)
    offset = np.arange(len(cells)) - np.repeat(np.cumsum(count) - count, count)
    return sequence[start[cells] + offset], cells


def _composed(
    jump: Float[np.ndarray, "levels crossing"], distance: Float[np.ndarray, "levels #crossing"]
) -> Float[np.ndarray, "levels crossing"]:
    """Return time derivatives of polynomials of a leader's distance, given their derivatives at zero and its jet."""
    levels = len(jump)
    change = np.zeros(jump.shape)
    for level in range(levels - 1, -1, -1):
        change = np.stack([sum(distance[k - j] * change[j] for j in range(k + 1)) for k in range(levels)])
        change[0] += jump[level] / math.factorial(level)
    return change * np.array([math.factorial(k) for k in range(levels)], float)[:, None]


def _crossings(
    leader: AbstractMotion, knots: np.ndarray, low: np.ndarray, high: np.ndarray, leader_values: LeaderValues
) -> np.ndarray:
    """Return the instants at which a leader passes values, each within a bracket, to rounding.

    Many instants are evaluated together: around the secant estimate, and evenly over the bracket.
    """
    columns, count = np.arange(len(knots)), len(AMONG) + 2 * len(CLOSE) + 1

    def distance(instants: np.ndarray) -> np.ndarray:
        return leader_values.coefficients(leader, instants.reshape(-1))[0].reshape(instants.shape) - knots

    low_values, high_values = distance(low), distance(high)
    starts_below = low_values < 0
    for _ in range(STEPS):
        width = high - low
        if (width <= 4 * np.spacing(np.maximum(np.abs(low), np.abs(high)))).all():
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            estimate = np.nan_to_num(low_values / (low_values - high_values), nan=0.5, posinf=1.0, neginf=0.0)
        nearby = np.clip(estimate + np.concatenate([-CLOSE, [0.0], CLOSE])[:, None], 0.0, 1.0)
        fractions = np.sort(np.concatenate([np.broadcast_to(AMONG[:, None], (len(AMONG), len(knots))), nearby]), axis=0)
        instants = np.concatenate([low[None], low + fractions * width, high[None]])
        values = np.concatenate([low_values[None], distance(instants[1:-1]), high_values[None]])
        is_before = (values[1:-1] < 0) == starts_below
        first = np.where(is_before.all(axis=0), count, np.argmin(is_before, axis=0))  # last before the passage
        low, high = instants[first, columns], instants[first + 1, columns]
        low_values, high_values = values[first, columns], values[first + 1, columns]
    return high
