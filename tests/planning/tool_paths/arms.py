"""Arms whose inverse kinematics has a closed form."""

import numpy as np
from scipy.spatial.transform import Rotation

from jounce.robot import Inertia, Joint, Limits, Link, Robot


def planar_chain(lengths, lower=None, upper=None):
    """Return links one after the other along x, that turn about z."""
    rod = Inertia(1.0, center_of_mass=[0.1, 0, 0], tensor=[0.1, 0.1, 0.1])
    links, joints, place = [Link("base")], [], 0.0
    for k, length in enumerate(lengths):
        links.append(Link(f"link_{k}", rod))
        joints.append(
            Joint(f"joint_{k}", links[-2].name, f"link_{k}", position=[place, 0, 0], limits=Limits(lower, upper))
        )
        place = length
    return Robot("chain", links, joints)


def wrist_arm(seed):
    """Return an arm with a shoulder about z, two joints about y and a spherical wrist, its frames drawn at random.

    With it, the center of the wrist in the frame of the hand, the shoulder with its axes, and the two lengths.
    """
    generator = np.random.default_rng(seed)
    turns = Rotation.random(7, rng=generator).as_matrix()
    upper, lower = 0.6, 0.5
    x, y, z = np.eye(3)
    axes = [z, y, y, x, y, x]
    arms = [generator.uniform(-0.4, 0.4, 3), 0 * x, upper * x, lower * x, 0 * x, 0 * x]
    # in frames without turns, body k stands at arms[k] from body k - 1; each frame is then turned by turns[k + 1]
    mass = Inertia(1.0, tensor=[0.1, 0.1, 0.1])
    names = ["base", *(f"body_{k}" for k in range(5)), "hand"]
    links, joints = [Link(name, mass) for name in names], []
    for k, (axis, arm) in enumerate(zip(axes, arms, strict=True)):
        before, after = turns[k], turns[k + 1]
        joints.append(
            Joint(f"joint_{k}", names[k], names[k + 1], "revolute", before.T @ arm, before.T @ after, after.T @ axis)
        )
    parts = {
        "center": np.zeros(3),
        "origin": turns[0].T @ arms[0],
        "axes": turns[0].T,
        "lengths": (upper, lower),
    }
    return Robot("wrist_arm", links, joints), parts
