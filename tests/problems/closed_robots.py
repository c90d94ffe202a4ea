"""Robots with loops, and the same ones as Pinocchio builds them."""

from pathlib import Path

import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

import jounce as jn

FIVE_BAR = Path(__file__).parents[2] / "examples" / "robots" / "five_bar.xml"


def random_inertia(random):
    """Return an inertia that a body can have."""
    turn = Rotation.random(random_state=random).as_matrix()
    moments = turn @ np.diag(random.uniform(0.02, 0.03, 3)) @ turn.T
    return jn.Inertia(random.uniform(0.5, 2.0), random.uniform(-0.2, 0.2, 3), moments)


def random_loop(count=7, seed=4):
    """Return a loop of hinges in any directions, welded where it is closed: of seven, one degree of freedom is left."""
    random = np.random.default_rng(seed)
    links, joints = [jn.Link("link_0")], []
    for k in range(1, count):
        links.append(jn.Link(f"link_{k}", random_inertia(random)))
        rotation = Rotation.random(random_state=random).as_matrix()
        place, axis = random.uniform(-0.4, 0.4, 3), random.normal(size=3)
        joints.append(jn.Joint(f"joint_{k}", f"link_{k - 1}", f"link_{k}", position=place, rotation=rotation, axis=axis))
    pin = jn.Closure("pin", (links[-1].name, "link_0"), "pin", [0.2, -0.1, 0.3], axis=random.normal(size=3))
    return jn.Robot("loop", links, joints, gravity=[0.5, -1.0, -9.0], closures=[pin])


def in_pinocchio(robot):
    """Return a tree as a model of Pinocchio, with joints in the order of the robot, and the frames of its links."""
    model = pinocchio.Model()
    model.gravity.linear = np.array(robot.gravity)
    places = {robot.base: (0, pinocchio.SE3.Identity())}
    for joint in robot.joints.values():
        parent, at = places[joint.parent]
        here = at * pinocchio.SE3(np.array(joint.rotation), np.array(joint.position))
        if joint.moving:
            kind = pinocchio.JointModelRevoluteUnaligned if joint.turning else pinocchio.JointModelPrismaticUnaligned
            parent, here = model.addJoint(parent, kind(np.array(joint.axis)), here, joint.name), pinocchio.SE3.Identity()
        places[joint.child] = (parent, here)
        inertia = robot.links[joint.child].inertia
        if inertia is not None:
            mass, center, tensor = inertia.mass, np.array(inertia.center_of_mass), np.array(inertia.tensor)
            model.appendBodyToJoint(parent, pinocchio.Inertia(mass, center, tensor), here)
    return model, places


def constraint_model(robot, model, places, closure, kind):
    """Return a closure as Pinocchio has it: of the points of both links, or of their whole frames."""
    frames = []
    for link, point, turned in zip(closure.links, closure.points, (np.eye(3), closure.rotation.T), strict=True):
        joint, here = places[link]
        frames.append((joint, here * pinocchio.SE3(turned, np.array(point))))
    (first, here), (second, there) = frames
    constraint = pinocchio.RigidConstraintModel(kind, model, first, here, second, there, pinocchio.ReferenceFrame.LOCAL)
    return constraint
