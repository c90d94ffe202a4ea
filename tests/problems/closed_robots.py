"""Robots with loops, and the same ones as Pinocchio builds them."""

from pathlib import Path

import numpy as np
import pinocchio

FIVE_BAR = Path(__file__).parents[2] / "examples" / "robots" / "five_bar.xml"


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
            parent = model.addJoint(parent, kind(np.array(joint.axis)), here, joint.name)
            here = pinocchio.SE3.Identity()
        places[joint.child] = (parent, here)
        inertia = robot.links[joint.child].inertia
        if inertia is not None:
            mass, center, tensor = inertia.mass, np.array(inertia.center_of_mass), np.array(inertia.tensor)
            model.appendBodyToJoint(parent, pinocchio.Inertia(mass, center, tensor), here)
    return model, places


def in_contact(model, places, closure):
    """Return a connect or weld as Pinocchio holds it: the points of both links in one place, or their whole frames."""
    kind = pinocchio.ContactType.CONTACT_6D if closure.type == "weld" else pinocchio.ContactType.CONTACT_3D
    ends = []
    for link, point, turned in zip(closure.links, closure.points, (np.eye(3), closure.rotation.T), strict=True):
        joint, here = places[link]
        ends += [joint, here * pinocchio.SE3(np.array(turned), np.array(point))]
    return pinocchio.RigidConstraintModel(kind, model, *ends, pinocchio.ReferenceFrame.LOCAL)


def forward(model, constraint, state, torque):
    """Return Pinocchio's accelerations under joint torques, and the force on the first link, in its axes."""
    constraints, kept = pinocchio.StdVec_RigidConstraintModel(), pinocchio.StdVec_RigidConstraintData()
    constraints.append(constraint)
    kept.append(constraint.createData())
    data = model.createData()
    pinocchio.initConstraintDynamics(model, data, constraints, kept)
    settings = pinocchio.ProximalSettings(1e-14, 1e-12, 30)  # directions that are redundant bear nothing
    found = pinocchio.constraintDynamics(model, data, state[0], state[1], torque, constraints, kept, settings)
    return np.array(found), np.array(kept[0].contact_force.vector)


def inverse(model, q):
    """Return the generalized forces of the tree and their rates, (2, n), from derivatives to the third, (4, n)."""
    data = model.createData()
    force = np.array(pinocchio.rnea(model, data, *q[:3]))
    pinocchio.computeRNEADerivatives(model, data, *q[:3])
    mass = np.triu(data.M) + np.triu(data.M, 1).T
    return np.array([force, data.dtau_dq @ q[1] + data.dtau_dv @ q[2] + mass @ q[3]])
