"""The size of a robot, the length scale that makes lengths comparable with angles."""

import numpy as np

from jounce.robot.model.abstract_robot import AbstractRobot


def robot_size(robot: AbstractRobot) -> float:
    """Return the size of a robot: the longest path along its links from the base to a center of mass, or 1 m."""
    tree = robot.tree
    arms = np.linalg.norm(tree.position, axis=1)
    distances = tree.ancestors[:-1] @ arms + np.linalg.norm(tree.center, axis=1)
    return float(distances.max(initial=0.0)) or 1.0
