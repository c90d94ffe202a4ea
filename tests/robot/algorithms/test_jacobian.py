"""Jacobians against differences of poses, joint by joint; the identities of their rates are in tests/contracts."""

import math

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.spatial.transform import Rotation

import jounce as jn
from tests.dynamics.energy.test_equations import in_digits, tree
from tests.oracles import mp_robot
from tests.problems.robots import poses, robot_named

POINT = [0.1, -0.2, 0.3]


def values_of(robot, q):
    """Return the coordinates of all moving joints by name."""
    values = dict(zip(robot.joint_names, q, strict=True))
    for joint in robot.joints.values():
        if joint.moving and joint.mimic is not None:
            values[joint.name] = joint.mimic.multiplier * values[joint.mimic.joint] + joint.mimic.offset
    return values


def differences(robot, q, link, step):
    """Return the Jacobian by central differences of the poses, of fourth order in the step."""
    columns = []
    for k in range(len(q)):
        total = np.zeros(6)
        for weight, steps in ((8 / 12, 1), (-1 / 12, 2)):
            ahead, behind = (
                poses(robot, values_of(robot, q + s * steps * step * np.eye(len(q))[k]))[link] for s in (1, -1)
            )
            moved = ((ahead - behind) @ [*POINT, 1])[:3]
            turned = Rotation.from_matrix(ahead[:3, :3] @ behind[:3, :3].T).as_rotvec()
            total += weight * np.concatenate([moved, turned]) / step
        columns.append(total)
    return np.column_stack(columns)


@pytest.mark.parametrize("name", ["planar_arm", "mimic", "branched"])
def test_columns_are_the_speeds_of_unit_steps(name):
    robot = robot_named(name)
    q = np.random.default_rng(7).uniform(-1, 1, len(robot.joint_names))
    for link in robot.moving_links[::3]:
        found = jn.jacobian(robot, [q], link, POINT)[0]
        coarse, fine = (np.abs(differences(robot, q, link, h) - found).max() for h in (0.1, 0.05))
        assert fine <= 1e-5
        assert fine <= coarse / 12 + 1e-12  # of fourth order: a sixteenth


def test_joints_beyond_a_link_do_not_move_it():
    robot = robot_named("branched")
    q = np.random.default_rng(7).uniform(-1, 1, (3, len(robot.joint_names)))
    for k, link in enumerate(robot.moving_links):
        moved = np.abs(jn.jacobian(robot, q, link)).max(axis=(0, 1)) > 0
        assert not (moved & (robot.tree.ancestors[k] == 0)).any()
    assert not jn.jacobian(robot, q, robot.base).any()


def test_a_joint_that_is_followed_moves_by_all_its_followers():
    """Two equal pins in a row, the second following with -1: the tip moves on a line, as in a scissor lift."""
    rod = jn.Inertia(1.0, [0.5, 0, 0])
    joints = [
        jn.Joint("one", "base", "a"),
        jn.Joint("two", "a", "b", position=[1, 0, 0], mimic=jn.robot.Mimic("one", -2.0, np.pi)),
    ]
    robot = jn.Robot("scissors", [jn.Link("base"), jn.Link("a", rod), jn.Link("b", rod)], joints)
    angle = 0.7
    jacobian = jn.jacobian(robot, [[angle], [1.0]], "b", [-1, 0, 0])
    np.testing.assert_allclose(jacobian[0, :, 0], [-2 * np.sin(angle), 0, 0, 0, 0, -1], rtol=0, atol=1e-15)
    np.testing.assert_allclose(jacobian[1, :, 0], [-2 * np.cos(angle), 0, 0, 0, 0, 0], rtol=0, atol=1e-15)


def slope_in_digits(robot, q, link, n, m):
    """Return dr^(n) / dq^(m) of a point by differences of a series in fifty digits."""
    with mp.workdps(50):
        made, rows = in_digits(robot, q)
        body = [b.name for b in made.bodies].index(link)
        step, columns = mpf("1e-20"), []
        for j in range(len(rows)):
            sides = []
            for sign in (1, -1):
                moved = [list(row) for row in rows]
                moved[j][m] += sign * step
                point = mp_robot.State(made, [mp_robot.motion(row) for row in moved]).point(body, POINT)
                sides.append([part.derivatives()[n] for part in point])
            columns.append([float((a - b) / (2 * step)) for a, b in zip(*sides, strict=True)])
        return np.array(columns).T


@pytest.mark.parametrize("n, m", [(0, 0), (3, 0), (1, 1), (4, 4), (3, 1), (5, 3), (2, 4)])
def test_equations_050_to_055_slopes_of_points_of_any_order(n, m):
    robot, q = tree(), np.random.default_rng(3).uniform(-1, 1, (6, 3))
    right = slope_in_digits(robot, q, "link_2", n, m)
    found = jn.robot.point_slope(robot, q, "link_2", POINT, n=n, m=m)
    np.testing.assert_allclose(found, right, rtol=0, atol=1e-13 * max(1.0, np.abs(right).max()))
    if n == m:  # 50; and 55, the velocity
        np.testing.assert_array_equal(found, jn.robot.point_slope(robot, q, "link_2", POINT))
        velocity = jn.forward_kinematics(robot, q, "link_2", POINT).position[1]
        np.testing.assert_allclose(found @ q[1], velocity, rtol=0, atol=1e-14)
    if n > m:  # 52 and 54
        rate = jn.jacobian(robot, q, "link_2", POINT)[n - m, :3]
        np.testing.assert_allclose(found, math.comb(n, m) * rate, rtol=0, atol=1e-13 * np.abs(right).max())


def test_slopes_of_points_are_refused_by_their_orders():
    robot = tree()
    with pytest.raises(jn.errors.RobotError, match="needs derivatives of q to order 3"):
        jn.robot.point_slope(robot, np.zeros((1, 3, 3)), "link_2", n=4)
    with pytest.raises(jn.errors.RobotError, match=r"m.*must be a whole number, 0 or greater"):
        jn.robot.point_slope(robot, np.zeros((2, 3)), "link_2", m=-1)
