"""Joints whose ranges leave their leader no room to move: these ranges are ignored."""

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
    """Return the joints, without the ranges that leave the leader of their joint no room to move.

    A range that leaves at most one point of the range of the leader is a fault of the file: a copied block of limits,
    or a missing sign of the multiplier. A range that suits the leader alone precedes one that does not. Of ranges that
    suit the leader but not one another, all are ignored.

    Parameters
    ----------
    joints : sequence of Joint
        Joints of the file.
    faults : Faults
        Records the ignored ranges.
    located : callable
        Converts an error of the robot to an error of the file, with the line.
    fixed : collection of str, optional
        Joints that are held in one position, whatever their range.

    Raises
    ------
    RobotFileError
        If an ignored range is an error.
    """
    by_name = {joint.name: joint for joint in joints}
    followers_of: dict[str, list[Joint]] = {}
    for joint in joints:
        ranged = (joint.limits.lower, joint.limits.upper) != (None, None)
        if joint.moving and joint.mimic and ranged and not joint.mimic.several and joint.mimic.multiplier:
            followers_of.setdefault(joint.mimic.joint, []).append(joint)
    for leader in joints:
        followers = followers_of.get(leader.name, [])
        if not followers or leader.name in fixed or has_room(leader.limits, followers):
            continue
        rejected = {joint.name for joint in followers if not has_room(leader.limits, [joint])}
        rest = [joint for joint in followers if joint.name not in rejected]
        narrowing = _narrowing(leader, rest)
        for joint in followers:
            fits = joint.name not in rejected
            other_joints = [x for x in narrowing if x is not joint] if fits else []
            conflicting = [x.name for x in other_joints if not has_room(leader.limits, [joint, x])]
            if fits and not conflicting:
                continue
            own, (low, high) = ranges_at_leader(leader.limits, [joint])
            conflict = f" beside {', '.join(conflicting)}" if conflicting else ""
            message = (
                f"its range leaves {leader.name}, which it follows, {low:.6g} to {high:.6g} of "
                f"{own[0]:.6g} to {own[1]:.6g}{conflict}: no room to move; correct the limits or the multiplier, "
                "or read the file without strict"
            )
            error = RobotError(message, name=f"joints.{joint.name}.limit")
            faults.leave_out(NO_ROOM, f"{joint.name}, which follows {leader.name}", located(error))
            by_name[joint.name] = dataclasses.replace(
                joint, limits=dataclasses.replace(joint.limits, lower=None, upper=None)
            )
    return list(by_name.values())


def _narrowing(leader: Joint, followers: Sequence[Joint]) -> list[Joint]:
    """Return the two followers with the highest lower ends, and the two with the lowest upper ends, seen at the leader.

    If a joint has no room beside another follower, it has none beside one of these.
    """
    ranges = [ranges_at_leader(leader.limits, [joint])[1] for joint in followers]
    indices = range(len(followers))
    ends = (sorted(indices, key=lambda k: -ranges[k][0])[:2], sorted(indices, key=lambda k: ranges[k][1])[:2])
    return [followers[k] for k in sorted({*ends[0], *ends[1]})]
