"""The joints of a floating base: three slides, then three turns."""

import numpy as np

from jounce.errors import RobotError
from jounce.robot.model.links_and_joints import Joint, Link


def floating_joints(
    base: str, sequence: str = "ZYX", prefix: str = "base", world: str = "world"
) -> tuple[list[Link], list[Joint]]:
    """Return the links and joints that let a link move freely: slides along x, y, z, then turns about moving axes.

    Parameters
    ----------
    base : str
        Name of the link that becomes free.
    sequence : str, default "ZYX"
        Axes of the three turns.
    prefix : str, default "base"
        Prefix of the names.
    world : str, default "world"
        Name of the new base.

    Raises
    ------
    RobotError
        If the sequence is not three letters X, Y, Z of which neighbors differ.
    """
    letters = sequence.upper()
    if len(letters) != 3 or set(letters) - set("XYZ") or letters[0] == letters[1] or letters[1] == letters[2]:
        message = "must be three letters X, Y, Z of which neighbors differ"
        raise RobotError(message, name="sequence", value=sequence)
    axes = dict(zip("XYZ", np.eye(3), strict=True))
    kinds = [("prismatic", axes[letter], letter.lower()) for letter in "XYZ"]
    kinds += [("continuous", axes[letter], f"angle_{k}") for k, letter in enumerate(letters, 1)]
    links, joints = [Link(world)], []
    for k, (kind, axis, suffix) in enumerate(kinds):
        child = base if k == 5 else f"{prefix}_frame_{k + 1}"
        joints.append(Joint(f"{prefix}_{suffix}", links[-1].name, child, kind, axis=axis))
        if k < 5:
            links.append(Link(child))
    return links, joints
