"""Instants at which laws of joints interpolate an exact motion closely, and kinks between them."""

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from jounce.errors import TrajectoryError
from jounce.trajectory import HermiteMotion
from jounce.trajectory.motion import SplineMotion
from jounce.units.instants import time_text

SHARES = np.array([0.04, 0.15, 0.29, 0.43, 0.57, 0.71, 0.85, 0.96])  # positions in an interval where laws are compared
NEAR = 1e-9  # rad or m, or fraction of the largest coordinate: largest error of the laws
SHORT = 2.0**-17  # fraction of the duration: a kink is sought in intervals that would have to be shorter
SIDE = 1e-9  # fraction of the duration: distance from a kink at which its sides are evaluated
ROUNDS = 64
MOST = 20000  # instants
KINKED = 1e-6  # fraction of the largest derivative: smaller jumps do not count
STEPS = 4  # of Newton's method

_Times = Float[np.ndarray, " _"]
_Motion = Float[np.ndarray, "_ derivative joint"]


def followed_closely(exact: Callable[[_Times], _Motion], times: _Times, jumps: _Times) -> tuple[_Times, _Motion]:
    """Return instants and derivatives whose `HermiteMotion` is near an exact motion everywhere.

    Parameters
    ----------
    exact : callable
        Returns coordinates and their derivatives at instants.
    times : array of shape (time,)
        First instants, increasing.
    jumps : array of shape (kinks,)
        Instants at which derivatives may jump.

    Returns
    -------
    times : array of shape (instants,)
        Instants; one at which derivatives jump occurs twice, with the derivatives on its left side first.
    q : array of shape (instants, derivative, joint)

    Raises
    ------
    TrajectoryError
        If the instants do not increase, or polynomials do not approach the motion; the message gives the instant.
    """
    if len(times) < 2 or (np.diff(times) <= 0).any():
        raise TrajectoryError("laws need two instants at least, which increase", name="time", value=times.tolist()[:5])
    duration = float(times[-1] - times[0])
    values = exact(times)
    limit = NEAR * max(1.0, float(np.abs(values[:, 0]).max()))
    side = SIDE * duration
    start_values, stop_values = exact(times[[0, -1]] + [side, -side])[:, None]
    end_values = np.concatenate([_shifted(start_values, -side), _shifted(stop_values, side)])
    differing = np.flatnonzero(_jumped(values[[0, -1]], end_values))  # a law may be constant beyond its ends
    values[-differing] = end_values[differing]
    kinks = _Kinks(exact, side)
    kinks.add(jumps[(jumps > times[0] + 2 * side) & (jumps < times[-1] - 2 * side)], only_if_kinked=True)
    nodes, q = times, values
    finished = np.zeros((0, 2))  # intervals with small errors
    for _ in range(ROUNDS):
        instants, rows = kinks.among(nodes, q)
        intervals = np.stack([instants[:-1], instants[1:]], axis=1)
        is_open = (intervals[:, 1] > intervals[:, 0]) & ~_among(intervals, finished)
        if not is_open.any():
            return instants, rows
        missed, worst_times = _missed(exact, instants, rows, is_open)
        failing = np.flatnonzero(is_open)[missed > limit]
        finished = np.concatenate([finished, intervals[is_open][missed <= limit]])
        if not len(failing):
            return instants, rows
        too_short = failing[intervals[failing, 1] - intervals[failing, 0] <= SHORT * duration]
        if len(too_short):
            at_kinks = np.array([_kink(exact, instants[k : k + 2], rows[k : k + 2], limit) for k in too_short.tolist()])
            kinks.add(at_kinks)
            keep = _clear(nodes, times, at_kinks)  # instants added near kinks are no longer needed
            nodes, q = nodes[keep], q[keep]
        failing = np.setdiff1d(failing, too_short)
        if not len(too_short) and len(failing):
            added = worst_times[np.isin(np.flatnonzero(is_open), failing)]  # the instants of the largest errors
            nodes, order = np.unique(np.concatenate([nodes, added]), return_index=True)
            q = np.concatenate([q, exact(added)])[order]
        if len(nodes) > MOST:
            break
    message = (
        f"laws of the joints would need more than {MOST} instants to follow this path; give fewer waves, or use `at`"
    )
    raise TrajectoryError(message, name="time", value=len(nodes))


class _Kinks:
    """Instants at which derivatives jump, and the derivatives on both sides of them."""

    def __init__(self, exact: Callable[[_Times], _Motion], side: float):
        self.exact, self.side = exact, side
        self.times: _Times = np.zeros(0)
        self.before: np.ndarray = np.zeros((0, 0, 0))
        self.after: np.ndarray = self.before

    def add(self, times: _Times, *, only_if_kinked: bool = False) -> None:
        """Add instants, with `only_if_kinked` only those at which a derivative jumps."""
        times = np.unique(times)
        times = times[np.diff(times, prepend=-np.inf) > 2 * self.side]
        added = times[(np.abs(times[:, None] - self.times) > 2 * self.side).all(axis=1)]
        if not len(added):
            return
        sides = self.exact(np.concatenate([added - self.side, added + self.side]))
        before, after = _shifted(sides[: len(added)], self.side), _shifted(sides[len(added) :], -self.side)
        if only_if_kinked:
            jumped = _jumped(before, after)
            added, before, after = added[jumped], before[jumped], after[jumped]
        if len(self.times):
            before, after = np.concatenate([self.before, before]), np.concatenate([self.after, after])
        self.times, self.before, self.after = np.concatenate([self.times, added]), before, after

    def among(self, nodes: _Times, q: _Motion) -> tuple[_Times, _Motion]:
        """Return instants and derivatives merged with the kinks, each twice, which replace instants at kinks."""
        if not len(self.times):
            return nodes, q
        distinct = (np.abs(nodes[:, None] - self.times) > 2 * self.side).all(axis=1)
        times = np.concatenate([nodes[distinct], self.times, self.times])
        rows = np.concatenate([q[distinct], self.before, self.after])
        order = np.argsort(times, kind="stable")  # the left side stays before the right one
        return times[order], rows[order]


def _jumped(left: _Motion, right: _Motion) -> np.ndarray:
    """Return the mask of instants at which derivatives differ by more than rounding."""
    size = np.maximum(np.abs(left), np.abs(right)).max(axis=(0, 2))
    size = np.maximum.accumulate(np.append(1.0, size))[1:, None]
    return np.any(np.abs(right - left) > KINKED * size, axis=(1, 2))


def _shifted(q: _Motion, dt: float) -> _Motion:
    """Return derivatives shifted in time, by their Taylor series."""
    levels = q.shape[1]
    powers = [[dt ** (j - k) / math.factorial(j - k) if j >= k else 0.0 for j in range(levels)] for k in range(levels)]
    return np.einsum("kj,tjn->tkn", np.array(powers), q)


def _missed(
    exact: Callable[[_Times], _Motion], times: _Times, q: _Motion, is_open: np.ndarray
) -> tuple[Float[np.ndarray, " open"], Float[np.ndarray, " open"]]:
    """Return the largest error of the laws in each open interval, and its instant."""
    chosen = np.flatnonzero(is_open)
    steps = times[chosen + 1] - times[chosen]
    looks = times[chosen, None] + SHARES * steps[:, None]
    exact_values = exact(looks.reshape(-1))[:, 0].reshape(len(chosen), len(SHARES), -1)
    deviations = [_within(HermiteMotion(times, column), looks) for column in np.moveaxis(q, -1, 0)]
    missed = np.abs(np.stack(deviations, axis=-1) - exact_values).max(axis=2)
    index = np.argmax(missed, axis=1)[:, None]
    return np.take_along_axis(missed, index, axis=1)[:, 0], np.take_along_axis(looks, index, axis=1)[:, 0]


def _within(law: SplineMotion, looks: np.ndarray) -> np.ndarray:
    """Return the values of a law from its polynomials."""
    begins, powers = np.asarray(law.breakpoints), np.asarray(law.coefficients)
    index = np.clip(np.searchsorted(begins, looks, side="right") - 1, 0, len(begins) - 1)
    local, value = looks - begins[index], powers[-1][index]
    for row in powers[-2::-1]:
        value = value * local + row[index]
    return value


def _kink(exact: Callable[[_Times], _Motion], ends: Float[np.ndarray, " 2"], q: _Motion, limit: float) -> float:
    """Return the instant in a short interval at which the series of its ends meet, where the velocity jumps.

    Raises
    ------
    TrajectoryError
        If the series do not meet, or the motion is not near them.
    """
    joint = int(np.argmax(np.abs(q[1, 1] - q[0, 1])))
    instant = float(ends.mean())
    for _ in range(STEPS):
        left, right = _shifted(q[:1], instant - ends[0])[0], _shifted(q[1:], instant - ends[1])[0]
        slope = right[1, joint] - left[1, joint]
        instant = float(np.clip(instant - (right[0, joint] - left[0, joint]) / slope, *ends)) if slope else instant
    looks = np.sort(np.append(ends[0] + SHARES * (ends[1] - ends[0]), instant))
    left, right = (
        np.concatenate([_shifted(q[k : k + 1], float(step))[:, 0] for step in looks - ends[k]]) for k in range(2)
    )
    errors = np.where(looks[:, None] <= instant, left, right) - exact(looks)[:, 0]
    if not max(np.abs(errors).max(), np.abs(left - right)[looks == instant].max()) <= limit:
        message = (
            "the joints jump, or the path has a spike that is too narrow to be followed, at t = "
            f"{time_text(ends.mean())} s: "
            "give laws that are continuous there, and instants about it"
        )
        raise TrajectoryError(message, name="time", value=float(ends.mean()))
    return instant


def _clear(nodes: _Times, times: _Times, kinks: _Times) -> np.ndarray:
    """Return the mask of instants that were given, or lie away from intervals between given instants with a kink."""
    cells = np.clip(np.searchsorted(times, kinks, side="right") - 1, 0, len(times) - 2)
    cell_of_node = np.clip(np.searchsorted(times, nodes, side="right") - 1, 0, len(times) - 2)
    return np.isin(nodes, times) | ~np.isin(cell_of_node, np.concatenate([cells - 1, cells]))


def _among(intervals: Float[np.ndarray, "interval 2"], finished: Float[np.ndarray, "known 2"]) -> np.ndarray:
    """Return the mask of intervals that are in a second set."""
    sorted_set = np.sort(finished[:, 0] + 1j * finished[:, 1])
    return np.isin(intervals[:, 0] + 1j * intervals[:, 1], sorted_set)
