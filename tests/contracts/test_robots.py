"""What holds for every robot of the bank in every state: identities of mechanics, with their rates."""

import math

import hypothesis
import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import strategies

import jounce as jn
from tests.problems.robots import NAMES, body_poses, coordinates, poses, robot_named

ORDER = 5  # of q, everywhere, so that each function is compiled once for a robot
QUICK = ("mimic", "floating_solo12")


# floating_solo12 holds what solo12 does, and panda and serial are chains of hinges as ur5 is
SLOW = tuple(name for name in NAMES if name not in (*QUICK, "solo12", "ur5"))


@pytest.fixture(scope="module", params=[*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def robot(request):
    return robot_named(request.param)


def states(robot):
    """Return the strategy of two states of a robot, with derivatives of order ORDER."""
    return arrays.arrays(float, (2, ORDER + 1, len(robot.joint_names)), elements=strategies.floats(-1.5, 1.5))


def near(found, expected, tolerance=1e-11):
    """Assert that two arrays are equal to rounding, by the largest value."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= tolerance * max(1.0, np.abs(expected).max())


def leibniz(first, second, level):
    """Return a derivative of the inner product of two arrays of derivatives, of shape (samples, levels, n)."""
    return sum(math.comb(level, i) * (first[:, i] * second[:, level - i]).sum(axis=-1) for i in range(level + 1))


def shifted(q, step):
    """Return the derivatives a step later of the polynomials in time that have these ones, along axis 1."""
    count = q.shape[1]
    later = [
        sum(q[:, k + j] * step**j / math.factorial(j) for j in range(count - k))  # Taylor's sum, exact
        for k in range(count)
    ]
    return np.stack(later, axis=1)


def last_link(robot):
    return robot.moving_links[-1]


@pytest.mark.slow
@hypothesis.given(data=strategies.data())
def test_power_balances_energy_with_rates(robot, data):
    q = data.draw(states(robot))
    torque = jn.inverse_dynamics(robot, q, drives=False)  # damping and friction take energy away
    kinetic = jn.energy.kinetic_energy(robot, q, drives=False).total
    potential = -robot.mass * jn.robot.center_of_mass(robot, q) @ robot.gravity
    levels = ORDER - 1
    power = np.stack([leibniz(torque, q[:, 1:], level) for level in range(levels)], axis=1)
    near(power, kinetic[:, 1 : levels + 1] + potential[:, 1 : levels + 1])


@pytest.mark.slow
@hypothesis.given(data=strategies.data())
def test_frames_are_those_of_the_joints_in_turn(robot, data):
    q = data.draw(states(robot))
    values = dict(zip(robot.joint_names, q[0, 0], strict=True))
    for joint in robot.joints.values():
        if joint.moving and joint.mimic is not None:
            values[joint.name] = sum(by * values[x] for x, by in joint.mimic.weights.items()) + joint.mimic.offset
    expected = poses(robot, values)
    for link in (robot.base, robot.link_names[-1], last_link(robot)):
        motion = jn.forward_kinematics(robot, q, link, [0.1, -0.2, 0.3])
        near(motion.rotation[0, 0], expected[link][:3, :3], 1e-13)
        near(motion.position[0, 0], (expected[link] @ [0.1, -0.2, 0.3, 1])[:3], 1e-13)


@pytest.mark.slow
@hypothesis.given(data=strategies.data())
def test_derivatives_follow_each_other(robot, data):
    step = 1e-3  # the terms left out are below the tolerances
    start = data.draw(states(robot))[:1]
    q = np.concatenate([start, shifted(start, step)])
    motion = jn.forward_kinematics(robot, q, last_link(robot), [0.1, -0.2, 0.3])
    results = (
        motion.position,
        motion.rotation,
        motion.angular_velocity,
        jn.robot.center_of_mass(robot, q),
        jn.jacobian(robot, q, last_link(robot), [0.1, -0.2, 0.3]),
        jn.inverse_dynamics(robot, q, drives=False),  # friction jumps where a velocity changes its sign
    )
    for result in results:
        later = shifted(result[:1], step)
        count = result.shape[1]
        for k in range(2):
            scale = max(1.0, np.abs(result).max())  # the next derivative is hardly larger than a hundred times this
            left_out = 100 * scale * step ** (count - k) / math.factorial(count - k) + 1e-12 * scale
            assert np.abs(later[0, k] - result[1, k]).max() <= left_out


@pytest.mark.slow
@hypothesis.given(data=strategies.data())
def test_spin_turns_the_axes(robot, data):
    q = data.draw(states(robot))
    motion = jn.forward_kinematics(robot, q, last_link(robot))
    for level in range(ORDER):
        expected = sum(
            math.comb(level, i)
            * np.cross(motion.angular_velocity[:, i][:, None], motion.rotation[:, level - i].swapaxes(1, 2))
            for i in range(level + 1)
        )
        near(motion.rotation[:, level + 1].swapaxes(1, 2), expected)


@pytest.mark.slow
@hypothesis.given(data=strategies.data())
def test_operational_accelerations_are_sums_of_jacobian_rates(robot, data):
    q = data.draw(states(robot))
    place = last_link(robot), [0.1, -0.2, 0.3]
    jacobian = jn.jacobian(robot, q, *place)
    found = jn.robot.operational_accelerations(robot, q, *place)
    motion = jn.forward_kinematics(robot, q, *place)
    near(found, np.concatenate([motion.position[:, 1:], motion.angular_velocity], axis=-1))
    for m in range(1, ORDER + 1):  # Negrean 2025, equation 59
        expected = sum(math.comb(m - 1, k) * np.einsum("sij,sj->si", jacobian[:, k], q[:, m - k]) for k in range(m))
        near(found[:, m - 1], expected)


@pytest.mark.slow
@hypothesis.given(data=strategies.data())
@hypothesis.settings(max_examples=4)
def test_the_mass_matrix_is_symmetric_and_positive(robot, data):
    q = data.draw(states(robot))
    matrix = jn.mass_matrix(robot, q, rates=True)[0, 0]
    near(matrix, matrix.T, 1e-13)
    assert np.linalg.eigvalsh(matrix).min() > 0
    energy = jn.energy.kinetic_energy(robot, q).total[0, 0]
    near(energy, q[0, 1] @ matrix @ q[0, 1] / 2, 1e-13)


@pytest.mark.slow
@hypothesis.given(data=strategies.data())
@hypothesis.settings(max_examples=4)
def test_torques_are_of_the_mass_matrix_and_the_bias_with_rates(robot, data):
    q = data.draw(states(robot))
    torque = jn.inverse_dynamics(robot, q)
    matrix, bias = jn.mass_matrix(robot, q, rates=True), jn.bias_forces(robot, q, rates=True)
    for k in range(ORDER - 1):
        terms = (math.comb(k, j) * np.einsum("sij,sj->si", matrix[:, j], q[:, 2 + k - j]) for j in range(k + 1))
        near(sum(terms) + bias[:, k], torque[:, k])


def test_the_arrays_of_the_tree_give_the_poses_of_the_links(robot):
    values = coordinates(robot)
    expected = poses(robot, values)
    bodies = [*body_poses(robot, values), np.eye(4)]  # the base last
    for link, frame in robot.frames.items():
        local = np.eye(4)
        local[:3, :3], local[:3, 3] = frame.rotation, frame.position
        near(bodies[frame.body] @ local, expected[link], 1e-14)
