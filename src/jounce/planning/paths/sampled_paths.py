"""Paths of sampled trajectories: splines through the samples if these support them, otherwise a smooth motion nearby.

Splines through samples with noise, rounding or dwells swing; the path is then that of the smooth motion within a
deviation of the samples. Few samples are treated as waypoints: their path stays near the straight lines between them.
"""

import dataclasses
import warnings

import numpy as np

from jounce.errors import SampleWarning
from jounce.planning.paths.path import Path
from jounce.planning.paths.straight_lines import Lines, rounded
from jounce.planning.paths.trajectory_paths import path_of_trajectory, turns_back_within
from jounce.planning.smoothing.smooth import FEWEST, sampled, smooth
from jounce.trajectory import HermiteSplineMotion, JointTrajectory, SplineMotion

DEVIATION = 1e-3  # rad or m: default deviation from samples
OF_SMOOTHING = 0.75  # fraction of the deviation for smoothing, if corners of its result are then rounded
SHARE = 1e-3  # fraction of the size of the path: default deviation of small paths
LOOKS, MANY = 8, 100_000  # sample intervals between two samples, and points per evaluation
REST_DISTANCE = 1e-7  # fraction of the size of the path: largest motion of a joint while its samples do not move
SAMPLES = 4000  # intervals of a path that does not come from samples


def lines_of(trajectory: JointTrajectory) -> Lines | None:
    """Return the straight lines between the samples of a trajectory; None if no joint has samples."""
    samples = {name: sampled(law) for name, law in trajectory.laws.items()}
    times = [own[0] for own in samples.values() if own is not None]
    if not times:
        return None
    every = [trajectory.start, trajectory.stop, *times]
    if any(own is None for own in samples.values()):
        every.append(np.linspace(trajectory.start, trajectory.stop, SAMPLES + 1))
    at = np.unique(np.hstack(every))
    at = at[(at >= trajectory.start) & (at <= trajectory.stop)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        exact = None if all(samples.values()) else Path(dict(trajectory.laws), trajectory.start, trajectory.stop)
        columns = None if exact is None else exact.derivatives(at, 0)[:, 0]
    points = [
        np.interp(at, *own) if own is not None else columns[:, k]  # type: ignore[index]
        for k, own in enumerate(samples.values())
    ]
    return Lines(at, np.stack(points, axis=1), trajectory.names, "samples")


def lines_along(path: Path) -> Lines:
    """Return straight lines between many points of a path that does not come from samples."""
    knots = [np.asarray(law.breakpoints) for law in path.laws.values() if isinstance(law, SplineMotion)]
    at = np.unique(np.concatenate([np.linspace(path.start, path.stop, SAMPLES + 1), *knots]))
    at = at[(at >= path.start) & (at <= path.stop)]
    lines = Lines(at, path.derivatives(at, 0)[:, 0], path.names, "places")
    if not np.isfinite(lines.points).all():
        return lines
    between = (at[:-1, None] + np.diff(at)[:, None] * np.array([0.25, 0.5, 0.75])).reshape(-1)
    return dataclasses.replace(lines, own=float(lines.distances(between, path.derivatives(between, 0)[:, 0]).max()))


def deviation_of(lines: Lines, given: float | None) -> float:
    """Return the largest allowed distance of a path from samples."""
    return min(DEVIATION, SHARE * lines.size) if given is None else given


def path_of_samples(
    trajectory: JointTrajectory, order: int, deviation: float | None = None, *, timed: bool = False
) -> Path:
    """Return the path of a trajectory, within a deviation of its samples if it has samples.

    Parameters
    ----------
    trajectory : JointTrajectory
        Trajectory with laws through samples, or with laws known at every instant.
    order : int
        Order to which derivatives of the path are continuous.
    deviation : float, optional
        Largest distance from the samples, rad or m; by default 0.001, or a thousandth of the size of the path if that
        is less.
    timed : bool, default False
        Whether the path runs over the time of the trajectory.

    Raises
    ------
    TrajectoryError
        If the trajectory does not move, or the path would bend too sharply; the message names the joint and instant.
    """
    lines, own = lines_of(trajectory), Path(dict(trajectory.laws), trajectory.start, trajectory.stop)
    if lines is None:
        if deviation is not None:
            return rounded(lines_along(own), deviation, timed=timed)
        return own if timed else path_of_trajectory(trajectory, order)
    allowed, few = deviation_of(lines, deviation), _are_few(trajectory)
    away = _swing(trajectory, own, lines, order) if few or deviation is None else np.inf
    if away <= allowed:
        path = own if timed else path_of_trajectory(trajectory, order)
        if path.deviation + away <= allowed:
            splines = [law for law in trajectory.laws.values() if isinstance(law, SplineMotion | HermiteSplineMotion)]
            degrees = sorted({law.degree for law in splines})
            words = f"splines of degree {' and '.join(map(str, degrees))} through {len(lines.at)} samples"
            return dataclasses.replace(path, deviation=path.deviation + away, allowed=allowed, words=words)
    return rounded(lines, allowed, timed=timed) if few else _smoothed(trajectory, order, allowed, timed=timed)


def _are_few(trajectory: JointTrajectory) -> bool:
    """Return whether the samples are a few points of a path rather than a log of a motion."""
    counts = [len(own[0]) for law in trajectory.laws.values() if (own := sampled(law)) is not None]
    return min(counts) < FEWEST


def _smoothed(trajectory: JointTrajectory, order: int, allowed: float, *, timed: bool) -> Path:
    """Return the path of the smooth motion within a deviation of each sample."""
    motion = smooth(trajectory, allowed)
    path = Path(dict(motion.laws), motion.start, motion.stop)
    ends = np.array([motion.start, motion.stop])
    if timed:
        path = dataclasses.replace(path, instants=(ends, ends))
    elif turns_back_within(motion, allowed):  # such a reversal is not part of the path, but noise of a slow motion
        motion = smooth(trajectory, OF_SMOOTHING * allowed)
        lines = dataclasses.replace(lines_along(Path(dict(motion.laws), *ends.tolist())), kind="samples")
        path = rounded(lines, (1 - OF_SMOOTHING) * allowed)
    else:
        path = path_of_trajectory(motion, order)
    away = path.deviation + max(own.away for own in motion.joints.values())
    words = f"within {allowed:.3g} rad or m of each of {len(motion.times)} samples"
    return dataclasses.replace(path, deviation=away, allowed=allowed, words=words)


def _swing(trajectory: JointTrajectory, own: Path, lines: Lines, order: int) -> float:
    """Return the distance of splines from straight lines between samples; infinite if these do not support them."""
    laws = [law for law in trajectory.laws.values() if sampled(law) is not None]
    if min(law.degree for law in laws if isinstance(law, SplineMotion)) <= order:
        return np.inf
    if trajectory.supported_order() < order:
        return np.inf
    same = np.diff(lines.points, axis=0) == 0
    dwells = np.zeros_like(same)
    dwells[1:] |= same[1:] & same[:-1]
    dwells[:-1] |= same[1:] & same[:-1]
    share, farthest, count = np.arange(1, LOOKS) / LOOKS, 0.0, MANY // LOOKS
    for first in range(0, len(same), count):
        some = slice(first, first + count)
        at = lines.at[:-1][some, None] + np.diff(lines.at)[some, None] * share
        positions = own.derivatives(at.reshape(-1), 0)[:, 0]
        moved = np.abs(positions.reshape(*at.shape, -1) - lines.points[:-1][some, None]).max(axis=1)
        if np.any(moved[dwells[some]] > REST_DISTANCE * lines.size):
            return np.inf
        farthest = max(farthest, float(lines.distances(at.reshape(-1), positions).max()))
    return farthest
