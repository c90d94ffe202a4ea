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
    times = [law_samples[0] for law_samples in samples.values() if law_samples is not None]
    if not times:
        return None
    all_times = [trajectory.start, trajectory.stop, *times]
    if any(law_samples is None for law_samples in samples.values()):
        all_times.append(np.linspace(trajectory.start, trajectory.stop, SAMPLES + 1))
    instants = np.unique(np.hstack(all_times))
    instants = instants[(instants >= trajectory.start) & (instants <= trajectory.stop)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SampleWarning)
        path = None if all(samples.values()) else Path(dict(trajectory.laws), trajectory.start, trajectory.stop)
        columns = None if path is None else path.derivatives(instants, 0)[:, 0]
    points = [
        np.interp(instants, *law_samples) if law_samples is not None else columns[:, k]  # type: ignore[index]
        for k, law_samples in enumerate(samples.values())
    ]
    return Lines(instants, np.stack(points, axis=1), trajectory.names, "samples")


def lines_along(path: Path) -> Lines:
    """Return straight lines between many points of a path that does not come from samples."""
    knots = [np.asarray(law.breakpoints) for law in path.laws.values() if isinstance(law, SplineMotion)]
    parameters = np.unique(np.concatenate([np.linspace(path.start, path.stop, SAMPLES + 1), *knots]))
    parameters = parameters[(parameters >= path.start) & (parameters <= path.stop)]
    lines = Lines(parameters, path.derivatives(parameters, 0)[:, 0], path.names, "places")
    if not np.isfinite(lines.points).all():
        return lines
    inner = (parameters[:-1, None] + np.diff(parameters)[:, None] * np.array([0.25, 0.5, 0.75])).reshape(-1)
    return dataclasses.replace(lines, own=float(lines.distances(inner, path.derivatives(inner, 0)[:, 0]).max()))


def deviation_of(lines: Lines, deviation: float | None) -> float:
    """Return the largest allowed distance of a path from samples."""
    return min(DEVIATION, SHARE * lines.size) if deviation is None else deviation


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
    lines, exact_path = lines_of(trajectory), Path(dict(trajectory.laws), trajectory.start, trajectory.stop)
    if lines is None:
        if deviation is not None:
            return rounded(lines_along(exact_path), deviation, timed=timed)
        return exact_path if timed else path_of_trajectory(trajectory, order)
    allowed, has_few = deviation_of(lines, deviation), _are_few(trajectory)
    distance = _swing(trajectory, exact_path, lines, order) if has_few or deviation is None else np.inf
    if distance <= allowed:
        path = exact_path if timed else path_of_trajectory(trajectory, order)
        if path.deviation + distance <= allowed:
            splines = [law for law in trajectory.laws.values() if isinstance(law, SplineMotion | HermiteSplineMotion)]
            degrees = sorted({law.degree for law in splines})
            note = f"splines of degree {' and '.join(map(str, degrees))} through {len(lines.at)} samples"
            return dataclasses.replace(path, deviation=path.deviation + distance, allowed=allowed, words=note)
    return rounded(lines, allowed, timed=timed) if has_few else _smoothed(trajectory, order, allowed, timed=timed)


def _are_few(trajectory: JointTrajectory) -> bool:
    """Return whether the samples are a few points of a path rather than a log of a motion."""
    counts = [len(samples[0]) for law in trajectory.laws.values() if (samples := sampled(law)) is not None]
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
    distance = path.deviation + max(joint.away for joint in motion.joints.values())
    note = f"within {allowed:.3g} rad or m of each of {len(motion.times)} samples"
    return dataclasses.replace(path, deviation=distance, allowed=allowed, words=note)


def _swing(trajectory: JointTrajectory, own: Path, lines: Lines, order: int) -> float:
    """Return the distance of splines from straight lines between samples; infinite if these do not support them."""
    laws = [law for law in trajectory.laws.values() if sampled(law) is not None]
    if min(law.degree for law in laws if isinstance(law, SplineMotion)) <= order:
        return np.inf
    if trajectory.supported_order() < order:
        return np.inf
    is_repeated = np.diff(lines.points, axis=0) == 0
    dwells = np.zeros_like(is_repeated)
    dwells[1:] |= is_repeated[1:] & is_repeated[:-1]
    dwells[:-1] |= is_repeated[1:] & is_repeated[:-1]
    fractions, max_distance, count = np.arange(1, LOOKS) / LOOKS, 0.0, MANY // LOOKS
    for first in range(0, len(is_repeated), count):
        chunk = slice(first, first + count)
        parameters = lines.at[:-1][chunk, None] + np.diff(lines.at)[chunk, None] * fractions
        positions = own.derivatives(parameters.reshape(-1), 0)[:, 0]
        displacement = np.abs(positions.reshape(*parameters.shape, -1) - lines.points[:-1][chunk, None]).max(axis=1)
        if np.any(displacement[dwells[chunk]] > REST_DISTANCE * lines.size):
            return np.inf
        max_distance = max(max_distance, float(lines.distances(parameters.reshape(-1), positions).max()))
    return max_distance
