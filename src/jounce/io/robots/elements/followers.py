"""Joints of a file whose ranges leave the joint that they follow no room: that one keeps its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence

from jounce.errors import RobotError, RobotFileError
from jounce.io.robots.elements.faults import Faults
from jounce.robot.model.links_and_joints import Joint, has_room, ranges_at_leader

NO_ROOM = "ranges of joints that leave the joint that they follow no room to move"


def with_room(
    joints: Sequence[Joint],
    faults: Faults,
    located: Callable[[RobotError], RobotFileError],
    fixed: Collection[str] = (),
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
    located : callable
        Makes an error of the file of one of the robot, with the line of what it names.
    fixed : collection of str, optional
        Joints that are held in one place, whatever their range.

    Raises
    ------
    RobotFileError
        If such a range is an error.
    """
    by_name = {joint.name: joint for joint in joints}
    following: dict[str, list[Joint]] = {}
    for joint in joints:
        ranged = (joint.limits.lower, joint.limits.upper) != (None, None)
        if joint.moving and joint.mimic is not None and joint.mimic.multiplier and ranged:
            following.setdefault(joint.mimic.joint, []).append(joint)
    for leader in joints:
        followers = following.get(leader.name, [])
        if not followers or leader.name in fixed or has_room(leader.limits, followers):
            continue
        bad = {joint.name for joint in followers if not has_room(leader.limits, [joint])}
        rest = [joint for joint in followers if joint.name not in bad]
        narrowing = _narrowing(leader, rest)
        for joint in followers:
            suits = joint.name not in bad
            others = [x for x in narrowing if x is not joint] if suits else []
            conflicting = [x.name for x in others if not has_room(leader.limits, [joint, x])]
            if suits and not conflicting:
                continue
            own, (low, high) = ranges_at_leader(leader.limits, [joint])
            against = f" beside {', '.join(conflicting)}" if conflicting else ""
            message = (
                f"its range leaves {leader.name}, which it follows, {low:.6g} to {high:.6g} of "
                f"{own[0]:.6g} to {own[1]:.6g}{against}: no room to move; correct the limits or the multiplier, "
                "or read the file without strict"
            )
            error = RobotError(message, name=f"joints.{joint.name}.limit")
            faults.leave_out(NO_ROOM, f"{joint.name}, which follows {leader.name}", located(error))
            by_name[joint.name] = dataclasses.replace(
                joint, limits=dataclasses.replace(joint.limits, lower=None, upper=None)
            )
    return list(by_name.values())


def _narrowing(leader: Joint, followers: Sequence[Joint]) -> list[Joint]:
    """Return the two followers whose ranges begin last at their leader, and the two whose ranges end first there.

    If a joint has no room beside another follower, it has none beside one of these.
    """
    ranges = [ranges_at_leader(leader.limits, [joint])[1] for joint in followers]
    indices = range(len(followers))
    ends = (sorted(indices, key=lambda k: -ranges[k][0])[:2], sorted(indices, key=lambda k: ranges[k][1])[:2])
    return [followers[k] for k in sorted({*ends[0], *ends[1]})]
