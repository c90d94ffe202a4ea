"""Springs, tendons, balls and compensated gravity of MJCF files: torques are those of MuJoCo's inverse dynamics."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn

GEOM = '<inertial pos="0.1 0.02 0" mass="1.3" diaginertia="0.02 0.03 0.04"/>'
ARM = f"""<mujoco><option gravity="0.3 -1 -9.7"/><worldbody>
<body name="a" pos="0.1 0 0.2">
<joint name="h" axis="0 1 0.2" stiffness="5" springref="20" ref="5" damping="0.3" armature="0.02"/>
{GEOM}
<body name="b" pos="0.3 0 0" euler="10 20 30" gravcomp="0.4">
<joint name="s" type="slide" axis="1 0 0" stiffness="40"/>{GEOM}
<body name="c" pos="0.1 0 0" gravcomp="1"><joint name="k" axis="0 0 1" damping="0.1"/>{GEOM}</body></body></body>
</worldbody>
<tendon><fixed name="line" stiffness="30" damping="0.7" springlength="0.2" armature="0.6">
<joint joint="h" coef="0.4"/><joint joint="s" coef="-1.5"/><joint joint="k" coef="0.2"/></fixed>
<fixed stiffness="3"><joint joint="h" coef="1"/><joint joint="k" coef="1"/></fixed></tendon></mujoco>"""
BALL = f"""<mujoco><worldbody>
<body name="a"><joint name="h" axis="0 1 0" damping="0.1"/>{GEOM}
<body name="b" pos="0.3 0 0" euler="10 20 30">
<joint name="ball" type="ball" pos="0.1 0 0.05" damping="0.4" armature="{{armature}}"/>{GEOM}</body></body>
</worldbody></mujoco>"""
FREE = f"""<mujoco><worldbody><body name="cube" pos="1 1 1" euler="10 20 30">
<joint name="object" type="free" damping="0.3" armature="0.07"/>{GEOM}</body></worldbody></mujoco>"""


def both(tmp_path, text):
    """Return the robot of a text, and MuJoCo's model of it."""
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return jn.load_robot(path, strict=True), mujoco.MjModel.from_xml_string(text)


def inverse(model, position, rates, accelerations):
    """Return the generalized forces of MuJoCo for a state."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = position, rates, accelerations
    mujoco.mj_inverse(model, data)
    return data.qfrc_inverse.copy()


def spin(turns, rates, accelerations):
    """Return angular velocity and acceleration of turns z, y, x in the moved axes, and how the rates make them."""
    (_, y, x), (_, dy, dx) = turns, rates
    slope = np.array(
        [
            [-np.sin(y), 0, 1],
            [np.cos(y) * np.sin(x), np.cos(x), 0],
            [np.cos(y) * np.cos(x), -np.sin(x), 0],
        ]
    )
    change = np.array(
        [
            [-np.cos(y) * dy, 0, 0],
            [-np.sin(y) * np.sin(x) * dy + np.cos(y) * np.cos(x) * dx, -np.sin(x) * dx, 0],
            [-np.sin(y) * np.cos(x) * dy - np.cos(y) * np.sin(x) * dx, -np.cos(x) * dx, 0],
        ]
    )
    return slope @ rates, slope @ accelerations + change @ rates, slope


def test_springs_tendons_and_compensated_gravity(tmp_path):
    robot, model = both(tmp_path, ARM)
    q = np.random.default_rng(1).normal(size=(3, 3))
    assert robot.joint_names == ("h", "s", "k")
    expected = inverse(model, *q)
    np.testing.assert_allclose(jn.inverse_dynamics(robot, q)[0], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("armature", [0.0, 0.05])
def test_a_ball_with_damping_and_armature(tmp_path, armature):
    robot, model = both(tmp_path, BALL.format(armature=armature))
    assert robot.couplings["ball"].damping == 0.4
    q = np.random.default_rng(2).normal(size=(3, 4)) * 0.7
    w, dw, slope = spin(*q[:, 1:])
    quaternion = np.roll(Rotation.from_euler("ZYX", q[0, 1:]).as_quat(), 1)
    expected = inverse(model, [q[0, 0], *quaternion], [q[1, 0], *w], [q[2, 0], *dw])
    expected[1:] = slope.T @ expected[1:]
    np.testing.assert_allclose(jn.inverse_dynamics(robot, q)[0], expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    state = jn.forward_dynamics(robot, q[:2], jn.inverse_dynamics(robot, q))
    np.testing.assert_allclose(state, q, rtol=0, atol=1e-12)


def test_a_free_body_with_damping_and_armature(tmp_path):
    robot, model = both(tmp_path, FREE)
    q = np.random.default_rng(3).normal(size=(3, 6)) * 0.7
    w, dw, slope = spin(*q[:, 3:])
    quaternion = np.roll(Rotation.from_euler("ZYX", q[0, 3:]).as_quat(), 1)
    expected = inverse(model, [*q[0, :3], *quaternion], [*q[1, :3], *w], [*q[2, :3], *dw])
    expected[3:] = slope.T @ expected[3:]
    np.testing.assert_allclose(jn.inverse_dynamics(robot, q)[0], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_what_of_a_tendon_is_not_linear_is_reported(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(ARM.replace('springlength="0.2"', 'springlength="0.1 0.3"'))
    with pytest.warns(jn.errors.RobotWarning, match=r"of tendons: line \(line 9\)"):
        jn.load_robot(path)


def test_the_armature_of_a_tendon_couples_branches(tmp_path):
    """Two carts of 1 kg, a length of x - 2 y: the kinetic energy is that of the carts and 3 (x' - 2 y')^2 / 2."""
    cart = (
        '<body><joint name="{}" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    )
    line = '<fixed armature="3"><joint joint="x" coef="1"/><joint joint="y" coef="-2"/></fixed>'
    path = tmp_path / "robot.xml"
    path.write_text(
        f"<mujoco><worldbody>{cart.format('x')}{cart.format('y')}</worldbody><tendon>{line}</tendon></mujoco>"
    )
    matrix = jn.mass_matrix(jn.load_robot(path, strict=True), [0.0, 0.0])
    np.testing.assert_allclose(matrix, [[4, -6], [-6, 13]], rtol=0, atol=1e-14)
