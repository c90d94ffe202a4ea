"""Trajectories from recordings: splines through samples, or the interpolation of a controller between points."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jounce.errors import JounceError, RecordingWarning, TrajectoryError
from jounce.io.trajectories.agreement import check_agreement, check_turns, without_idle_rates
from jounce.io.trajectories.recordings import Recording
from jounce.io.trajectories.stamps import gaps
from jounce.trajectory import (
    AbstractMotion,
    HermiteMotion,
    HermiteSplineMotion,
    JointTrajectory,
)  # fmt: skip
from jounce.trajectory.checks import check_samples
from jounce.trajectory.sampled.deferred import SampledLaw, law_through
from jounce.trajectory.splines import check_odd


def trajectory_of(
    recording: Recording, degree: int = 5, *, as_controller: bool = False, samples: bool = False
) -> JointTrajectory:
    """Return the trajectory of a recording.

    Parameters
    ----------
    recording : Recording
        Recording from a file.
    degree : int, default 5
        Degree of the splines through positions only.
    as_controller : bool, default False
        Whether to interpolate like joint_trajectory_controller of ros2_control: linearly between positions only, by
        cubics with velocities, by quintics with accelerations.
    samples : bool, default False
        Whether to interpolate positions of samples linearly, instead of by splines.

    Raises
    ------
    TrajectoryError
        If there are too few rows, angles are wrapped to one turn, or velocities and positions contradict each other:
        the message names the line.

    Warns
    -----
    RecordingWarning
        If parts of the file were changed, or if there are gaps between samples.
    """
    if len(recording.times) < 2:
        raise recording.error("at least two samples are needed", value=len(recording.times))
    try:
        check_odd(degree)
    except TrajectoryError as error:
        raise error.located(path=recording.path) from None
    notes = list(recording.notes)
    if not recording.points:
        recording, unmeasured = without_idle_rates(recording)
        notes += unmeasured
        check_turns(recording)
        notes += check_agreement(recording)
        notes += [] if as_controller else gaps(recording)
    if notes:
        warnings.warn(RecordingWarning(f"{recording.path}: {'; '.join(notes)}"), stacklevel=4)
    pointed = as_controller or recording.points
    try:
        laws = {
            name: _as_points(recording, k) if pointed else _as_samples(recording, k, 1 if samples else degree)
            for k, name in enumerate(recording.names)
        }
        bounds = [_ends(law) for law in laws.values()]
        start, stop = max(first for first, _ in bounds), min(last for _, last in bounds)
        inside = (recording.times >= start) & (recording.times <= stop)
        times = recording.times[inside]
        return JointTrajectory(laws, start, stop, times, dict(recording.measures))
    except JounceError as error:
        place = {"path": recording.path, "line": error.line, "name": error.name}
        raise TrajectoryError(error.message, value=error.value, **place) from None


def _as_points(recording: Recording, joint: int) -> AbstractMotion:
    table = recording.values[:, :, joint]
    present = ~np.isnan(table)
    skipped = np.flatnonzero((present[:, 1:] & ~present[:, :-1]).any(axis=1))
    if len(skipped):
        message = "accelerations without velocities: the controller goes through such points by neither"
        raise recording.error(message, int(skipped[0]), name=recording.names[joint])
    rows = present[:, 0]
    return HermiteMotion(recording.times[rows], _trimmed(table[rows]), incomplete=True)


def _trimmed(table: Float[np.ndarray, "row level"]) -> Float[np.ndarray, "row known"]:
    """Return a table without the levels that no two adjacent points have."""
    present = ~np.isnan(table)
    have_both = (present[1:] & present[:-1]).any(axis=0)
    return table[:, : int(np.argmin(np.append(have_both, False)))]


def _ends(law: Any) -> tuple[float, float]:
    """Return the first and the last instant of a law."""
    if isinstance(law, SampledLaw):
        return float(law.times[0]), float(law.times[-1])
    return float(np.asarray(law.breakpoints)[0]), float(law.stop)


def _as_samples(recording: Recording, joint: int, degree: int) -> AbstractMotion | SampledLaw:
    table = recording.values[:, :, joint]
    rows = ~np.isnan(table[:, 0])
    times, table = recording.times[rows], table[rows]
    levels = complete_levels(~np.isnan(table))
    if degree == 1 or levels == 1:
        return law_through(*check_samples(times, np.ascontiguousarray(table[:, 0])), degree)
    return HermiteSplineMotion(times, table[:, :levels])


def complete_levels(present: Bool[np.ndarray, "row level"]) -> int:
    """Return the number of levels that all rows have."""
    return int(np.argmin(np.append(present.all(axis=0), False)))
