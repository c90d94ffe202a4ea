"""Jumps of derivatives that show in their values: for laws of which nothing says where they have any.

A law is analytic between its breaks: there, its Taylor series from both ends of a short cell agree. A cell in which
they do not is halved until they do, or until it is as short as instants can be told apart. What remains is looked at
from both sides: the series from there lead to the derivatives on either side of it.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

LOOKS = 2001  # at a law, between which cells are halved
BENT = 0.2  # of the change over a cell: what the slopes do not account for, where it is a jump
FAINT = 1e-5  # of the largest value: a smaller jump is none
SLIGHT = 1e-7  # of a derivative nearby: a smaller jump is none
CONSTANT = 1e-9  # of the size of the positions, by a share of the time to the power of the order: their rounding
FASTEST = 0.01  # this share
RESOLVED = 1e-3  # of a derivative: what the last terms of a series are where it counts
SHORTEST = 1e-11  # of the whole time: cells in which a jump is still one
USUAL = 0.998  # of the instants: what is larger at the others is beside a pole
LOST = 2  # halvings in succession that show nothing but rounding
STEPPED = 4  # that show a jump
HALVINGS = 30  # of a stretch in which positions jump
END = 1e-14  # of the whole time: so near to the end of a stretch is there
SHOWN = 0.5, 3.0  # of a jump: what of it the nearest values on both sides show, at least and at most
ONE_SIDE = 0.01  # of how far apart two sides are: so near to one of them is what belongs to it
MOST = 40_000  # cells at a time
HIDDEN = 0.01  # of the whole time: what rounding may hide of positions
BLURRED = 1e-3  # of the whole time: about a jump of a derivative, none of a higher one is seen
FARTHEST = 1 / 4  # of the whole time: how far a side is from what it is a side of, at most
STRIDE = 1.9  # times the distance of a side is that of the next: where it is a power of two, rounding is the same
LIMITS = (1e-6, 1e-3, 1e-2)  # of a derivative: by how much four sides in succession may differ about a limit
FURTHER = 6  # sides in succession over which an infinite derivative
GROWTH = 1.02  # becomes smaller by more than this factor
CLEAR = 4  # times the last terms of series they differ, where they do
MARGIN = 10  # times an error is no jump

Evaluation = Callable[[Float[np.ndarray, " time"]], Float[np.ndarray, "time level joint"]]


class SeenJumps(NamedTuple):
    """Where derivatives jump.

    Attributes
    ----------
    instants : array of shape (jump,)
        In their sequence, s.
    sizes : array of shape (jump, order + 1, joint)
        By how much each derivative jumps: infinite where it has no limit on a side, 0 where it does not jump.
    everywhere : bool
        Whether all of the time could be looked at: what varies too fast could not.
    """

    instants: Float[np.ndarray, " jump"]
    sizes: Float[np.ndarray, "jump level joint"]
    everywhere: bool


def level_sizes(values: Float[np.ndarray, "time level joint"], duration: float) -> Float[np.ndarray, "level joint"]:
    """Return the size of each derivative; one that is small beside a lower one over the whole time is rounding."""
    largest = np.abs(values).max(axis=0)
    sizes = largest.copy()
    for level in range(2, len(sizes)):
        sizes[level] = np.maximum(largest[level], sizes[level - 1] / duration)
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
    off = np.abs(change - (slopes[1:] + slopes[:-1]) * step / 2)  # part that no slope explains
    bends = step * np.abs(np.diff(slopes, axis=0))  # part that a jump of the slope explains
    return (off > BENT * np.abs(change)) & (off > FAINT * sizes[:-1]) & (off > bends)


def seen_jumps(evaluate: Evaluation, first: float, last: float, order: int) -> SeenJumps:
    """Return where derivatives up to an order jump between two instants, by their values, and by how much.

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
    with np.errstate(all="ignore"):  # next to what has no derivatives
        cells, everywhere = _unsettled_cells(evaluate, first, last, order)
        limits = _limits(evaluate, cells, first, last)
        middle = (cells.low + cells.high) / 2
        jumps = limits.jumps
        lowest = np.argmax(np.any(jumps != 0, axis=2), axis=1)
        rows = np.arange(len(middle))
        joint = np.argmax(np.abs(jumps[rows, lowest]), axis=1) if len(rows) else rows
        below = limits.changes[rows, np.maximum(lowest - 1, 0), joint]
        width = cells.high - cells.low  # that of a long one ended where rounding hides the place
        reach = np.where(width > MARGIN * SHORTEST * (last - first), MARGIN * width, width)
        shift = np.where(lowest > 0, -below / jumps[rows, lowest, joint], 0.0)  # the derivative below is continuous
        shift = np.where(np.abs(shift) <= reach, shift, 0.0)
        wider = np.abs(shift)
        again = cells._replace(low=cells.low + shift - wider, high=cells.high + shift + wider)
        jumps = np.where(shift[:, None, None] != 0, _limits(evaluate, again, first, last).jumps, jumps)
        jumping = (lowest == 0) & np.isfinite(jumps[:, 0]).all(axis=1)
        ends = _passed(evaluate, cells.low[jumping], cells.high[jumping]) if jumping.any() else 0.0
    instants = np.where(lowest > 0, middle + shift, cells.high)
    for end in (cells.low, cells.high):  # which are even shares of the time, where many laws bend: but for rounding
        instants = np.where(np.abs(instants - end) <= END * (last - first), end, instants)
    instants[jumping] = ends
    some = np.flatnonzero(jumps.any(axis=(1, 2)))
    some = some[np.argsort(instants[some], kind="stable")]
    instants, jumps, width = instants[some], jumps[some], width[some]
    lowest = np.argmax(jumps.any(axis=2), axis=1)
    remaining = np.ones(len(some), bool)
    for level in range(order):  # beside a jump, higher derivatives have its rounding
        lower = instants[lowest == level]
        remaining &= (lowest <= level) | (_distances(instants, lower) > BLURRED * (last - first))
    instants, jumps, width = instants[remaining], jumps[remaining], width[remaining]
    distinct = np.diff(instants) - width[1:] - width[:-1] > 2 * SHORTEST * (last - first)
    first_ones = np.append(True, distinct)[: len(instants)]
    return SeenJumps(instants[first_ones], jumps[first_ones], everywhere)


def _passed(evaluate: Evaluation, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the instants by which positions have jumped, each after a first and not after a last one, to rounding."""
    before, after = evaluate(low)[:, 0], evaluate(high)[:, 0]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        here = evaluate(middle)[:, 0]
        late = (np.abs(here - before) > np.abs(here - after)).any(axis=1)
        low, high = np.where(late, low, middle), np.where(late, middle, high)
    return high


def _distances(instants: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return how far instants are from the nearest of others, in their sequence; infinity if there are none."""
    if not len(others):
        return np.full(len(instants), np.inf)
    after = np.minimum(np.searchsorted(others, instants), len(others) - 1)
    return np.minimum(np.abs(others[after] - instants), np.abs(others[np.maximum(after - 1, 0)] - instants))


class _Cells(NamedTuple):
    """Stretches of time; of the derivatives nearby, `sizes` are those that matter: (cell, order + 1, joint)."""

    low: np.ndarray
    high: np.ndarray
    sizes: np.ndarray


def _unsettled_cells(evaluate: Evaluation, first: float, last: float, order: int) -> tuple[_Cells, bool]:
    """Return the shortest stretches in which series from both ends do not agree, and whether all of them are short."""
    duration = last - first
    nodes = np.linspace(first, last, LOOKS)
    values = evaluate(nodes)
    position = np.nanquantile(np.where(np.isfinite(values[:, 0]), np.abs(values[:, 0]), np.nan), USUAL, axis=0)
    growth = (FASTEST * duration) ** -np.arange(order + 1.0)[:, None]
    cells = _Halved.at(nodes, values, CONSTANT * np.nan_to_num(position) * growth)
    blurred = 0.0
    while True:
        gap, rest, terms, _, _ = meeting = _between(*cells[:4], order)
        slight = SLIGHT * np.maximum(terms, cells.sizes)
        rough = (gap > CLEAR * rest + slight) | ((rest > RESOLVED * terms) & (rest > slight))
        noise = (cells.noise >= LOST) & (cells.steps < STEPPED)
        noise = np.logical_or.accumulate(noise, axis=1)  # it grows with the order
        rough &= ~noise
        known = np.isfinite(cells.left).all(axis=(1, 2)), np.isfinite(cells.right).all(axis=(1, 2))
        some = rough.any(axis=(1, 2)) & known[0] & known[1]
        blurred += np.sum((cells.high - cells.low)[noise[:, 0].any(axis=1)])
        keep = cells.done | some | (known[0] ^ known[1])
        cells, rough = _Halved(*(x[keep] for x in cells)), rough[keep]
        width, tick = cells.high - cells.low, 4 * np.spacing(np.maximum(np.abs(cells.low), np.abs(cells.high)))
        cells.done[:] |= width <= np.maximum(SHORTEST * duration, tick)
        if cells.done.all():
            return _rows(cells), bool(blurred <= HIDDEN * duration)
        if 2 * len(cells.low) > MOST:
            return _rows(_Halved(*(x[cells.done] for x in cells))), False
        cells = _halves(cells, evaluate, rough, tuple(x[keep] for x in meeting))


class _Halved(NamedTuple):
    """Cells that are halved: their ends, the derivatives there, how large these are nearby, and what was seen.

    `noise` counts how often in succession a derivative in the middle was that of neither end, `steps` how often it was
    that of one; `done` are those that are not halved any more.
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
    def at(cls, nodes: np.ndarray, values: np.ndarray, least: np.ndarray) -> "_Halved":
        """Return the cells between nodes."""
        levels = len(least)
        nearby = np.nan_to_num(np.abs(values[:, :levels]), posinf=0.0)
        slopes = np.nan_to_num(np.abs(values[:, 1 : levels + 1]), posinf=0.0)  # of more terms, rounding is too large
        nearby += (nodes[1] - nodes[0]) * slopes
        sizes = np.maximum(nearby[:-1] + nearby[1:], least / SLIGHT)
        count = np.zeros(sizes.shape, int)
        return cls(
            nodes[:-1], nodes[1:], values[:-1], values[1:], sizes, count, count.copy(), np.zeros(len(sizes), bool)
        )


def _halves(cells: _Halved, evaluate: Evaluation, rough: np.ndarray, meeting: tuple[np.ndarray, ...]) -> _Halved:
    """Return the halves of all cells that are not done, and the others, in the sequence of time."""
    gap, rest, _, forth, back = meeting
    middle = (cells.low + cells.high) / 2
    between = np.full_like(cells.left, np.nan)
    between[~cells.done] = evaluate(middle[~cells.done])
    here = between[:, : gap.shape[1]]
    nearer = np.minimum(np.abs(here - forth), np.abs(here - back))
    clear = rough & (CLEAR * rest <= gap)
    step, neither = clear & (nearer <= ONE_SIDE * gap), clear & (nearer > ONE_SIDE * gap)
    hidden = neither & (cells.steps >= STEPPED) & ~np.logical_or.accumulate(step, axis=1)
    lost = hidden.any(axis=(1, 2))  # that something jumps is known, rounding hides where
    cells = cells._replace(
        noise=np.where(neither, cells.noise + 1, 0),
        steps=np.where(neither, 0, cells.steps + step),
        done=cells.done | lost,
    )
    split = np.flatnonzero(~cells.done)
    firsts = cells._replace(
        high=np.where(cells.done, cells.high, middle),
        right=np.where(cells.done[:, None, None], cells.right, between),
    )
    seconds = _Halved(*(x[split] for x in cells._replace(low=middle, left=between)))
    both = [np.concatenate(parts) for parts in zip(firsts, seconds, strict=True)]
    sequence = np.argsort(both[0], kind="stable")
    return _Halved(*(x[sequence] for x in both))


def _rows(cells: _Halved) -> _Cells:
    """Return cells that stand side by side as one."""
    if not len(cells.low):
        return _Cells(cells.low, cells.high, cells.sizes)
    begins = np.flatnonzero(np.append(True, cells.low[1:] > cells.high[:-1]))
    ends = np.append(begins[1:], len(cells.low)) - 1
    return _Cells(cells.low[begins], cells.high[ends], np.maximum.reduceat(cells.sizes, begins))


def _between(low: np.ndarray, high: np.ndarray, left: np.ndarray, right: np.ndarray, order: int) -> tuple[Any, ...]:
    """Return how far apart series from both ends of cells are in the middle, their last terms, sizes, and both."""
    half = (high - low)[:, None] / 2
    forth, back = (_series(values, step, order) for values, step in ((left, half), (right, -half)))
    return np.abs(forth[0] - back[0]), forth[1] + back[1], forth[2] + back[2], forth[0], back[0]


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
    """What derivatives do at stretches: how they change, 0 where that is unknown, and by how much of it they jump."""

    changes: np.ndarray
    jumps: np.ndarray


def _limits(evaluate: Evaluation, cells: _Cells, first: float, last: float) -> _Limits:
    """Return how derivatives jump over stretches of time, by series from both sides that lead into their middle."""
    count, levels, joints = cells.sizes.shape
    if not count:
        return _Limits(np.zeros((0, levels, joints)), np.zeros((0, levels, joints)))
    middle, width = (cells.low + cells.high) / 2, cells.high - cells.low
    nearest = np.maximum(0.75 * width, 4 * np.spacing(np.maximum(np.abs(cells.low), np.abs(cells.high))))
    sides = int(np.ceil(np.log(FARTHEST * (last - first) / nearest.min()) / np.log(STRIDE))) + 1
    offsets = nearest[:, None] * STRIDE ** np.arange(max(sides, FURTHER + 1.0))
    before, after = (_limit(evaluate, middle, sign * offsets, cells.sizes, first, last) for sign in (-1.0, 1.0))
    known = np.isfinite(before.value) & np.isfinite(after.value)
    changes = np.where(known, after.value - before.value, 0.0)
    slopes = np.where(known, np.abs(before.value) + np.abs(after.value), 0.0)[:, 1:]
    error = MARGIN * (before.error + after.error) + SLIGHT * cells.sizes
    error[:, :-1] += 2 * width[:, None, None] * slopes
    large = np.abs(changes) > error
    shown = np.abs(after.nearest - before.nearest) / np.abs(changes)[:, None]
    elsewhere = large & (shown < SHOWN[0]).all(axis=1)  # a jump that is not here
    noisy = (shown > SHOWN[1]).all(axis=1)
    large &= ~np.logical_or.accumulate(elsewhere, axis=1) & ~noisy
    infinite = (np.isinf(before.value) & after.defined) | (np.isinf(after.value) & before.defined)
    return _Limits(changes, np.where(infinite, np.inf, np.where(large, changes, 0.0)))


class _Side(NamedTuple):
    """The limits of derivatives on a side, infinite or NaN where there is none, and what is nearest; their errors."""

    value: np.ndarray
    nearest: np.ndarray
    error: np.ndarray
    defined: np.ndarray


def _limit(
    evaluate: Evaluation, middle: np.ndarray, offsets: np.ndarray, sizes: np.ndarray, first: float, last: float
) -> _Side:
    """Return the limits of derivatives at instants, by series from offsets to one side, the nearest of them first.

    Near to what is singular, series have its rounding; far from it, they leave something out. The nearest ones that
    agree count.
    """
    levels, joints = sizes.shape[1:]
    at = middle[:, None] + offsets
    within = (at >= first) & (at <= last) & (np.abs(offsets) <= np.maximum(FARTHEST * (last - first), offsets[:, :1]))
    values = evaluate(np.clip(at, first, last).ravel())
    values[~within.ravel()] = np.nan
    leads = _series(values, -offsets.reshape(-1, 1), levels - 1)[0].reshape(*at.shape, levels, joints)
    differ = np.abs(np.diff(leads, axis=1))
    larger = np.fmax(np.abs(leads[:, 1:]), np.abs(leads[:, :-1]))
    slight = SLIGHT / MARGIN * sizes[:, None]
    value, error = np.full_like(sizes, np.nan), np.zeros_like(sizes)
    same = np.ones((*at.shape, joints), bool)  # sides with no other jump between, as lower derivatives show
    for level in range(levels):
        for share in reversed(LIMITS):
            pairs = (differ[:, :, level] <= share * larger[:, :, level] + slight[:, :, level]) & same[:, 1:]
            agree = pairs[:, :-2] & pairs[:, 1:-1] & pairs[:, 2:]
            which, some = np.argmax(agree, axis=1)[:, None], agree.any(axis=1)
            spread = np.max(
                [np.take_along_axis(differ[:, :, level], which + k, axis=1)[:, 0] for k in range(3)], axis=0
            )
            limit = np.take_along_axis(leads[:, :, level], which + 1, axis=1)[:, 0]
            value[:, level] = np.where(some, limit, value[:, level])
            error[:, level] = np.where(some, spread, error[:, level])
        bound = MARGIN * error[:, level] + LIMITS[0] * np.abs(value[:, level]) + slight[:, 0, level]
        same &= ~(np.abs(leads[:, :, level] - value[:, None, level]) > bound[:, None])
    finite = np.isfinite(leads)
    nearest = np.argmax(finite, axis=1)[:, None]
    reach = np.minimum(nearest + np.arange(FURTHER).reshape(1, -1, 1, 1), leads.shape[1] - 1)
    near = np.take_along_axis(leads, reach, axis=1)
    grows = (near[:, :-1] / near[:, 1:] > GROWTH).all(axis=1) & (np.abs(near[:, 0]) > sizes)
    value = np.where(np.isnan(value) & grows, np.inf, value)
    defined = 2 * finite.all(axis=(2, 3)).sum(axis=1) > within.sum(axis=1)
    return _Side(value, near[:, :LOST], error, defined[:, None, None])
