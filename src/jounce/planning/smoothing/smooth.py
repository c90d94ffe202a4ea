"""Smooth motions within a deviation of samples, whose torque rates are those of the motion, not of the noise."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Refused
from jounce.dynamics.limits.trajectories import checked_trajectory
from jounce.errors import RecordingWarning, SolveError, TrajectoryError, warn_caller
from jounce.jet.turns import WHOLE_TURN
from jounce.planning.pieces import SmoothPieces
from jounce.planning.smoothing.bases import DEGREE, whole
from jounce.planning.smoothing.curves import smoothed_curve
from jounce.planning.smoothing.dwells import Dwell, dwells, noise_of, without_margins
from jounce.planning.smoothing.weights import IntervalEstimate, interval_estimates
from jounce.trajectory import AbstractMotion, HermiteMotion, HermiteSplineMotion, JointTrajectory, SplineMotion
from jounce.trajectory.checks import positive
from jounce.trajectory.sample_errors import NOISE_SAFETY, relative_errors
from jounce.trajectory.sampled.deferred import SampledLaw
from jounce.trajectory.splines import local_powers
from jounce.units.instants import time_text

FEWEST = 12  # samples
NEIGHBORS = 4  # samples on either side with which a sample is compared
OUTLYING = 20.0  # ratio of the deviation of an outlier from its neighbors to the largest deviation near it
OUTSIDE = 5.0  # least distance of an outlier, in deviations
WRITTEN = 20.0  # least ratio of a step after repeated samples to the quantization step
CATCHES_UP = 0.6  # least ratio of a step after repeated samples to the next step
SAME = 1e-9  # fraction of the range: smaller differences are rounding of a conversion of units
REPEATED = 0.05  # fraction of the samples: fewer repeated samples may be chance
LONG = 5  # repeated samples that are not chance if the step after them is long
FOLLOWED = 3.0  # ratio of the deviation to the noise below which the motion follows noise
REACHED = 0.999  # fraction of the deviation: a motion as far from a sample is held by the deviation
UNSEEN = 3.0  # time in which a motion may start or end unseen, times the cutoff frequency


@dataclasses.dataclass(frozen=True)
class SmoothedJoint:
    """The results of smoothing the samples of a joint.

    Parameters
    ----------
    noise : float
        Standard deviation of the noise of the samples, including that of their rounding, rad or m.
    away : float
        Largest distance of the motion from a sample, rad or m.
    dwells : tuple of (float, float)
        Start and end of each dwell, s.
    cutoff : tuple of (float, float)
        Lowest and highest cutoff frequency, above which the motion does not follow the samples, Hz.
    standard_errors : tuple of float
        Standard deviations of position, velocity, acceleration and jerk that follow from the noise, in SI units, where
        the motion is fastest. Higher derivatives have none: of the jounce only its integral is known. At the first and
        the last sample of a log that does not rest there, they are 2.7, 6.7, 6.8 and 2.8 times as large. They do not
        contain what a deviation below three times the noise makes the motion follow; `estimate_error` does.
    """

    noise: float
    away: float
    dwells: tuple[tuple[float, float], ...]
    cutoff: tuple[float, float]
    standard_errors: tuple[float, ...]

    def follows_noise(self, deviation: float) -> bool:
        """Return whether a deviation, rad or m, holds the motion closer to its samples than three times their noise."""
        return bool(deviation < FOLLOWED * self.noise and self.away > REACHED * deviation)


class SmoothedTrajectory(JointTrajectory):
    """A trajectory within a deviation of samples.

    Parameters
    ----------
    laws, start, stop, times, measures
        As for `JointTrajectory`.
    deviation : float
        Largest permitted distance from every sample, rad or m.
    joints : dict of str to SmoothedJoint
        The results for each joint.
    """

    def __init__(
        self,
        laws: Mapping[str, object],
        start: float,
        stop: float,
        times: Float[np.ndarray, " sample"],
        measures: Mapping[str, str],
        deviation: float,
        joints: Mapping[str, SmoothedJoint],
    ):
        super().__init__(laws, start, stop, times, measures)
        self.deviation, self.joints = deviation, dict(joints)

    def __reduce__(self) -> tuple[object, ...]:
        state = (self.laws.given(), self.start, self.stop, self.times, dict(self.measures), self.deviation, self.joints)
        return type(self), state


def smooth(trajectory: JointTrajectory | Refused, deviation: float) -> SmoothedTrajectory:
    """Return a smooth motion within a deviation of the samples of a trajectory.

    Splines of degree 7 stay within the deviation of each sample. In each interval, the weight of jounce against
    distance is the one under which the samples are most likely. Where the spline of that weight is too far from a
    sample, the motion is the spline of least cost within the deviation. The motion rests where the samples rest.
    Derivatives to the sixth are continuous, so that torques and their rates are continuous as well.

    Parameters
    ----------
    trajectory : JointTrajectory
        Trajectory through samples, such as a log. Only positions matter, at instants that may be uneven. Laws that do
        not come from samples do not change.
    deviation : float
        Largest distance of the motion from a sample, rad or m, for each joint.

    Returns
    -------
    SmoothedTrajectory
        The motion, with the noise, distance and dwells of each joint.

    Raises
    ------
    TrajectoryError
        If no joint has samples or one has too few, an angle steps by a whole turn, or no motion is within the
        deviation; the message names the joint and the instant.

    Warns
    -----
    RecordingWarning
        If a sample is far from its neighbors, so that the motion moves to it and back, samples repeat the one before
        while the joint moves, or the deviation is so small that the motion follows noise.

    Examples
    --------
    >>> import numpy as np
    >>> import jounce as jn
    >>> t = np.linspace(0.0, 2.0, 401)
    >>> noisy = np.sin(3 * t) + 1e-5 * np.random.default_rng(0).normal(size=t.size)
    >>> log = jn.JointTrajectory.from_samples(t, noisy[:, None], ["axis"])
    >>> motion = jn.smooth(log, deviation=5e-5)
    >>> jerk = motion.derivatives(motion.times, 3)[:, 3, 0]
    >>> bool(abs(np.abs(jerk).max() / 27 - 1) < 0.1)
    True
    """
    deviation = positive("deviation", deviation)
    trajectory = checked_trajectory(trajectory)
    samples = {name: pair for name in trajectory.names if (pair := samples_of(trajectory, name)) is not None}
    if not samples:
        message = "no joint goes through samples; there is nothing to be smoothed"
        raise TrajectoryError(message, name="trajectory", value=list(trajectory.names))
    laws, joints = trajectory.laws.given(), {}
    for name, (times, values) in samples.items():
        try:
            if doubt := _doubt(times, np.asarray(values), deviation):
                warn_caller(RecordingWarning(f"{name}: {doubt}"))
            laws[name], joint = smoothed_samples(times, np.ascontiguousarray(values), deviation)
        except (SolveError, TrajectoryError) as error:
            raise TrajectoryError(error.message, name=name, value=error.value) from None
        joints[name] = joint
        if not doubt and joint.follows_noise(deviation):
            message = (
                f"{name}: the deviation of {deviation:.3g} is below three times the noise of the samples, "
                f"{joint.noise:.3g}, so that the motion and its derivatives follow the noise; "
                f"allow {FOLLOWED * joint.noise:.2g}"
            )
            warn_caller(RecordingWarning(message))
    return SmoothedTrajectory(
        laws, trajectory.start, trajectory.stop, trajectory.times, trajectory.measures, deviation, joints
    )


def _doubt(times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"], deviation: float) -> str:
    """Return a warning of repeated samples or outliers with a remedy, or an empty string.

    Raises
    ------
    TrajectoryError
        If the samples step by a whole turn.
    """
    if len(times) < FEWEST:
        return ""
    _check_turns(times, values)
    return _repeated(times, values) or _outlier(times, values, deviation)


def _check_turns(times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"]) -> None:
    steps = np.diff(values)
    sizes = np.abs(steps)
    is_turn = np.abs(sizes - WHOLE_TURN) < 0.1 * WHOLE_TURN
    if is_turn.any() and np.all(sizes[~is_turn] < 0.1 * WHOLE_TURN):
        first = int(np.argmax(is_turn))
        count = f"; {np.sum(is_turn)} steps are such" if np.sum(is_turn) > 1 else ""
        message = (
            f"goes by a whole turn, {steps[first]:.6g}, at t = {time_text(times[first + 1])} s{count}: "
            "count the turns of an angle (numpy.unwrap)"
        )
        raise TrajectoryError(message)


def _repeated(times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"]) -> str:
    """Return a warning of samples that repeat old values and catch up in one step, or an empty string.

    Dwells do not count, as their motion starts with short steps, and neither do quantization steps of an encoder.
    """
    steps = np.abs(np.diff(values))
    moves = np.flatnonzero(steps)
    if len(moves) < FEWEST:
        return ""
    stays = np.diff(moves) - 1  # number of repeated samples before each step but the first
    jumps, after, before = steps[moves[1:-1]], steps[moves[2:]], steps[moves[:-2]]
    gaps = np.diff(np.unique(values))
    quantum = gaps[gaps > SAME * np.ptp(values)].min()  # the quantization step, if any
    is_late = (stays[:-1] > 0) & (jumps > WRITTEN * quantum) & (jumps > CATCHES_UP * after)
    is_long = is_late & (stays[:-1] >= LONG) & (jumps > LONG / 2 * np.maximum(after, before))
    count = int(stays[:-1][is_late].sum())
    if count < REPEATED * len(values) and not is_long.any():
        return ""
    chosen = is_long if count < REPEATED * len(values) else is_late
    first = int(np.argmax(chosen))
    sample = int(moves[first]) + 2
    return (
        f"{int(stays[:-1][chosen].sum())} of {len(values)} samples repeat the one before while the joint moves, the "
        f"first at t = {time_text(times[sample])} s: they are old, and the motion follows them within the "
        "deviation; leave out what repeats"
    )


def _outlier(times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"], deviation: float) -> str:
    """Return a warning of samples far from their neighbors, with a remedy, or an empty string."""
    steps = np.diff(times)
    interpolated = (values[:-2] * steps[1:] + values[2:] * steps[:-1]) / (steps[1:] + steps[:-1])
    uneven = steps[1:] * steps[:-1] / np.median(steps) ** 2  # beside gaps, lines are far from a curved motion
    gaps = np.abs(values[1:-1] - interpolated) / np.maximum(uneven, 1.0)
    padded = np.pad(gaps, NEIGHBORS)
    nearby = [padded[NEIGHBORS + k : len(gaps) + NEIGHBORS + k] for k in range(-NEIGHBORS, NEIGHBORS + 1) if abs(k) > 1]
    outliers = np.flatnonzero((gaps > OUTLYING * np.max(nearby, axis=0)) & (gaps > OUTSIDE * deviation))
    if not len(outliers):
        return ""
    first = int(outliers[0]) + 1
    count = f"; {len(outliers)} samples are such" if len(outliers) > 1 else ""
    return (
        f"the sample at t = {time_text(times[first])} s is {gaps[first - 1]:.3g} from those beside it{count}: "
        "the motion goes there and back, within the deviation; leave out what is an outlier"
    )


def samples_of(
    trajectory: JointTrajectory, name: str
) -> tuple[Float[np.ndarray, " sample"], Float[np.ndarray, " sample"]] | None:
    """Return the times and values of the samples of a joint; None if its law does not come from samples."""
    law = trajectory.laws.given()[name]
    return (law.times, law.values) if isinstance(law, SampledLaw) else sampled(law)


def sampled(law: AbstractMotion) -> tuple[Float[np.ndarray, " sample"], Float[np.ndarray, " sample"]] | None:
    """Return the times and values of the samples of a law; None if it does not come from samples."""
    of_samples = type(law) in (SplineMotion, HermiteSplineMotion) and law.beyond == "refuse"
    if of_samples and law.samples.value is not None:
        return law.samples.value
    if isinstance(law, HermiteMotion) and law.degree == 1 and law.beyond == "refuse":
        stop = float(law.stop)
        times = np.append(np.asarray(law.breakpoints, float)[:-1], stop)
        return times, np.asarray(law.coefficients, float)[0]
    return None


def smoothed_samples(
    times: Float[np.ndarray, " sample"], values: Float[np.ndarray, " sample"], deviation: float
) -> tuple[AbstractMotion, SmoothedJoint]:
    """Return the law of one joint within a deviation of its samples, and its noise, distance and dwells.

    Raises
    ------
    TrajectoryError, SolveError
        If there are too few samples, or no motion is within the deviation.
    """
    if len(times) < FEWEST:
        message = f"at least {FEWEST} samples are needed; a path through few points takes a deviation in retime"
        raise TrajectoryError(message, value=len(times))
    sigma = noise_of(times, values)
    if not np.ptp(values):
        rests = [Dwell(0, len(times) - 1, float(values[0]))]
        estimates = [IntervalEstimate(float(times[0]), float(times[-1]), len(times), 1.0, 1.0, 0.0)]
    else:
        rests, estimates = _dwells_and_estimates(times, values, sigma)
        rests = [_fitting(times, values, dwell, deviation) for dwell in rests]
    curve = smoothed_curve(times, values, deviation, estimates, rests)
    from scipy.interpolate import BSpline  # importing SciPy takes half a second

    spline = BSpline(whole(curve.knots), curve.coefficients, DEGREE)
    powers = local_powers(spline, curve.knots[:-1], DEGREE)
    for dwell in rests:  # exactly at rest, not only to rounding
        is_resting = (curve.knots[:-1] >= times[dwell.first]) & (curve.knots[:-1] < times[dwell.last])
        powers[0, is_resting], powers[1:, is_resting] = dwell.position, 0.0
    errors = np.max([estimate.standard_errors for estimate in estimates], axis=0)
    forced = BSpline(spline.t, curve.forced, DEGREE)
    largest = [NOISE_SAFETY * x + float(np.abs(forced(curve.knots, nu=k)).max()) for k, x in enumerate(errors)]
    law = SmoothPieces(curve.knots[:-1], powers, float(curve.knots[-1]), _relative(largest, powers, times))
    intervals = tuple((float(times[d.first]), float(times[d.last])) for d in rests)
    rates = [estimate.cutoff / (2 * np.pi) for estimate in estimates]
    noise = max(sigma, float(np.median([estimate.noise for estimate in estimates])))
    return law, SmoothedJoint(noise, curve.away, intervals, (min(rates), max(rates)), tuple(errors.tolist()))


def _relative(
    errors: list[float], powers: Float[np.ndarray, "power piece"], times: Float[np.ndarray, " sample"]
) -> Float[np.ndarray, " derivative"]:
    """Return the largest errors of the derivatives relative to their peaks; 1 for those whose error is not known."""
    if not powers[1:].any():  # it rests
        return np.zeros(len(powers))
    peaks = np.array([math.factorial(k) * max(row.max(), -row.min()) for k, row in enumerate(powers)])
    whole_errors = np.append(errors, np.full(len(powers) - len(errors), np.inf))
    return relative_errors(whole_errors, peaks, float(np.ptp(powers[0])), float(times[-1] - times[0]))


def _dwells_and_estimates(
    times: np.ndarray, values: np.ndarray, sigma: float
) -> tuple[list[Dwell], list[IntervalEstimate]]:
    """Return dwells without their margins, and the estimates of the intervals between them.

    A dwell no longer than its margins is a slow part of a motion, and is dropped.
    """
    whole_dwells = dwells(times, values, sigma)
    cached: dict[tuple[int, int], list[IntervalEstimate]] = {}
    while True:
        estimates = _moving(times, values, whole_dwells, cached)
        scales = [_scales(times, dwell, estimates) for dwell in whole_dwells]
        inner = [without_margins([d], times, [scale]) for d, scale in zip(whole_dwells, scales, strict=True)]
        if all(inner):
            return [dwell for (dwell,) in inner], estimates
        whole_dwells = [dwell for dwell, margins in zip(whole_dwells, inner, strict=True) if margins]


def _fitting(times: np.ndarray, values: np.ndarray, dwell: Dwell, deviation: float) -> Dwell:
    """Return a dwell at a position within the deviation of all its samples."""
    block = values[dwell.first : dwell.last + 1]
    low, high = float(block.max()) - deviation, float(block.min()) + deviation
    if low > high:
        k = int(dwell.first + np.argmax(np.abs(block - np.median(block))))
        message = (
            f"samples of a dwell differ by {np.ptp(block):.3g} about t = {time_text(times[k])} s, more than twice the "
            f"deviation of {deviation:.3g}; choose a larger one"
        )
        raise TrajectoryError(message)
    return dataclasses.replace(dwell, position=float(np.clip(dwell.position, low, high)))


def _scales(times: np.ndarray, dwell: Dwell, estimates: list[IntervalEstimate]) -> tuple[float, float]:
    """Return the time scales of the motions before and after a dwell, s."""
    before = [estimate for estimate in estimates if estimate.stop <= times[dwell.first]]
    after = [estimate for estimate in estimates if estimate.start >= times[dwell.last]]
    ends = before[-1] if before else estimates[0], after[0] if after else estimates[-1]
    return UNSEEN / ends[0].cutoff, UNSEEN / ends[1].cutoff


def _moving(
    times: np.ndarray, values: np.ndarray, rests: list[Dwell], cached: dict[tuple[int, int], list[IntervalEstimate]]
) -> list[IntervalEstimate]:
    """Return the estimates of intervals between dwells, and store them in `cached` by their first and last sample."""
    edges = [0, *(k for dwell in rests for k in (dwell.first, dwell.last)), len(times) - 1]
    estimates: list[IntervalEstimate] = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if last - first >= FEWEST:
            if (first, last) not in cached:
                cached[first, last] = interval_estimates(times[first : last + 1], values[first : last + 1])
            estimates += cached[first, last]
    if not estimates:
        estimates = interval_estimates(times, values)
    return sorted(estimates, key=lambda estimate: estimate.start)
