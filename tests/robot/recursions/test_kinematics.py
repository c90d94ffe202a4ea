"""Frames, points and center of mass: closed forms to high order, sums over links, and words of refusals."""

import math

import numpy as np
import pytest

import jounce as jn
from jounce.robot.model.arguments import floats
from tests.problems.robots import coordinates, poses, robot_named

NAMES = ("planar_arm", "mimic", "serial")
ROD = jn.Inertia(1.0, [0.5, 0, 0])
PIN = jn.Robot("one", [jn.Link("base"), jn.Link("rod", ROD)], [jn.Joint("pin", "base", "rod")])


def state(robot, order=0):
    """Return a random position with `order` further derivatives, and the coordinates of all joints by name."""
    values = coordinates(robot, seed=4)
    q = np.zeros((order + 1, len(robot.joint_names)))
    q[0] = [values[name] for name in robot.joint_names]
    q[1:] = np.random.default_rng(5).uniform(-1, 1, q[1:].shape)
    return q, values


@pytest.mark.parametrize("name", NAMES)
def test_every_frame_is_a_product_of_transforms(name):
    robot = robot_named(name)
    q, values = state(robot)
    expected = poses(robot, values)
    for link in robot.link_names:
        motion = jn.forward_kinematics(robot, q, link)
        np.testing.assert_allclose(motion.rotation[0], expected[link][:3, :3], rtol=0, atol=2e-15)
        np.testing.assert_allclose(motion.position[0], expected[link][:3, 3], rtol=0, atol=2e-15)
        assert motion.angular_velocity.shape == (0, 3)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_center_of_mass_is_the_mean_of_those_of_the_links(name):
    robot = robot_named(name)
    q, values = state(robot, 2)
    moment = np.zeros((3, 3))
    for link, pose in poses(robot, values).items():
        inertia = robot.links[link].inertia
        if inertia is not None:
            motion = jn.forward_kinematics(robot, q, link, inertia.center_of_mass)
            expected = (pose @ np.append(inertia.center_of_mass, 1.0))[:3]
            np.testing.assert_allclose(motion.position[0], expected, rtol=0, atol=2e-15)
            moment += inertia.mass * motion.position
    np.testing.assert_allclose(jn.robot.center_of_mass(robot, q), moment / robot.mass, rtol=0, atol=1e-14)


def test_the_mass_of_the_base_counts():
    links = [jn.Link("base", jn.Inertia(3.0, [0, 0, 1])), jn.Link("rod", ROD)]
    robot = jn.Robot("one", links, [jn.Joint("pin", "base", "rod")])
    found = jn.robot.center_of_mass(robot, [[0.0], [2.0], [0.0]])
    np.testing.assert_allclose(found, [[0.125, 0, 0.75], [0, 0.25, 0], [-0.5, 0, 0]], rtol=0, atol=1e-15)


@pytest.mark.slow
def test_a_steady_turn_to_order_eight():
    rate, order = 1.5, 8
    q = np.zeros((order + 1, 1))
    q[:2, 0] = 0.3, rate
    motion = jn.forward_kinematics(PIN, q, "rod", [2.0, 0, 0.5])
    angles = 0.3 + np.arange(order + 1) * np.pi / 2
    scale = rate ** np.arange(order + 1)
    expected = 2 * scale[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    np.testing.assert_allclose(motion.position[:, :2], expected, rtol=0, atol=1e-14 * scale[-1])
    assert motion.position[:, 2].tolist() == [0.5] + [0.0] * order
    np.testing.assert_allclose(motion.rotation[:, :2, 0], expected / 2, rtol=0, atol=1e-14 * scale[-1])
    assert motion.angular_velocity.tolist() == [[0, 0, rate]] + [[0, 0, 0]] * (order - 1)


def test_a_spiral_of_a_slide_on_a_turntable():
    """Closed form: r = (1 + 2 t) (cos t^2, sin t^2), in complex numbers and by its series."""
    links = [jn.Link("base"), jn.Link("table", ROD), jn.Link("slide", ROD)]
    joints = [jn.Joint("turn", "base", "table"), jn.Joint("slide", "table", "slide", "prismatic", axis=[1, 0, 0])]
    q = np.zeros((7, 2))
    q[2, 0], q[0, 1], q[1, 1] = 2.0, 1.0, 2.0
    found = jn.forward_kinematics(jn.Robot("spiral", links, joints), q, "slide").position
    series = np.zeros(7, complex)
    for k in range(4):  # (1 + 2 t) exp(i t^2)
        power = 1j**k / math.factorial(k)
        series[2 * k] += power
        if 2 * k < 6:
            series[2 * k + 1] += 2 * power
    expected = series * [math.factorial(k) for k in range(7)]
    np.testing.assert_allclose(found[:, 0] + 1j * found[:, 1], expected, rtol=0, atol=1e-12)


def test_the_base_does_not_move():
    motion = jn.forward_kinematics(PIN, [[0.3], [1.0], [2.0]], "base", [1, 2, 3])
    assert motion.position.tolist() == [[1, 2, 3], [0, 0, 0], [0, 0, 0]]
    assert motion.rotation.tolist() == [np.eye(3).tolist(), np.zeros((3, 3)).tolist(), np.zeros((3, 3)).tolist()]
    assert not motion.angular_velocity.any()


NOTHING = jn.Robot("frame", [jn.Link("base")], [])


@pytest.mark.parametrize(
    "call, message",
    [
        (
            lambda: jn.forward_kinematics(PIN, [[0.0]], "rood"),
            "link: no link has this name, got 'rood'; did you mean 'rod'? valid: base, rod",
        ),
        (lambda: jn.forward_kinematics(PIN, [[0.0]], "rod", [0, 1]), "point: must have the shape (3,), not (2,)"),
        (
            lambda: jn.forward_kinematics(PIN, np.zeros((500, 1)), "rod"),
            "q: must have at most 30 derivatives along its last axis but one, not 499; positions at many instants "
            "alone have the shape (..., 1, n), as q[..., None, :]",
        ),
        (lambda: jn.jacobian(PIN, [[0.0]], "rod", [0, 1, np.nan]), "point: must be finite, got [0.0, 1.0, nan]"),
        (lambda: jn.jacobian(PIN, [[0.0]], "pin"), "link: no link has this name, got 'pin'; valid: base, rod"),
        (
            lambda: jn.forward_kinematics(PIN, [0.0], "rod"),
            "q: must have the shape (..., order + 1, n), not (1,); one has 1 joint: n = 1; stack positions and "
            "derivatives: np.stack([q, v, a])",
        ),
        (
            lambda: jn.inverse_dynamics(PIN, np.zeros((3, 2))),
            "q: must have the shape (..., order + 1, n), not (3, 2); one has 1 joint: n = 1",
        ),
        (
            lambda: jn.inverse_dynamics(PIN, np.zeros((2, 1))),
            "q: must hold q, q', q'' along its last axis but one: the shape (..., order + 1, n), not (2, 1)",
        ),
        (
            lambda: jn.robot.operational_accelerations(PIN, [[0.0]], "rod"),
            "q: must hold q, q' along its last axis but one: the shape (..., order + 1, n), not (1, 1)",
        ),
        (
            lambda: jn.robot.center_of_mass(PIN, np.zeros((0, 1))),
            "q: must hold q along its last axis but one: the shape (..., order + 1, n), not (0, 1)",
        ),
        (lambda: jn.inverse_dynamics(PIN, [[0.0], [1.0, 2.0]]), "q: must be an array of real numbers, got 'list'"),
        (
            lambda: jn.forward_kinematics(PIN, "rod", "rod"),
            "q: must be an array of real numbers, got 'rod'; the arguments are the robot, q, then the name of a link",
        ),
        (
            lambda: jn.mass_matrix(PIN, None, [0.0]),
            "mass_matrix: takes 2 arguments without names, not 3; write jn.mass_matrix(robot, q) for "
            "pin.crba(model, data, q)",
        ),
        (
            lambda: jn.jacobian(PIN, None, [0.0], "rod", None),
            "jacobian: takes 4 arguments without names, not 5; write jn.jacobian(robot, q[None], link)[0] for "
            "pin.computeFrameJacobian(model, data, q, frame, LOCAL_WORLD_ALIGNED)",
        ),
        (lambda: jn.inverse_dynamics(PIN, "q.csv"), "q: must be an array of real numbers, got 'str'"),
        (
            lambda: floats("q", jn.JointTrajectory({"pin": "t"}, 0.0, 1.0)),
            "q: must be an array of real numbers, got 'JointTrajectory'; of a trajectory, give "
            "derivatives(times, order), q and its rates at instants",
        ),
        (
            lambda: jn.inverse_dynamics(PIN, np.zeros((3, 1), complex)),
            "q: must be an array of real numbers, got 'ndarray'",
        ),
        (lambda: jn.robot.center_of_mass(NOTHING, np.zeros((1, 0))), "robot: no link has a mass, got 'frame'"),
    ],
)
def test_refused(call, message):
    with pytest.raises(jn.errors.RobotError) as caught:
        call()
    assert str(caught.value) == message
