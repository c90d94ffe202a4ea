"""Robots of random links and joints whose loop is closed."""

import numpy as np
from scipy.spatial.transform import Rotation

import jounce as jn


def random_inertia(random):
    """Return an inertia that a body can have."""
    turn = Rotation.random(random_state=random).as_matrix()
    moments = turn @ np.diag(random.uniform(0.02, 0.03, 3)) @ turn.T
    return jn.Inertia(random.uniform(0.5, 2.0), random.uniform(-0.2, 0.2, 3), moments)


def random_loop(seed=4, count=7):
    """Return a chain of hinges in any directions, welded to its base: seven have one degree of freedom left."""
    random = np.random.default_rng(seed)
    links, joints = [jn.Link("link_0")], []
    for k in range(1, count + 1):
        links.append(jn.Link(f"link_{k}", random_inertia(random)))
        rotation = Rotation.random(random_state=random).as_matrix()
        place, axis = random.uniform(-0.4, 0.4, 3), random.normal(size=3)
        joints.append(
            jn.Joint(f"joint_{k}", f"link_{k - 1}", f"link_{k}", position=place, rotation=rotation, axis=axis)
        )
    weld = jn.robot.Closure("weld", (links[-1].name, "link_0"), "weld", [0.2, -0.1, 0.3])
    return jn.Robot("loop", links, joints, gravity=[0.5, -1.0, -9.0], closures=[weld])
