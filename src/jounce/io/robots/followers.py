"""Joints of a file whose ranges leave the joint that they follow no room: that one keeps its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jounce.errors import RobotError, RobotFileError
from jounce.io.robots.faults import Faults
from jounce.robot.model import POINT, Joint, ranges_at_leader

NO_ROOM = "ranges of joints that leave the joint that they follow no room to move"
MOST_NAMED = 20


def with_room(
    joints: Sequence[Joint], faults: Faults, placed: Callable[[RobotError], RobotFileError], held: Collection[str] = ()
) -> list[Joint]:
    """Return the joints, those that leave the joint that they follow no room without their range.

    A range of which nothing or one point is left, seen from the leader, is a fault of the file: a copied block of
    limits, or one without the sign of the multiplier. A range that suits the leader alone goes before one that does
    not; of those that suit it but not one another none counts.

    Parameters
    ----------
    joints : sequence of Joint
        Of the file.
    faults : Faults
        Takes the ranges that do not count.
    placed : callable
        Makes an error of the file of one of the robot, with the line of what it names.
    held : collection of str, optional
        Joints that are held in one place, whatever their range.

    Raises
    ------
    RobotFileError
        If such a range is an error.
    """
    found = {joint.name: joint for joint in joints}
    following: dict[str, list[Joint]] = {}
    for joint in joints:
        if joint.mimic is not None and joint.mimic.multiplier and _has_range(joint):
            following.setdefault(joint.mimic.joint, []).append(joint)
    for leader in joints:
        followers = following.get(leader.name, [])
        if not followers or leader.name in held:
            continue
        own, *ranges = ranges_at_leader(leader.limits, followers)
        for k, others in _crowded(np.array([own, *ranges])):
            joint, (low, high) = followers[k], ranges[k]
            against = f" beside {_named([followers[other].name for other in others])}" if others else ""
            message = (
                f"its range leaves {leader.name}, which it follows, {low:.6g} to {high:.6g} of "
                f"{own[0]:.6g} to {own[1]:.6g}{against}: no room to move; correct the limits or the multiplier, "
                "or read the file without strict"
            )
            error = RobotError(message, name=f"joints.{joint.name}.limit")
            faults.leave_out(NO_ROOM, f"{joint.name}, which follows {leader.name}", placed(error))
            found[joint.name] = dataclasses.replace(
                joint, limits=dataclasses.replace(joint.limits, lower=None, upper=None)
            )
    return list(found.values())


def _has_range(joint: Joint) -> bool:
    return joint.moving and (joint.limits.lower, joint.limits.upper) != (None, None)


def _crowded(ranges: Float[np.ndarray, "joint end"]) -> Iterator[tuple[int, list[int]]]:
    """Yield the joints that leave the first one no room, and beside which others; by themselves where beside none.

    As `jounce.robot.model.has_room` of each and of each two of them, for thousands at once.
    """
    with np.errstate(invalid="ignore"):  # between ends that are both infinite
        widths = np.diff(ranges)[:, 0]
        low, high = np.maximum(ranges[0, 0], ranges[1:, 0]), np.minimum(ranges[0, 1], ranges[1:, 1])
        finite = np.where(np.isfinite(widths), widths, np.inf)
        narrow, fixed = np.minimum(finite[0], finite[1:]), widths[0] == 0

        def room(lower: Any, upper: Any, narrowest: Any) -> Any:
            least = POINT * np.where(np.isfinite(narrowest), narrowest, 0.0)
            return (upper - lower > least) | (fixed & (upper >= lower))

        fits = room(low, high, narrow)
        for k in range(len(low)):
            if not fits[k]:
                yield k, []
                continue
            beside = room(np.maximum(low[k], low), np.minimum(high[k], high), np.minimum(narrow[k], narrow))
            if others := [int(other) for other in np.flatnonzero(fits & ~beside) if other != k]:
                yield k, others


def _named(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} others" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more
