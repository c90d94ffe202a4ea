"""Kinks and jumps of forces and laws, found where the series of a step does not continue that of the previous step.

On either side of a kink of a force the motion is analytic, and the accelerations of both sides agree at the kink. The
instant of the kink therefore follows, to rounding, from the series of the step over it and of the next step.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy.polynomial.polynomial import polyder, polyval

from jounce.integrate.marching.marching import DenseOutput

SLIGHT = 1e-12  # of accelerations: rounding
FAINT = 1e-9  # of velocities, accelerations and jerks: a smaller difference does not count
PLAIN = 1e-3  # of jerks: least difference at a kink that no step noted, because a step begins exactly at it
ASIDE = 1e-3  # of a step: largest error of the instant of a kink
ALIKE = 0.1  # of a difference: its largest variation along a step over a kink or a jump
LAST = 4  # terms of a series that estimate its truncation error
BEYOND = 100.0  # times these terms: a larger difference is a jump
ROUNDS = 3  # Newton iterations


Terms = Float[np.ndarray, "order part"]
"""Taylor coefficients of velocities, rad/s or sizes of the mechanism by s."""


class Break(NamedTuple):
    """A kink or a jump.

    Attributes
    ----------
    step : int
        Number of the step that goes over it.
    order : int
        The lowest time derivative of positions that jumps: 1 for a kink of a motion law, 2 for a jump of a force, 3 for
        a kink of a force.
    since : float
        Time from the beginning of the step, s; the end of the step for jumps of forces or laws.
    velocity, spin : array of shape (components, bodies)
        Weights of the difference of accelerations before and after the kink; the weighted sum has the slope 1/s in time
        and vanishes at the kink.
    """

    step: int
    order: int
    since: float
    velocity: Float[np.ndarray, "component body"]
    spin: Float[np.ndarray, "component body"]


def breaks(dense: DenseOutput, length: float) -> list[Break]:
    """Return the kinks and jumps within steps, or between them.

    Parameters
    ----------
    dense : DenseOutput
        The steps.
    length : float
        Size of the mechanism, m.
    """
    velocity, spin = (np.asarray(part) for part in dense.polynomial[2:])
    parts = [(velocity / length).reshape(*velocity.shape[:2], -1), spin.reshape(*spin.shape[:2], -1)]
    series, breaks_found = np.concatenate(parts, axis=2), []
    if series.shape[1] <= LAST:
        return []
    largest = [float(np.nanmax(np.abs(series[:, k]), initial=0.0)) for k in range(3)]
    for step in np.flatnonzero((dense.kink[:-1] >= 0) | _jerk_jumps(series, dense.length, largest[2])).tolist():
        span, noted = float(dense.length[step]), bool(dense.kink[step] >= 0)
        order, time, weight = _between(series[step], series[step + 1], span, noted, largest)
        if order:
            weights = weight[: parts[0].shape[2]] / length, weight[parts[0].shape[2] :]
            shaped = (w.reshape(part.shape[2:]) for w, part in zip(weights, (velocity, spin), strict=True))
            breaks_found.append(Break(step, order, time, *shaped))
    return breaks_found


def _jerk_jumps(
    series: Float[np.ndarray, "step order part"], length: Float[np.ndarray, " step"], largest: float
) -> Bool[np.ndarray, " step-1"]:
    """Return for all steps but the last whether the jerk at the end clearly differs from that of the next step."""
    orders = np.arange(2, series.shape[1])
    with np.errstate(all="ignore"):
        factors = orders * (orders - 1) * np.asarray(length)[:-1, None] ** (orders - 2)
        ends = np.sum(factors[..., None] * series[:-1, 2:], axis=1)
        return np.abs(ends - 2.0 * series[1:, 2]).max(axis=1) > PLAIN * largest


def _between(
    before: Terms, after: Terms, span: float, noted: bool, largest: list[float]
) -> tuple[int, float, Float[np.ndarray, " part"]]:
    """Return the lowest derivative that jumps from one step to the next or 0, its time, and the weights of a kink.

    A step is `noted` if the lookahead found it to cross a kink or jump. `largest` has the largest sizes of the first
    coefficients in the whole run.
    """
    none = np.zeros(before.shape[1])
    if not (span and np.isfinite(before).all() and np.isfinite(after).all()):
        return 0, span, none

    def gap(time: float, level: int) -> Float[np.ndarray, " part"]:
        return _derivative(before, time, level) - _derivative(after, time - span, level)

    def stays(level: int) -> bool:
        """Return whether the difference is constant along the step, as at a jump but not at the foot of a pulse."""
        last_gap = gap(span, level)
        return bool(np.abs(gap(0.0, level) - last_gap).max() <= ALIKE * np.abs(last_gap).max())

    def differ(level: int, bound: float) -> bool:
        return bool(np.abs(gap(span, level)).max() > bound + BEYOND * _left_out(before, span, level))

    sizes = [max(np.abs(_derivative(before, span, k)).max(), np.abs(after[k]).max() * k) for k in range(3)]
    if noted and differ(0, FAINT * largest[0] + SLIGHT) and stays(0):
        return 1, span, none
    for order in (3, 4):
        bend = gap(span, order - 1)
        square = max(float(bend @ bend), 1e-300)
        time = span
        for _ in range(ROUNDS):
            time -= float(gap(time, order - 2) @ bend) / square
            time = min(max(time / span, -1.0), 2.0) * span
        size = math.sqrt(square)
        limit = ASIDE * size * abs(span) + BEYOND * SLIGHT * sizes[1]
        margin = ASIDE if noted else SLIGHT
        low = -margin if noted else 1.0 - margin  # an unnoted kink can only be between steps
        inside = low <= time / span <= 1.0 + margin and np.abs(gap(time, order - 2)).max() <= limit
        inside = inside and np.abs(gap(time, order - 1) - bend).max() <= ALIKE * size
        sharp = size * abs(span) > SLIGHT * largest[1] and differ(2, FAINT * sizes[2] if noted else PLAIN * largest[2])
        if order == 3 and inside and sharp:
            time = min(max(time / span, 0.0), 1.0) * span
            bend = gap(time, 2)
            return 3, time, bend / float(bend @ bend)
        if inside and np.abs(gap(time, 1)).max() <= ASIDE * size * abs(span) ** (order - 2) + SLIGHT * largest[1]:
            return 0, span, none
    return (2, span, none) if noted and differ(1, FAINT * largest[1]) and stays(1) else (0, span, none)


def _left_out(series: Terms, time: float, level: int) -> float:
    """Return the size of the last terms of a derivative of a series, as an estimate of the truncation error."""
    orders = np.flatnonzero(np.abs(series).max(axis=1))[-LAST:]
    orders = orders[orders >= max(level, len(series) // 2)]
    factors = np.array([math.perm(int(k), level) for k in orders], float)
    terms = factors * abs(time) ** (orders - level).astype(float) * np.abs(series[orders]).max(axis=1)
    return float(terms.max(initial=0.0))


def _derivative(series: Terms, time: float, level: int) -> Float[np.ndarray, " part"]:
    """Return a derivative of series at a time from their beginning."""
    return np.asarray(polyval(time, polyder(series, level)))
