"""Robots with closed loops, which move as mechanisms."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from itertools import combinations, islice

from jounce.errors import JounceError, RobotError
from jounce.kinematics import solve
from jounce.robot.closed_loops.closures import Loops, given_coordinates
from jounce.robot.robot import Robot
from jounce.viewer.shapes.recording import Recording
from jounce.viewer.subjects.mechanisms import recorded
from jounce.viewer.subjects.robots import RobotSubject

MOST_TRIED = 60  # trial choices of driven joints, which take a few seconds


class ClosedRobotSubject(RobotSubject):
    """A robot with closures, with as many driven joints as degrees of freedom.

    Its trajectory is that of the driven joints; by default, the first joints that determine the others swing.

    Raises
    ------
    RobotError
        If the trajectory names joints that the robot does not have, or no joints drive all others.
    """

    def joints_driven(self) -> tuple[tuple[str, ...], float]:
        """Return the joints that drive all others, and the fraction of their swings that loops permit."""
        return (independent(self.robot) if self.trajectory is None else self.trajectory.names), 0.5

    def solve(self, values: Mapping[str, float], order: int) -> Recording:
        """Return the motion for some swings.

        Raises
        ------
        JounceError
            If the loops cannot be closed.
        """
        robot, (laws, times) = self.robot, self.laws(values)
        motion = solve(robot.mechanism(drivers=laws, time=times), order=order, strict=False)
        return dataclasses.replace(recorded(motion, self.appearance, robot.name, robot.base), values=dict(values))


def independent(robot: Robot) -> tuple[str, ...]:
    """Return joints whose coordinates determine all others, preferring those with drives and those near the base.

    Raises
    ------
    RobotError
        If there are none.
    """
    loops = Loops(robot)
    start = loops.closed(given_coordinates(robot, None))
    freedom = len(start) - sum(len(chosen_here) for chosen_here, _ in loops.independent(start))
    names = sorted(robot.joint_names, key=lambda name: (robot.limits[name].effort is None, _depth(robot, name)))
    for chosen in islice(combinations(names, freedom), MOST_TRIED):
        fixed = {name: float(start[robot.joint_names.index(name)]) for name in chosen}
        try:
            solve(robot.mechanism(start, drivers=fixed, time=[0.0], drives=False), order=0)
        except JounceError:
            continue
        return tuple(name for name in robot.joint_names if name in chosen)
    raise RobotError("no joints drive all others; give a trajectory of those that are driven", name=robot.name)


def _depth(robot: Robot, name: str) -> int:
    """Return the number of moving joints between a joint and the base."""
    parents = {joint.child: joint for joint in robot.joints.values()}
    count, link = 0, robot.joints[name].parent
    while link in parents:
        count, link = count + parents[link].moving, parents[link].parent
    return count
