"""Robots with closed loops, which move as the mechanisms that they are."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from jounce.errors import JounceError, RobotError
from jounce.robot.robot import Robot
from jounce.viewer.mechanisms import take_of
from jounce.viewer.robots import FRAMES, RobotSubject, swing_parameters, swinging
from jounce.viewer.take import Parameter, Take

__all__ = ["ClosedRobotSubject"]


class ClosedRobotSubject(RobotSubject):
    """A robot with closures: as many joints are driven as it has degrees of freedom.

    Its trajectory is that of the driven joints; without, the first joints that determine the others swing.

    Raises
    ------
    RobotError
        If the trajectory names joints that the robot does not have, or no joints drive all others.
    """

    @cached_property
    def driven(self) -> tuple[str, ...]:
        """Joints that drive all others."""
        if self.trajectory is not None:
            return self.trajectory.names
        return independent(self.robot)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """How the driven joints swing; none with a trajectory."""
        if self.trajectory is not None:
            return ()
        found = []
        for parameter in swing_parameters(self.robot, self.driven):
            if parameter.name.endswith(" swing"):  # loops leave less room than the limits
                parameter = dataclasses.replace(parameter, value=0.5 * parameter.value)
            found.append(parameter)
        return tuple(found)

    def solve(self, values: Mapping[str, float], order: int) -> Take:
        """Return the motion for some swings.

        Raises
        ------
        JounceError
            If the loops cannot be closed.
        """
        from jounce.kinematics import solve

        robot = self.robot
        laws = self.trajectory if self.trajectory is not None else swinging(robot, values, self.driven)
        times = laws.times if self.trajectory is not None else np.linspace(laws.start, laws.stop, FRAMES)
        motion = solve(robot.mechanism(drivers=laws, time=times), order=order, strict=False)
        return dataclasses.replace(take_of(motion, self.looks, robot.name, robot.base), values=dict(values))


def independent(robot: Robot) -> tuple[str, ...]:
    """Return joints whose coordinates determine all others: first those with drives, and those near the base.

    Raises
    ------
    RobotError
        If there are none.
    """
    from jounce.kinematics import solve
    from jounce.robot.closures import Loops

    loops = Loops(robot)
    start = loops.closed(np.zeros(len(robot.joint_names)), np.ones(len(robot.joint_names), bool))
    freedom = len(start) - sum(len(kept) for kept, _ in loops.independent(start))
    names = sorted(robot.joint_names, key=lambda name: (robot.limits[name].effort is None, _depth(robot, name)))
    for chosen in _choices(tuple(names), freedom):
        try:
            solve(robot.mechanism(start, drivers=_still(robot, chosen, start), time=[0.0]), order=0)
        except JounceError:
            continue
        return tuple(name for name in robot.joint_names if name in chosen)
    raise RobotError("no joints drive all others; give a trajectory of those that are driven", name=robot.name)


def _depth(robot: Robot, name: str) -> int:
    """Return how many moving joints are between a joint and the base."""
    parents = {joint.child: joint for joint in robot.joints.values()}
    count, link = 0, robot.joints[name].parent
    while link in parents:
        count, link = count + parents[link].moving, parents[link].parent
    return count


def _still(robot: Robot, names: tuple[str, ...], start: np.ndarray) -> dict[str, float]:
    return {name: float(start[robot.joint_names.index(name)]) for name in names}


def _choices(names: tuple[str, ...], count: int) -> Any:
    """Give the choices of some joints in the order of the tree; not more than are tried in a few seconds."""
    from itertools import combinations, islice

    return islice(combinations(names, count), 60)
