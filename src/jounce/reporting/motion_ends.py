"""Facts of the ends of a trajectory, and of the assumed motion between given points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from jounce.dynamics.limits.motion_ends import TrajectoryEnd
from jounce.planning.paths.sampled_paths import lines_of
from jounce.planning.smoothing.smooth import SmoothedTrajectory, sampled
from jounce.trajectory import HermiteMotion, HermiteSplineMotion, JointTrajectory, SplineMotion
from jounce.trajectory.splines import pieces_at
from jounce.units.instants import time_text

WITH_VELOCITIES = 5  # degree of splines through positions and velocities
LOOKS = 8  # sample intervals between two points
NEGLIGIBLE = 1e-9  # rad or m: less is rounding
SHOWN = 3  # largest number of joints listed at an end
UNITS = {"velocities": "rad/s or m/s", "accelerations": "rad/s^2 or m/s^2"}


def ends_words(ends: Iterable[TrajectoryEnd]) -> list[str]:
    """Return the state at both ends in words: one line for each, or a single one if both are at rest."""
    sentences = list(ends)
    if all(end.at_rest for end in sentences):
        return ["starts and stops at rest"] if sentences else []
    return [f"{end.end}s {_moving(end)} at t = {time_text(end.time)} s" for end in sentences]


def _moving(end: TrajectoryEnd) -> str:
    if end.at_rest:
        return "at rest"
    word, values = ("velocities", end.velocities) if end.velocities else ("accelerations", end.accelerations)
    largest = sorted(values.items(), key=lambda entry: -abs(entry[1]))
    phrase = ", ".join(f"{name} {value:.4g}" for name, value in largest[:SHOWN])
    ellipsis = f" and {len(largest) - SHOWN} more" if len(largest) > SHOWN else ""
    state = "in motion" if end.velocities else "at rest, but with acceleration"
    return f"{state}: {phrase}{ellipsis}, {UNITS[word]},"


def breaks_words(ends: Iterable[TrajectoryEnd]) -> list[str]:
    """Return the limits that a jump from or to rest breaks at both ends, in words."""
    lines = []
    for end in ends:
        if not end.breaks:
            continue
        owners_of: dict[str, list[str]] = {}
        for owner, quantity in end.breaks:
            owners_of.setdefault(quantity, []).append(owner)
        phrase = "; ".join(f"{quantity} of {', '.join(owners)}" for quantity, owners in owners_of.items())
        jump = "from rest" if end.end == "start" else "to rest"
        lines.append(f"infinite by the jump {jump} at the {end.end}: {phrase}")
    return lines


def ends_facts(ends: Iterable[TrajectoryEnd]) -> list[dict[str, Any]]:
    """Return the state at both ends as plain data."""
    return [
        {
            "end": end.end,
            "time": end.time,
            "at_rest": end.at_rest,
            "velocities": dict(end.velocities),
            "accelerations": dict(end.accelerations),
            "breaks": [{"name": owner, "quantity": quantity} for owner, quantity in end.breaks],
        }
        for end in ends
    ]


def between_facts(trajectory: JointTrajectory) -> Mapping[str, Any] | None:
    """Return the assumed motion between the points of a trajectory; None if its laws define it.

    The keys are ``words``, and the largest distance from the straight lines between the points: ``deviation``, rad or
    m, its ``joint`` and its instant ``at``, s.
    """
    by_words = {words: None for law in trajectory.laws.values() if (words := _words(law)) is not None}
    if not by_words:
        return None
    deviation, joint, at = 0.0, None, None
    if all(sampled(law) is not None for law in trajectory.laws.values()):
        deviation, joint, at = _largest_deviation(trajectory)
    return {"words": "; ".join(by_words), "deviation": deviation, "joint": joint, "at": at}


def _words(law: object) -> str | None:
    if isinstance(law, HermiteMotion):
        levels = {1: "positions alone: straight lines between {}", 3: "positions and velocities: cubics between {}"}
        return levels[law.degree].format(f"{len(law.breakpoints)} points") if law.degree in levels else None
    if isinstance(law, HermiteSplineMotion):
        given = "positions and velocities" if law.degree == WITH_VELOCITIES else "positions, velocities, accelerations"
        return f"{given}: splines of degree {law.degree} through {len(law.samples.value[0])} samples"
    if isinstance(law, SplineMotion) and sampled(law) is not None:
        return f"positions alone: splines of degree {law.degree} through {len(law.samples.value[0])} samples"
    return None


def _largest_deviation(trajectory: JointTrajectory) -> tuple[float, str | None, float | None]:
    """Return the largest distance of laws from straight lines between samples, with its joint and instant."""
    lines = lines_of(trajectory)
    assert lines is not None
    fractions = np.arange(1, LOOKS) / LOOKS
    at = (lines.at[:-1, None] + np.diff(lines.at)[:, None] * fractions).reshape(-1)
    positions = np.stack([pieces_at(law, at) for law in trajectory.laws.values()], axis=1)
    deviations = lines.distances(at, positions)
    k = int(np.argmax(deviations))
    if not deviations[k] > 0:
        return 0.0, None, None
    points = np.stack([np.interp(at[k], lines.at, column) for column in lines.points.T])
    return float(deviations[k]), lines.names[int(np.argmax(np.abs(positions[k] - points)))], float(at[k])


def between_words(trajectory: JointTrajectory) -> list[str]:
    """Return the assumed motion between the points of a trajectory in words; empty if its laws define it."""
    if isinstance(trajectory, SmoothedTrajectory):
        deviation = max(joint.away for joint in trajectory.joints.values())
        bound = f"within {trajectory.deviation:.3g} rad or m of each of {len(trajectory.times)} samples"
        return [f"smoothed {bound}, at most {deviation:.2g} from them"]
    facts = between_facts(trajectory)
    if facts is None:
        return []
    if facts["deviation"] <= NEGLIGIBLE:
        return [facts["words"]]
    location = f"{facts['joint']} at t = {time_text(facts['at'], 5)} s"
    return [f"{facts['words']}, at most {facts['deviation']:.2g} rad or m from straight lines, {location}"]
