"""Jumps of derivatives found from values of a law, for laws whose breaks are not known.

A law is analytic between its breaks: there, its Taylor series from both ends of a short cell agree. A cell in which
they do not is halved until they do, or until its ends differ by little more than rounding. The remaining cells are
examined from both sides: series from there give the derivatives on either side of the jump.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

LOOKS = 2001  # instants at which a law is evaluated first; the cells between them are halved
BENT = 0.2  # fraction of the change over a cell: at a jump, the slopes at both ends leave more unexplained
FAINT = 1e-5  # fraction of the largest value: smaller changes are no jumps
SLIGHT = 1e-7  # fraction of the values nearby: smaller differences are no jumps
CONSTANT = 1e-9  # fraction of the positions over a time scale to the power of the order: rounding of a derivative
FASTEST = 0.01  # this time scale, as a fraction of the duration
RESOLVED = 1e-3  # largest fraction of the last terms in a series that is accurate
SHORTEST = 1e-11  # fraction of the duration: cells this short are not halved
USUAL = 0.998  # quantile of the positions that gives their size: larger values lie beside a pole
LOST = 2  # successive halvings that show only rounding, after which a cell is given up
STEPPED = 4  # successive halvings that show a jump, after which it is certain
HALVINGS = 30  # bisections for the instant of a jump of positions
END = 1e-14  # fraction of the duration: an instant this near to an end of a cell is that end
SHOWN = 0.5, 3.0  # least and largest ratio of the difference of the nearest values on both sides to a jump
ONE_SIDE = 0.01  # fraction of the gap between two series: a value this near to one of them belongs to its side
MOST = 40_000  # cells at a time
HIDDEN = 0.01  # fraction of the duration in which rounding may hide jumps of positions
BLURRED = 1e-3  # fraction of the duration: this near to a jump of a derivative, jumps of higher ones are not seen
FARTHEST = 1 / 4  # fraction of the duration: largest distance of a side from a jump
STRIDE = 1.9  # ratio of the distances of successive sides; with a power of two, their rounding would be the same
LIMITS = (1e-6, 1e-3, 1e-2)  # fractions of a derivative by which four successive sides may differ about a limit
FURTHER = 6  # successive sides over which an infinite derivative
GROWTH = 1.02  # becomes smaller by more than this factor
CLEAR = 4  # ratio of a gap to the last terms of series, above which the series differ
MARGIN = 10  # ratio of a change to its error, above which it is a jump

Evaluation = Callable[[Float[np.ndarray, " time"]], Float[np.ndarray, "time level joint"]]


class SeenJumps(NamedTuple):
    """Where derivatives jump.

    Attributes
    ----------
    instants : array of shape (jump,)
        Increasing instants, s.
    sizes : array of shape (jump, order + 1, joint)
        Jump of each derivative: infinite where it has no limit on a side, 0 where it does not jump.
    everywhere : bool
        Whether all of the interval was examined, as a law may vary too fast in a part of it.
    """

    instants: Float[np.ndarray, " jump"]
    sizes: Float[np.ndarray, "jump level joint"]
    everywhere: bool


def level_sizes(values: Float[np.ndarray, "time level joint"], duration: float) -> Float[np.ndarray, "level joint"]:
    """Return the size of each derivative; one that is small beside a lower one over the whole time is rounding."""
    peaks = np.abs(values).max(axis=0)
    sizes = peaks.copy()
    for level in range(2, len(sizes)):
        sizes[level] = np.maximum(peaks[level], sizes[level - 1] / duration)
    return sizes


def unexplained(
    instants: Float[np.ndarray, " time"],
    values: Float[np.ndarray, "time level joint"],
    sizes: Float[np.ndarray, "level #joint"],
) -> Bool[np.ndarray, "cell level-1 joint"]:
    """Return in which cells derivatives change by more than their slopes at both ends explain.

    Parameters
    ----------
    instants : array of shape (time,)
        Ends of the cells.
    values : array of shape (time, level, joint)
        Derivatives at the ends; the highest one serves only as slope.
    sizes : array of shape (level, joint) or (level, 1)
        Sizes of the derivatives from `level_sizes`.
    """
    step = np.diff(instants)[:, None, None]
    change, slopes = np.diff(values[:, :-1], axis=0), values[:, 1:]
    remainder = np.abs(change - (slopes[1:] + slopes[:-1]) * step / 2)  # part that no slope explains
    bends = step * np.abs(np.diff(slopes, axis=0))  # part that a jump of the slope explains
    return (remainder > BENT * np.abs(change)) & (remainder > FAINT * sizes[:-1]) & (remainder > bends)


def seen_jumps(evaluate: Evaluation, first: float, last: float, order: int) -> SeenJumps:
    """Return the instants at which derivatives up to an order jump in an interval, by their values, and the jumps.

    Parameters
    ----------
    evaluate : callable
        Maps instants, (time,), to derivatives, (time, level, joint), of which those above the order serve for series:
        three of them, if they can be had.
    first, last : float
        s.
    order : int
        Of the highest derivative whose jumps count.

    Examples
    --------
    >>> import numpy as np
    >>> def kink(t):
    ...     return np.stack([np.abs(t - 0.3), np.sign(t - 0.3), 0 * t, 0 * t], axis=1)[..., None]
    >>> seen = seen_jumps(kink, 0.0, 1.0, 1)
    >>> seen.instants.round(9).tolist(), seen.sizes[..., 0].round(9).tolist()
    ([0.3], [[0.0, 2.0]])
    """
    with np.errstate(all="ignore"):  # next to instants without derivatives
        cells, everywhere = _unsettled_cells(evaluate, first, last, order)
        limits = _limits(evaluate, cells, first, last)
        middle = (cells.low + cells.high) / 2
        jumps = limits.jumps
        levels = np.argmax(np.any(jumps != 0, axis=2), axis=1)
        rows = np.arange(len(middle))
        joint = np.argmax(np.abs(jumps[rows, levels]), axis=1) if len(rows) else rows
        gaps = limits.changes[rows, np.maximum(levels - 1, 0), joint]
        width = cells.high - cells.low  # a cell stays long where rounding hides the instant
        reach = np.where(width > MARGIN * SHORTEST * (last - first), MARGIN * width, width)
        shift = np.where(levels > 0, -gaps / jumps[rows, levels, joint], 0.0)  # the derivative below is continuous
        shift = np.where(np.abs(shift) <= reach, shift, 0.0)
        wider = np.abs(shift)
        shifted = cells._replace(low=cells.low + shift - wider, high=cells.high + shift + wider)
        jumps = np.where(shift[:, None, None] != 0, _limits(evaluate, shifted, first, last).jumps, jumps)
        jumping = (levels == 0) & np.isfinite(jumps[:, 0]).all(axis=1)
        ends = _passed(evaluate, cells.low[jumping], cells.high[jumping]) if jumping.any() else 0.0
    instants = np.where(levels > 0, middle + shift, cells.high)
    for end in (cells.low, cells.high):  # many laws bend at such even fractions of the time
        instants = np.where(np.abs(instants - end) <= END * (last - first), end, instants)
    instants[jumping] = ends
    chosen = np.flatnonzero(jumps.any(axis=(1, 2)))
    chosen = chosen[np.argsort(instants[chosen], kind="stable")]
    instants, jumps, width = instants[chosen], jumps[chosen], width[chosen]
    levels = np.argmax(jumps.any(axis=2), axis=1)
    remaining = np.ones(len(chosen), bool)
    for level in range(order):  # beside a jump, higher derivatives have its rounding
        lower = instants[levels == level]
        remaining &= (levels <= level) | (_distances(instants, lower) > BLURRED * (last - first))
    instants, jumps, width = instants[remaining], jumps[remaining], width[remaining]
    distinct = np.diff(instants) - width[1:] - width[:-1] > 2 * SHORTEST * (last - first)
    is_distinct = np.append(True, distinct)[: len(instants)]
    return SeenJumps(instants[is_distinct], jumps[is_distinct], everywhere)


def _passed(evaluate: Evaluation, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the instants by which positions have jumped, each after `low` and not after `high`, to rounding."""
    low_values, high_values = evaluate(low)[:, 0], evaluate(high)[:, 0]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        middle_values = evaluate(middle)[:, 0]
        has_jumped = (np.abs(middle_values - low_values) > np.abs(middle_values - high_values)).any(axis=1)
        low, high = np.where(has_jumped, low, middle), np.where(has_jumped, middle, high)
    return high


def _distances(instants: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return the distances of instants from the nearest of sorted targets; infinity if there are none."""
    if not len(targets):
        return np.full(len(instants), np.inf)
    next_index = np.minimum(np.searchsorted(targets, instants), len(targets) - 1)
    return np.minimum(np.abs(targets[next_index] - instants), np.abs(targets[np.maximum(next_index - 1, 0)] - instants))


class _Cells(NamedTuple):
    """Stretches of time; of the derivatives nearby, `sizes` are those that matter: (cell, order + 1, joint)."""

    low: np.ndarray
    high: np.ndarray
    sizes: np.ndarray


def _unsettled_cells(evaluate: Evaluation, first: float, last: float, order: int) -> tuple[_Cells, bool]:
    """Return the shortest intervals in which series from both ends do not agree, and whether all of them are short."""
    duration = last - first
    nodes = np.linspace(first, last, LOOKS)
    values = evaluate(nodes)
    position = np.nanquantile(np.where(np.isfinite(values[:, 0]), np.abs(values[:, 0]), np.nan), USUAL, axis=0)
    growth = (FASTEST * duration) ** -np.arange(order + 1.0)[:, None]
    cells = _Halved.at(nodes, values, CONSTANT * np.nan_to_num(position) * growth)
    blurred = 0.0
    while True:
        gap, remainders, terms, _, _ = meeting = _between(*cells[:4], order)
        slight = SLIGHT * np.maximum(terms, cells.sizes)
        rough = (gap > CLEAR * remainders + slight) | ((remainders > RESOLVED * terms) & (remainders > slight))
        noise = (cells.noise >= LOST) & (cells.steps < STEPPED)
        noise = np.logical_or.accumulate(noise, axis=1)  # it grows with the order
        rough &= ~noise
        is_known = np.isfinite(cells.left).all(axis=(1, 2)), np.isfinite(cells.right).all(axis=(1, 2))
        is_rough = rough.any(axis=(1, 2)) & is_known[0] & is_known[1]
        blurred += np.sum((cells.high - cells.low)[noise[:, 0].any(axis=1)])
        keep = cells.done | is_rough | (is_known[0] ^ is_known[1])
        cells, rough = _Halved(*(x[keep] for x in cells)), rough[keep]
        width, tick = cells.high - cells.low, 4 * np.spacing(np.maximum(np.abs(cells.low), np.abs(cells.high)))
        cells.done[:] |= width <= np.maximum(SHORTEST * duration, tick)
        if cells.done.all():
            return _rows(cells), bool(blurred <= HIDDEN * duration)
        if 2 * len(cells.low) > MOST:
            return _rows(_Halved(*(x[cells.done] for x in cells))), False
        cells = _halves(cells, evaluate, rough, tuple(x[keep] for x in meeting))


class _Halved(NamedTuple):
    """Cells that are halved, with their ends, the derivatives there, and the sizes of derivatives nearby.

    `noise` counts the successive halvings in which a derivative in the middle belonged to neither end, `steps` those in
    which it belonged to one. Cells that are `done` are not halved any more.
    """

    low: np.ndarray
    high: np.ndarray
    left: np.ndarray
    right: np.ndarray
    sizes: np.ndarray
    noise: np.ndarray
    steps: np.ndarray
    done: np.ndarray

    @classmethod
    def at(cls, nodes: np.ndarray, values: np.ndarray, min_sizes: np.ndarray) -> "_Halved":
        """Return the cells between nodes."""
        levels = len(min_sizes)
        nearby = np.nan_to_num(np.abs(values[:, :levels]), posinf=0.0)
        slopes = np.nan_to_num(np.abs(values[:, 1 : levels + 1]), posinf=0.0)  # of more terms, rounding is too large
        nearby += (nodes[1] - nodes[0]) * slopes
        sizes = np.maximum(nearby[:-1] + nearby[1:], min_sizes / SLIGHT)
        count = np.zeros(sizes.shape, int)
        return cls(
            nodes[:-1], nodes[1:], values[:-1], values[1:], sizes, count, count.copy(), np.zeros(len(sizes), bool)
        )


def _halves(cells: _Halved, evaluate: Evaluation, rough: np.ndarray, meeting: tuple[np.ndarray, ...]) -> _Halved:
    """Return the halves of all cells that are not done, and the cells that are, in the sequence of time."""
    gap, remainders, _, from_left, from_right = meeting
    middle = (cells.low + cells.high) / 2
    middle_values = np.full_like(cells.left, np.nan)
    middle_values[~cells.done] = evaluate(middle[~cells.done])
    middle_terms = middle_values[:, : gap.shape[1]]
    nearer = np.minimum(np.abs(middle_terms - from_left), np.abs(middle_terms - from_right))
    clear = rough & (CLEAR * remainders <= gap)
    step, unassigned = clear & (nearer <= ONE_SIDE * gap), clear & (nearer > ONE_SIDE * gap)
    hidden = unassigned & (cells.steps >= STEPPED) & ~np.logical_or.accumulate(step, axis=1)
    is_lost = hidden.any(axis=(1, 2))  # something jumps there, but rounding hides the instant
    cells = cells._replace(
        noise=np.where(unassigned, cells.noise + 1, 0),
        steps=np.where(unassigned, 0, cells.steps + step),
        done=cells.done | is_lost,
    )
    open_cells = np.flatnonzero(~cells.done)
    firsts = cells._replace(
        high=np.where(cells.done, cells.high, middle),
        right=np.where(cells.done[:, None, None], cells.right, middle_values),
    )
    seconds = _Halved(*(x[open_cells] for x in cells._replace(low=middle, left=middle_values)))
    arrays = [np.concatenate(pair) for pair in zip(firsts, seconds, strict=True)]
    sequence = np.argsort(arrays[0], kind="stable")
    return _Halved(*(x[sequence] for x in arrays))


def _rows(cells: _Halved) -> _Cells:
    """Return neighboring cells joined to one."""
    if not len(cells.low):
        return _Cells(cells.low, cells.high, cells.sizes)
    begins = np.flatnonzero(np.append(True, cells.low[1:] > cells.high[:-1]))
    ends = np.append(begins[1:], len(cells.low)) - 1
    return _Cells(cells.low[begins], cells.high[ends], np.maximum.reduceat(cells.sizes, begins))


def _between(low: np.ndarray, high: np.ndarray, left: np.ndarray, right: np.ndarray, order: int) -> tuple[Any, ...]:
    """Return the gaps between series from both ends of cells in the middle, their last terms, sizes, and both."""
    half = (high - low)[:, None] / 2
    first, second = (_series(values, step, order) for values, step in ((left, half), (right, -half)))
    return np.abs(first[0] - second[0]), first[1] + second[1], first[2] + second[2], first[0], second[0]


def _series(values: np.ndarray, step: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives that Taylor series have a step away, the size of their last terms, and that of all."""
    top = values.shape[1] - 1
    sums, rests, sizes = [], [], []
    for level in range(order + 1):
        factors = [step**k / math.factorial(k) for k in range(top - level + 1)]
        terms = np.stack([factor * values[:, level + k] for k, factor in enumerate(factors)])
        sums.append(terms.sum(axis=0))
        rests.append(np.abs(terms[-2 if len(terms) > 2 else -1 :]).sum(axis=0))
        sizes.append(np.abs(terms).sum(axis=0))
    return np.stack(sums, axis=1), np.stack(rests, axis=1), np.nan_to_num(np.stack(sizes, axis=1), posinf=0.0)


class _Limits(NamedTuple):
    """Changes of derivatives over cells, 0 where they are unknown, and the jumps among them."""

    changes: np.ndarray
    jumps: np.ndarray


def _limits(evaluate: Evaluation, cells: _Cells, first: float, last: float) -> _Limits:
    """Return the jumps of derivatives over short intervals, by series from both sides that lead into their middle."""
    count, levels, joints = cells.sizes.shape
    if not count:
        return _Limits(np.zeros((0, levels, joints)), np.zeros((0, levels, joints)))
    middle, width = (cells.low + cells.high) / 2, cells.high - cells.low
    min_offsets = np.maximum(0.75 * width, 4 * np.spacing(np.maximum(np.abs(cells.low), np.abs(cells.high))))
    sides = int(np.ceil(np.log(FARTHEST * (last - first) / min_offsets.min()) / np.log(STRIDE))) + 1
    offsets = min_offsets[:, None] * STRIDE ** np.arange(max(sides, FURTHER + 1.0))
    left, right = (_limit(evaluate, middle, sign * offsets, cells.sizes, first, last) for sign in (-1.0, 1.0))
    is_known = np.isfinite(left.value) & np.isfinite(right.value)
    changes = np.where(is_known, right.value - left.value, 0.0)
    slopes = np.where(is_known, np.abs(left.value) + np.abs(right.value), 0.0)[:, 1:]
    error = MARGIN * (left.error + right.error) + SLIGHT * cells.sizes
    error[:, :-1] += 2 * width[:, None, None] * slopes
    is_large = np.abs(changes) > error
    ratio = np.abs(right.nearest - left.nearest) / np.abs(changes)[:, None]
    elsewhere = is_large & (ratio < SHOWN[0]).all(axis=1)  # a jump that is not here
    noisy = (ratio > SHOWN[1]).all(axis=1)
    is_large &= ~np.logical_or.accumulate(elsewhere, axis=1) & ~noisy
    infinite = (np.isinf(left.value) & right.defined) | (np.isinf(right.value) & left.defined)
    return _Limits(changes, np.where(infinite, np.inf, np.where(is_large, changes, 0.0)))


class _Side(NamedTuple):
    """Limits of derivatives on a side, infinite or NaN where there is none, the nearest values, and the errors."""

    value: np.ndarray
    nearest: np.ndarray
    error: np.ndarray
    defined: np.ndarray


def _limit(
    evaluate: Evaluation, middle: np.ndarray, offsets: np.ndarray, sizes: np.ndarray, first: float, last: float
) -> _Side:
    """Return the limits of derivatives at instants, by series from offsets to one side, the nearest of them first.

    Near a singular instant, series are inexact by rounding, and far from it by omitted terms. The nearest ones that
    agree count.
    """
    levels, joints = sizes.shape[1:]
    t = middle[:, None] + offsets
    is_within = (t >= first) & (t <= last) & (np.abs(offsets) <= np.maximum(FARTHEST * (last - first), offsets[:, :1]))
    values = evaluate(np.clip(t, first, last).ravel())
    values[~is_within.ravel()] = np.nan
    leads = _series(values, -offsets.reshape(-1, 1), levels - 1)[0].reshape(*t.shape, levels, joints)
    differ = np.abs(np.diff(leads, axis=1))
    larger = np.fmax(np.abs(leads[:, 1:]), np.abs(leads[:, :-1]))
    slight = SLIGHT / MARGIN * sizes[:, None]
    value, error = np.full_like(sizes, np.nan), np.zeros_like(sizes)
    linked = np.ones((*t.shape, joints), bool)  # sides with no other jump between, as lower derivatives show
    for level in range(levels):
        for fraction in reversed(LIMITS):
            pairs = (differ[:, :, level] <= fraction * larger[:, :, level] + slight[:, :, level]) & linked[:, 1:]
            agree = pairs[:, :-2] & pairs[:, 1:-1] & pairs[:, 2:]
            column, has_limit = np.argmax(agree, axis=1)[:, None], agree.any(axis=1)
            spread = np.max(
                [np.take_along_axis(differ[:, :, level], column + k, axis=1)[:, 0] for k in range(3)], axis=0
            )
            limit = np.take_along_axis(leads[:, :, level], column + 1, axis=1)[:, 0]
            value[:, level] = np.where(has_limit, limit, value[:, level])
            error[:, level] = np.where(has_limit, spread, error[:, level])
        tolerance = MARGIN * error[:, level] + LIMITS[0] * np.abs(value[:, level]) + slight[:, 0, level]
        linked &= ~(np.abs(leads[:, :, level] - value[:, None, level]) > tolerance[:, None])
    finite = np.isfinite(leads)
    first_finite = np.argmax(finite, axis=1)[:, None]
    reach = np.minimum(first_finite + np.arange(FURTHER).reshape(1, -1, 1, 1), leads.shape[1] - 1)
    near_values = np.take_along_axis(leads, reach, axis=1)
    grows = (near_values[:, :-1] / near_values[:, 1:] > GROWTH).all(axis=1) & (np.abs(near_values[:, 0]) > sizes)
    value = np.where(np.isnan(value) & grows, np.inf, value)
    defined = 2 * finite.all(axis=(2, 3)).sum(axis=1) > is_within.sum(axis=1)
    return _Side(value, near_values[:, :LOST], error, defined[:, None, None])
