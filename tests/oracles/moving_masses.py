"""Energy, momentum and losses of a robot by their definitions, with derivatives, from how its links move.

Arrays of derivatives have the samples first and the derivatives along axis 1.
"""

import math

import numpy as np

import jounce as jn


def product(first, second, function=np.multiply):
    """Return derivatives of a product of arrays of derivatives, which come along axis 1."""
    return np.stack(
        [
            sum(math.comb(k, i) * function(first[:, i], second[:, k - i]) for i in range(k + 1))
            for k in range(min(first.shape[1], second.shape[1]))
        ],
        axis=1,
    )


def dot(first, second):
    """Return derivatives of the inner product."""
    return product(first, second, lambda a, b: (a * b).sum(-1))


def applied(matrix, vector):
    """Return derivatives of a matrix times a vector."""
    return product(matrix, vector, lambda a, b: np.einsum("sij,sj->si", a, b))


def crossed(first, second):
    """Return derivatives of the cross product."""
    return product(first, second, np.cross)


def followed(robot, q):
    """Return derivatives of all moving joints by name, followers too, (count, order + 1)."""
    values = {name: q[:, :, k] for k, name in enumerate(robot.joint_names)}
    for joint in robot.joints.values():
        if joint.moving and joint.mimic is not None:
            values[joint.name] = joint.mimic.multiplier * values[joint.mimic.joint]
            values[joint.name][:, 0] += joint.mimic.offset
    return values


def relative_spin(robot, ball, q):
    """Return the angular velocity of the link that a ball moves relative to that which carries it, in its axes."""
    carried = jn.forward_kinematics(robot, q, robot.joints[ball.joints[-1]].child)
    carrying = jn.forward_kinematics(robot, q, robot.joints[ball.joints[0]].parent)
    spin = np.asarray(carried.angular_velocity) - np.asarray(carrying.angular_velocity)
    return applied(np.asarray(carried.rotation).swapaxes(-1, -2), spin)


def lengths(robot, values):
    """Return the derivatives of the length of each tendon."""
    tendons = [x for x in robot.couplings.values() if isinstance(x, jn.robot.Tendon)]
    return [(x, sum(weight * values[joint] for joint, weight in x.weights.items())) for x in tendons]


def masses(robot, q):
    """Yield each link that has mass: mass and share of gravity, the path of its center, and its spin (both in the axes
    of the base), attitude and tensor.
    """
    for link in robot.links.values():
        if link.inertia is not None:
            motion = jn.forward_kinematics(robot, q, link.name, link.inertia.center_of_mass)
            parts = (np.asarray(x) for x in (motion.position, motion.angular_velocity, motion.rotation))
            yield link, *parts, np.asarray(link.inertia.tensor)


def spin_momentum(spin, rotation, tensor):
    """Return the derivatives of the angular momentum about the center of mass."""
    local = applied(rotation.swapaxes(-1, -2), spin)
    return applied(rotation, local @ tensor.T)


def change_of_momentum(robot, q):
    """Return the derivatives of the rates of momentum and of angular momentum about the base, less weights.

    Both by components in the axes of the base, (count, levels, 6): what holds the base, and nothing else, gives them.
    """
    levels = q.shape[1] - 2
    force, moment = np.zeros((2, len(q), levels, 3))
    for link, path, spin, rotation, tensor in masses(robot, q):
        push = link.inertia.mass * path[:, 2:]
        push[:, 0] -= link.inertia.mass * link.gravity * robot.gravity
        force += push
        moment += crossed(path[:, :levels], push) + spin_momentum(spin, rotation, tensor)[:, 1:]
    return np.concatenate([force, moment], axis=-1)


def energy(robot, q):
    """Return derivatives of kinetic and potential energy."""
    values = followed(robot, q)
    kinetic, potential = np.zeros((len(q), q.shape[1] - 1)), np.zeros(q.shape[:2])
    for link, path, spin, rotation, tensor in masses(robot, q):
        mass, rates = link.inertia.mass, path[:, 1:]
        kinetic += mass * dot(rates, rates) / 2 + dot(spin, spin_momentum(spin, rotation, tensor)) / 2
        potential -= mass * link.gravity * (path @ robot.gravity)
    for joint in robot.moving_joints:
        rate, elongation = values[joint.name][:, 1:], values[joint.name].copy()
        elongation[:, 0] -= joint.spring_reference
        kinetic += joint.armature * product(rate, rate) / 2
        potential += joint.stiffness * product(elongation, elongation) / 2
    for line, length in lengths(robot, values):
        elongation = length.copy()
        elongation[:, 0] -= line.rest
        kinetic += line.armature * product(length[:, 1:], length[:, 1:]) / 2
        potential += line.stiffness * product(elongation, elongation) / 2
    for ball in robot.couplings.values():
        if isinstance(ball, jn.robot.BallDrive):
            spin = relative_spin(robot, ball, q)
            kinetic += ball.armature * dot(spin, spin) / 2
    return kinetic, potential


def lost(robot, q):
    """Return derivatives of the power that dampers and friction take."""
    values, power = followed(robot, q), np.zeros((len(q), q.shape[1] - 1))
    for joint in robot.moving_joints:
        rate = values[joint.name][:, 1:]
        forward, backward = np.broadcast_to(joint.friction, 2)
        power += joint.damping * product(rate, rate)
        power += np.where(rate[:, :1] > 0, forward, -backward) * rate
    for line, length in lengths(robot, values):
        rate = length[:, 1:]
        power += line.damping * product(rate, rate) + line.friction * np.sign(rate[:, :1]) * rate
    for ball in robot.couplings.values():
        if isinstance(ball, jn.robot.BallDrive):
            spin = relative_spin(robot, ball, q)
            power += ball.damping * dot(spin, spin) + ball.friction * (np.sign(spin[:, :1]) * spin).sum(-1)
    return power
