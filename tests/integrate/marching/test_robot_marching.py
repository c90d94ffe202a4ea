"""Where steps of robots are looked at: all along, unless nothing in their equations jumps."""

from functools import partial

import numpy as np
import pytest

import jounce as jn
from jounce.integrate.marching.robot_marching import RobotProblem
from jounce.robot import BallDrive, Tendon
from jounce.robot.model.joint_laws import joint_laws
from jounce.robot.recursions.tree_equations import TreeEquations


def gimbal(*couplings, friction: float | tuple[float, float] = 0.0):
    """Return a body on three turns in a row about z, y and x."""
    names, axes = ("base", "z", "y", "x"), np.eye(3)[::-1]
    links = [jn.Link(name, jn.Inertia(1.0, tensor=[1.0, 1.0, 1.0])) for name in names]
    pairs = zip(names, names[1:], axes, strict=False)
    joints = [jn.Joint(b, a, b, axis=axis, friction=friction if b == "z" else 0.0) for a, b, axis in pairs]
    return jn.Robot("gimbal", links, joints, couplings=couplings)


NAMES = ("z", "y", "x")
NO_LAWS = joint_laws(NAMES, None)
BALL, LINE = partial(BallDrive, "ball", NAMES), partial(Tendon, "line", {"z": 1.0})


@pytest.mark.parametrize(
    "robot, rubbing",
    [
        (gimbal(BALL(damping=1.0), LINE(stiffness=1.0, damping=1.0)), False),
        (gimbal(friction=0.1), True),
        (gimbal(friction=(0.0, 0.1)), True),
        (gimbal(friction=(0.1, 0.0)), True),
        (gimbal(BALL(friction=0.1)), True),
        (gimbal(LINE(friction=0.1)), True),
    ],
)
def test_friction_is_known_before_programs_are_made(robot, rubbing):
    # a series departs most at the end of a step only where nothing jumps
    assert robot.tree.shape.rubbing is rubbing

    def problem(torque=NO_LAWS, *, drives=False):
        equations = TreeEquations(robot.tree, np.zeros(3), drives=drives)
        return RobotProblem(equations, torque, NO_LAWS, np.ones(3), 1.0)

    assert problem(drives=True).smooth is not rubbing
    assert problem().smooth
    assert not problem(joint_laws(NAMES, {"z": "-z"})).smooth
