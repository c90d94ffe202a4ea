"""Robots from tables against products of 4x4 matrices, and against each other."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

import jounce as jn
from jounce.robot import DenavitHartenberg, JointAxis, from_denavit_hartenberg, from_screws

A, ALPHA, D, THETA = np.random.default_rng(6).uniform(-0.8, 0.8, (4, 4))
TYPES = ("revolute", "revolute", "prismatic", "revolute")
BODY = jn.Inertia(1.3, [0.1, -0.2, 0.15], [[0.05, 0.002, 0.0], [0.002, 0.04, 0.003], [0.0, 0.003, 0.03]])
POSITIONS = np.array([0.4, -0.7, 0.3, 1.1])


def turn(axis, angle):
    """Return a rotation about x or z, (4, 4)."""
    c, s, matrix = math.cos(angle), math.sin(angle), np.eye(4)
    i, j = {"x": (1, 2), "z": (0, 1)}[axis]
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def slide(axis, amount):
    matrix = np.eye(4)
    matrix["xyz".index(axis), 3] = amount
    return matrix


def steps(k, q, convention):
    """Return the transform of row k by the book."""
    theta, d = (THETA[k] + q, D[k]) if TYPES[k] != "prismatic" else (THETA[k], D[k] + q)
    if convention == "standard":
        return turn("z", theta) @ slide("z", d) @ slide("x", A[k]) @ turn("x", ALPHA[k])
    return turn("x", ALPHA[k]) @ slide("x", A[k]) @ turn("z", theta) @ slide("z", d)


def table(inertias=(BODY,) * 4):
    return [DenavitHartenberg(A[k], ALPHA[k], D[k], THETA[k], TYPES[k], inertia) for k, inertia in enumerate(inertias)]


def pose(robot, q, link):
    motion = jn.forward_kinematics(robot, [q], link)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = motion.rotation[0], motion.position[0]
    return matrix


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_tables_are_products_of_transforms(convention):
    robot = from_denavit_hartenberg(table(), convention)
    assert robot.joint_names == ("joint_1", "joint_2", "joint_3", "joint_4")
    expected = np.eye(4)
    for k in range(4):
        expected = expected @ steps(k, POSITIONS[k], convention)
        np.testing.assert_allclose(pose(robot, POSITIONS, f"link_{k + 1}"), expected, rtol=0, atol=1e-15)


def three_arms():
    """Return one arm, built from a standard table, a modified one and screws.

    Modified row k has a and alpha of the standard row before; the last a and alpha of the standard table are a tool.
    """
    standard = from_denavit_hartenberg(table())
    rows, screws, reach = [], [], np.eye(4)
    for k in range(4):
        back = slide("x", A[k]) @ turn("x", ALPHA[k])  # the standard frame of a link in its modified one
        before = (A[k - 1], ALPHA[k - 1]) if k else (0.0, 0.0)
        inertia = BODY.moved(back[:3, 3], back[:3, :3])
        rows.append(DenavitHartenberg(*before, D[k], THETA[k], TYPES[k], inertia))
        axis, point = reach[:3, 2], reach[:3, 3]
        reach = reach @ steps(k, 0.0, "standard")
        screws.append(JointAxis(axis, point, TYPES[k], BODY.moved(reach[:3, 3], reach[:3, :3])))
    return standard, from_denavit_hartenberg(rows, "modified"), from_screws(screws, tool=reach)


def test_three_constructions_of_one_arm_agree():
    standard, modified, screws = three_arms()
    q = np.random.default_rng(1).uniform(-1, 1, (3, 5, 4))
    torque = jn.inverse_dynamics(standard, q)
    for other in (modified, screws):
        np.testing.assert_allclose(jn.inverse_dynamics(other, q), torque, rtol=0, atol=3e-14 * np.abs(torque).max())
    tool = jn.jacobian(standard, q[:, :2], "link_4")
    np.testing.assert_allclose(jn.jacobian(screws, q[:, :2], "tool"), tool, rtol=0, atol=1e-14)
    end = (slide("x", A[3]) @ turn("x", ALPHA[3]))[:3, 3]
    np.testing.assert_allclose(jn.jacobian(modified, q[:, :2], "link_4", end), tool, rtol=0, atol=1e-14)


def test_screws_are_a_product_of_exponentials():
    *_, robot = three_arms()
    standard = np.eye(4)
    for k in range(4):
        standard = standard @ steps(k, 0.0, "standard")
    expected, reach = np.eye(4), np.eye(4)
    for k in range(4):
        axis, point, twist = reach[:3, 2], reach[:3, 3], np.zeros((4, 4))
        if TYPES[k] == "prismatic":
            twist[:3, 3] = axis
        else:
            twist[:3, :3] = np.cross(np.eye(3), axis)
            twist[:3, 3] = -np.cross(axis, point)
        reach = reach @ steps(k, 0.0, "standard")
        expected = expected @ expm(twist * POSITIONS[k])
        np.testing.assert_allclose(pose(robot, POSITIONS, f"link_{k + 1}"), expected, rtol=0, atol=2e-15)
    np.testing.assert_allclose(pose(robot, POSITIONS, "tool"), expected @ standard, rtol=0, atol=2e-15)


def test_limits_are_kept():
    limits = jn.Limits(velocity=2.0)
    row, screw = DenavitHartenberg(inertia=BODY, limits=limits), JointAxis([0, 0, 1], inertia=BODY, limits=limits)
    assert from_denavit_hartenberg([row]).limits == {"joint_1": limits}
    assert from_screws([screw]).limits == {"joint_1": limits}


SKEWED = np.diag([1.0, 1.0, 1.0, 2.0])


@pytest.mark.parametrize(
    "make, message",
    [
        (
            lambda: from_denavit_hartenberg(table(), "classic"),
            "convention: unknown convention, got 'classic'; valid: modified, standard",
        ),
        (lambda: from_denavit_hartenberg([DenavitHartenberg(a=math.nan)]), "row 1.a: must be finite, got nan"),
        (
            lambda: from_denavit_hartenberg([DenavitHartenberg(type="hinge", inertia=BODY)]),
            "joints.joint_1.type: no joint has this type, got 'hinge'; valid: continuous, fixed, prismatic, revolute",
        ),
        (
            lambda: from_denavit_hartenberg([DenavitHartenberg(a=1.0)]),
            "links.axis_1.inertia: this joint moves no mass, got nothing; give its link, or one that it carries, an "
            "inertia, or keep it with strict=False, where its torque is zero",
        ),
        (
            lambda: from_screws([JointAxis([0, 0, 0], inertia=BODY)]),
            "joints.joint_1.axis: must have a direction, got [0.0, 0.0, 0.0]",
        ),
        (
            lambda: from_screws([JointAxis([0, 0, 1], [0, 1], inertia=BODY)]),
            "screw 1.point: must have the shape (3,), not (2,)",
        ),
        (lambda: from_screws([], tool=np.eye(3)), "tool: must have the shape (4, 4), not (3, 3)"),
        (lambda: from_screws([], tool=SKEWED), "tool: must have the last row 0, 0, 0, 1, got [0.0, 0.0, 0.0, 2.0]"),
    ],
)
def test_refused(make, message):
    with pytest.raises(jn.errors.RobotError) as caught:
        make()
    assert str(caught.value) == message
