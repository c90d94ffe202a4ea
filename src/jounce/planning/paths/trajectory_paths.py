"""The path of a trajectory over a parameter in which reversals and stops at corners are smooth.

The length of the path does not depend on the times of the trajectory, but positions have a cusp over it at a turning
point. Near a turning point, the length is therefore a square of the parameter; near a corner at which the trajectory
rests, a higher power. Positions are smooth over this parameter, and a motion whose parameter passes such a point stops
exactly as long as necessary.
"""

import dataclasses
import itertools
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jounce.errors import SampleWarning, TrajectoryError
from jounce.planning.paths.path import Path
from jounce.planning.pieces import JoinedPieces
from jounce.trajectory import AbstractMotion, FollowingMotion, JointTrajectory, SplineMotion
from jounce.trajectory.beyond import ROUNDING

REST_SPEED = 1e-3  # fraction of the largest speed: a trajectory slower than this at its ends rests at them
RESTING = 1e-5  # fraction of the largest speed: a trajectory slower than this between its ends rests
SLOW = 0.2  # fraction of the largest speed below which minima of the speed are refined
INTERVALS = 4000  # intervals of the first sampling of a trajectory
ZOOM, ZOOMS = 9, 20  # instants about each minimum of the speed, and number of refinements
NODES = (250, 500, 1000, 2000)  # nodes of the splines along the whole path, as many as the accuracy needs
PART = 24  # least number of nodes between two stops
NEAR = 1e-9  # fraction of the length: target error of the splines
GAIN = 8.0  # least reduction of the error for twice the nodes
AWAY = 1e-7  # fraction of the length: distance from a stop at which its directions are evaluated
BEND = 2e-3  # rad: smaller changes of direction at a stop do not count
BACK = 0.05  # rad: changes of direction this near to half a turn are reversals
WIDEST = 0.1  # fraction of the length: reach of a power on each side of a stop
CLOSE = 0.125  # fraction of the reach within which a separate piece keeps rounding small
SHORTENED = 4 * ROUNDING  # fraction of the length: more than what counts as rounding where laws choose a piece
FLAT = 4  # continuous derivatives where a power joins the length
DEGREE = 5
TURNING = 1e-2  # fraction of the largest acceleration: with more at a rest, the trajectory reverses smoothly
NEWTON = 12  # steps
HALVINGS = 60  # bisections of the interval that contains the end of a stop
GAUSS_NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)


_Parameters = Float[np.ndarray, " _"]


class Stops(NamedTuple):
    """Turning points and corners of a trajectory: length of the path up to each, and change of direction, rad."""

    lengths: Float[np.ndarray, " stop"]
    turns: Float[np.ndarray, " stop"]


class Ramps:
    """A parameter that grows like the length, except near stops, where the length is a power of it.

    Parameters
    ----------
    stops : array of shape (stop,)
        Lengths at the stops, increasing.
    widths : array of shape (stop,)
        Reach of the power on each side of a stop, as a length.
    power : int
        The power, 2 or higher.
    """

    def __init__(self, stops: np.ndarray, widths: np.ndarray, power: int):
        polynomial = np.polynomial.Polynomial
        slope = (polynomial([0.0] * (power - 2) + [1.0]) * polynomial([1.0, 0.0, -1.0]) ** FLAT).integ()
        self.power, self.share = power, (slope / slope(1.0)).integ()
        self.stops, self.widths = stops, widths
        self.reach = widths / self.share(1.0)
        self.gained = np.append(0.0, np.cumsum(2 * (self.reach - widths)))
        self.centers = stops + self.gained[:-1] + self.reach - widths

    def parameter(self, lengths: np.ndarray) -> Float[np.ndarray, " length"]:
        """Return the parameter at lengths."""
        shifted = lengths + self.gained[np.searchsorted(self.stops, lengths)]
        if not len(self.stops):
            return shifted
        k = np.argmin(np.abs(lengths[:, None] - self.stops), axis=1)
        distance = lengths - self.stops[k]
        target = np.minimum(np.abs(distance), self.widths[k]) / self.reach[k]
        fraction = np.minimum((self.power * target) ** (1 / self.power), 1.0)  # Newton's method descends to the root
        slope = self.share.deriv()
        for _ in range(NEWTON):
            fraction = np.maximum(fraction - (self.share(fraction) - target) / np.maximum(slope(fraction), 1e-300), 0.0)
        is_in_ramp = np.abs(distance) < self.widths[k]
        return np.where(is_in_ramp, self.centers[k] + np.sign(distance) * self.reach[k] * fraction, shifted)

    def motion(self, total: float) -> JoinedPieces:
        """Return the length over the parameter, up to a total length.

        Next to a stop, the length changes by less than its rounding. Before the center, it is reduced by more than
        that, so that a law with a corner at this length turns exactly at the center, where the motion rests.
        """
        begins, polynomials = [0.0], [np.polynomial.Polynomial([0.0, 1.0])]
        for stop, center, reach, width in zip(self.stops, self.centers, self.reach, self.widths, strict=True):
            ramp_down, close, ramp_up = (
                self.share(np.polynomial.Polynomial(x))
                for x in ([1.0, -1.0 / reach], [CLOSE, -1.0 / reach], [0.0, 1.0 / reach])
            )
            begins += [center - reach, center - CLOSE * reach, center, center + reach]
            polynomials += [stop - reach * ramp_down, stop * (1 - SHORTENED) - reach * close, stop + reach * ramp_up]
            polynomials.append(np.polynomial.Polynomial([stop + width, 1.0]))
        height = max(len(p.coef) for p in polynomials)
        powers = np.stack([np.pad(p.coef, (0, height - len(p.coef))) for p in polynomials], axis=1)
        return JoinedPieces(np.array(begins), powers, total + float(self.gained[-1]), "continue")


def path_of_trajectory(trajectory: JointTrajectory, order: int) -> Path:
    """Return the path of a trajectory over its time, if that is a smooth parameter, or over approximately its length.

    Parameters
    ----------
    trajectory : JointTrajectory
        The trajectory; its times are ignored.
    order : int
        Order to which derivatives of the path are continuous where the trajectory stops at a corner.

    Raises
    ------
    TrajectoryError
        If the trajectory does not move.
    """
    path = Path(dict(trajectory.laws), trajectory.start, trajectory.stop)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        times = _instants(path, trajectory.times)
        speeds = _speeds(path, times)
        max_speed = float(np.nanmax(speeds))
        if not max_speed > 0:
            raise TrajectoryError("the path does not move: all its points are the same", name="path")
        rests = _rests(path, times, speeds, RESTING * max_speed)
        if min(speeds[0], speeds[-1]) > REST_SPEED * max_speed and _accelerates_at_rests(path, times, rests):
            return dataclasses.replace(path, passed=(times, times))
        times = np.union1d(times, rests)
        lengths = np.append(0.0, np.cumsum(_between(path, times[:-1], times[1:])))
        stops = _stops(path, times, lengths, rests)
        best = None
        for count in NODES:
            splined = _splined(path, times, lengths, stops, order, count)
            if best is not None and splined.deviation * GAIN > best.deviation:
                break
            best = splined
            if splined.deviation <= NEAR * lengths[-1]:
                break
    assert best is not None
    return best


def stopping(
    path: Path, stops: Float[np.ndarray, " stop"], order: int
) -> tuple[Path, Callable[[_Parameters], _Parameters]]:
    """Return a path over a parameter with which a motion stops at given places, and the function from s to it.

    Parameters
    ----------
    path : Path
        The path.
    stops : array of shape (stop,)
        Parameters of the stops, increasing, within the path.
    order : int
        Order to which derivatives of the motion vanish at the stops.
    """
    lengths, total_length = stops - path.start, path.stop - path.start
    edges = np.concatenate([[0.0], lengths, [total_length]])
    widths = np.minimum(WIDEST * total_length, np.minimum(np.diff(edges)[:-1], np.diff(edges)[1:]) / 2)
    ramps = Ramps(lengths, widths, order + 1)
    motion = ramps.motion(total_length)
    leader = JoinedPieces(motion.breakpoints, _raised(motion.coefficients, path.start), float(motion.stop), "continue")
    laws = {name: FollowingMotion(law, leader) for name, law in path.laws.items()}

    def parameter(s: _Parameters) -> _Parameters:
        return ramps.parameter(np.clip(s - path.start, 0.0, total_length))

    note = f"{path.words}, with {len(stops)} stop{'s' * (len(stops) > 1)} where the load changes" if path.words else ""
    instants = path.instants and (parameter(path.instants[0]), path.instants[1])
    slowed = dataclasses.replace(path, laws=laws, start=0.0, stop=float(leader.stop), instants=instants, words=note)
    return dataclasses.replace(slowed, passed=path.passed and (parameter(path.passed[0]), path.passed[1])), parameter


def _raised(powers: np.ndarray, constant: float) -> np.ndarray:
    """Return polynomials plus a constant."""
    raised = np.array(powers, float)
    raised[0] += constant
    return raised


def turns_back_within(trajectory: JointTrajectory, size: float) -> bool:
    """Return whether a trajectory reverses, or stops at a corner, twice within a path shorter than a size."""
    path = Path(dict(trajectory.laws), trajectory.start, trajectory.stop)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        times = _instants(path, trajectory.times)
        speeds = _speeds(path, times)
        rests = _rests(path, times, speeds, RESTING * float(np.nanmax(speeds)))
        times = np.union1d(times, rests)
        lengths = np.append(0.0, np.cumsum(_between(path, times[:-1], times[1:])))
        edges = [0.0, *_stops(path, times, lengths, rests).lengths, lengths[-1]]
    return len(edges) > 2 and bool(np.diff(edges).min() < size)


def _instants(path: Path, given_instants: np.ndarray) -> Float[np.ndarray, " time"]:
    """Return evenly spaced instants, with the given instants and all breakpoints of laws."""
    knots = [np.asarray(law.breakpoints) for law in path.laws.values() if isinstance(law, SplineMotion)]
    candidates = np.concatenate([np.linspace(path.start, path.stop, INTERVALS + 1), given_instants, *knots])
    instants = np.unique(candidates[(candidates >= path.start) & (candidates <= path.stop)])
    distinct = np.diff(instants, append=np.inf) > 1e-12 * (path.stop - path.start)
    return instants[distinct]


def _speeds(path: Path, times: np.ndarray) -> Float[np.ndarray, " time"]:
    return np.linalg.norm(path.derivatives(times, 1)[:, 1], axis=1)


def _rests(path: Path, times: np.ndarray, speeds: np.ndarray, slow: float) -> Float[np.ndarray, " rest"]:
    """Return the inner instants at which a trajectory rests; a dwell gives many."""
    before, at, after = speeds[:-2], speeds[1:-1], speeds[2:]
    rest_indices = 1 + np.flatnonzero(at <= slow)
    minima = 1 + np.flatnonzero((at <= before) & (at <= after) & (at > slow) & (at < SLOW * speeds.max()))
    if not len(minima):
        return times[rest_indices]
    low, high, best, least = times[minima - 1], times[minima + 1], times[minima], speeds[minima]
    fractions, columns = np.linspace(0.0, 1.0, ZOOM)[:, None], np.arange(len(minima))
    for _ in range(ZOOMS):
        trials = low + fractions * (high - low)
        trial_speeds = _speeds(path, trials.reshape(-1)).reshape(trials.shape)
        top = np.argmin(trial_speeds, axis=0)
        better = trial_speeds[top, columns] < least
        best, least = np.where(better, trials[top, columns], best), np.where(better, trial_speeds[top, columns], least)
        reach = (high - low) / (ZOOM - 1)
        low, high = np.maximum(best - reach, low), np.minimum(best + reach, high)
    return np.union1d(times[rest_indices], best[least <= slow])


def _accelerates_at_rests(path: Path, times: np.ndarray, rests: np.ndarray) -> bool:
    """Return whether a trajectory accelerates wherever it rests, so that its time is a smooth parameter."""
    if not len(rests):
        return True
    typical = np.linalg.norm(path.derivatives(times, 2)[:, 2], axis=1).max()
    second_derivatives = np.linalg.norm(path.derivatives(rests, 2)[:, 2], axis=1)
    return bool(second_derivatives.min() > TURNING * typical)


def _between(path: Path, begins: np.ndarray, ends: np.ndarray) -> Float[np.ndarray, " interval"]:
    """Return the lengths of the path over intervals of time, by Gauss quadrature."""
    half = (ends - begins) / 2
    instants = begins[:, None] + half[:, None] * (1 + GAUSS_NODES)
    return half * (_speeds(path, instants.reshape(-1)).reshape(instants.shape) @ WEIGHTS)


def _stops(path: Path, times: np.ndarray, lengths: np.ndarray, rests: np.ndarray) -> Stops:
    """Return the rests at which the direction changes, each once, however long the trajectory rests."""
    radius = AWAY * lengths[-1]
    positions = lengths[np.searchsorted(times, rests)]
    is_inner = (positions > 8 * radius) & (positions < lengths[-1] - 8 * radius)
    rests, positions = rests[is_inner], positions[is_inner]
    if not len(rests):
        return Stops(positions, positions)
    group = np.cumsum(np.diff(positions, prepend=-np.inf) > radius)
    slowest = np.lexsort((_speeds(path, rests), group))
    representatives = slowest[np.flatnonzero(np.diff(group[slowest], prepend=0))]
    rests, positions = rests[representatives], positions[representatives]
    middle = path.derivatives(rests, 0)[:, 0]
    bounds = np.searchsorted(lengths, positions - 4 * radius) - 1, np.searchsorted(lengths, positions + 4 * radius)
    directions = []
    for side, index in zip((-1.0, 1.0), bounds, strict=True):
        inner, outer = rests, times[index]
        for _ in range(HALVINGS):
            trials = (inner + outer) / 2
            is_outside = np.linalg.norm(path.derivatives(trials, 0)[:, 0] - middle, axis=1) >= radius
            inner, outer = np.where(is_outside, inner, trials), np.where(is_outside, trials, outer)
        displacement = side * (path.derivatives(outer, 0)[:, 0] - middle)
        directions.append(displacement / np.linalg.norm(displacement, axis=1, keepdims=True))
    turns = 2 * np.arcsin(np.clip(np.linalg.norm(directions[1] - directions[0], axis=1) / 2, 0.0, 1.0))
    return Stops(positions[turns > BEND], turns[turns > BEND])


def _splined(path: Path, times: np.ndarray, lengths: np.ndarray, stops: Stops, order: int, count: int) -> Path:
    """Return a path of splines with about the given number of nodes, and exactly through all stops."""
    total_length = float(lengths[-1])
    edges = np.concatenate([[0.0], stops.lengths, [total_length]])
    widths = np.minimum(WIDEST * total_length, np.minimum(np.diff(edges)[:-1], np.diff(edges)[1:]) / 2)
    is_reversal = stops.turns > np.pi - BACK
    ramps = Ramps(stops.lengths[is_reversal], widths[is_reversal], 2)
    own_parameters = ramps.parameter(lengths)
    edges = ramps.parameter(edges)
    counts = np.maximum(PART, np.ceil(count * np.diff(edges) / edges[-1]).astype(int))
    nodes = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(edges[:-1], edges[1:], counts, strict=True)]
    parameters = np.append(np.concatenate(nodes), edges[-1])
    breaks = np.append(0, np.cumsum(counts))
    instants = np.interp(parameters, own_parameters, times)
    instants[breaks] = times[np.searchsorted(own_parameters, edges)]
    indices = np.clip(np.searchsorted(times, instants, side="right") - 1, 0, len(times) - 1)
    knots = ramps.parameter(lengths[indices] + _between(path, times[indices], instants))
    knots[breaks] = edges
    points = path.derivatives(instants, 0)[:, 0]
    laws: dict[str, AbstractMotion]
    if is_reversal.all():
        scale = edges[-1]
        laws = {name: SplineMotion(knots / scale, x, DEGREE) for name, x in zip(path.names, points.T, strict=True)}
        result, positions = Path(laws, 0.0, 1.0), own_parameters / scale
    else:
        joints = breaks[np.concatenate([[True], ~is_reversal, [True]])]
        corners = Ramps(edges[1:-1][~is_reversal], widths[~is_reversal], order + 1)
        leader = corners.motion(float(edges[-1]))
        columns = zip(path.names, points.T, strict=True)
        laws = {name: FollowingMotion(_joined(knots, column, joints), leader) for name, column in columns}
        result, positions = Path(laws, 0.0, float(leader.stop)), corners.parameter(own_parameters)
    positions = np.clip(positions, result.start, result.stop)
    deviations = np.linalg.norm(result.derivatives(positions, 0)[:, 0] - path.derivatives(times, 0)[:, 0], axis=1)
    return dataclasses.replace(result, deviation=float(deviations.max()), passed=(positions, times))


def _joined(knots: np.ndarray, values: np.ndarray, breaks: Int[np.ndarray, " break"]) -> JoinedPieces:
    """Return splines joined at breaks."""
    begins, powers = [], []
    for start, stop in itertools.pairwise(breaks.tolist()):
        spline = SplineMotion(knots[start : stop + 1], values[start : stop + 1], DEGREE)
        begins.append(np.asarray(spline.breakpoints))
        powers.append(np.asarray(spline.coefficients))
    return JoinedPieces(np.concatenate(begins), np.concatenate(powers, axis=1), float(knots[-1]))
