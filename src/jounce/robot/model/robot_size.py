"""The size of a robot, by which lengths are compared with angles."""

import numpy as np

from jounce.robot.model.abstract_robot import AbstractRobot


def robot_size(robot: AbstractRobot) -> float:
    """Return the size of a robot: the longest way from its base to a center of mass, along the links; 1 m for none."""
    tree = robot.tree
    arms = np.linalg.norm(tree.position, axis=1)
    distances = tree.ancestors[:-1] @ arms + np.linalg.norm(tree.center, axis=1)
    return float(distances.max(initial=0.0)) or 1.0
