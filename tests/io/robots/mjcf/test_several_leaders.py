"""Joints that follow several others, by equalities of tendons: against MuJoCo, projected onto the constraint."""

import dataclasses

import mujoco
import numpy as np
import pytest

import jounce as jn
from jounce.errors import RobotFileError
from jounce.io.robots.loader import load_robot

LEG = """
<mujoco><compiler angle="radian"/><option integrator="implicit"/><worldbody>
  <body name="hip" pos="0 0 1"><joint name="yaw" damping="2"/>
    <joint name="pitch" axis="0 1 0" ref="0.2" armature="0.3"/>
    <geom type="capsule" size="0.05" fromto="0 0 0 0.3 0 0.1"/>
    <body pos="0.3 0 0.1"><joint name="knee" axis="0 1 0" ref="-0.3" damping="0.4"/>
      <geom type="capsule" size="0.05" fromto="0 0 0 0.25 0 -0.25"/>
      <body pos="0.25 0 -0.25">
        <joint name="ankle" axis="0.1 1 0" ref="0.1" armature="0.2" damping="0.7" stiffness="5" springref="0.4"
               frictionloss="0.6"/>
        <geom type="capsule" size="0.04" fromto="0 0 0 0 0.1 -0.25"/>
        <body pos="0 0 -0.25"><joint name="toe" type="slide" axis="1 0 0.2"/><geom size="0.04"/></body>
      </body>
    </body>
  </body></worldbody>
  <tendon>
    <fixed name="leg"><joint joint="pitch" coef="0.5"/><joint joint="ankle" coef="0.25"/><joint joint="knee" coef="-1"/>
    </fixed>
    <fixed name="foot"><joint joint="toe" coef="3"/><joint joint="ankle" coef="-0.3"/></fixed>
    <fixed name="line" stiffness="7" springlength="0.1" damping="0.5"><joint joint="ankle" coef="0.6"/>
      <joint joint="yaw" coef="-0.2"/></fixed>
  </tendon>
  <equality><tendon tendon1="foot" polycoef="0.1 0 0 0 0"/><tendon tendon1="leg" polycoef="0.05 0 0 0 0"/></equality>
  <actuator><motor joint="yaw"/><motor joint="pitch"/><motor joint="knee"/></actuator>
</mujoco>
"""
LAST = LEG.partition("</equality>")[0].count("\n") + 1
ORDER = ("yaw", "pitch", "knee", "ankle", "toe")


@pytest.fixture
def leg(tmp_path):
    path = tmp_path / "leg.xml"
    path.write_text(LEG)
    return path


def spread(robot, names):
    """Return how all joints follow the coordinates of a robot: a matrix and an offset."""
    matrix, offset = np.zeros((len(names), len(robot.joint_names))), np.zeros(len(names))
    for row, name in enumerate(names):
        mimic = robot.joints[name].mimic or jn.robot.Mimic(name)
        offset[row] = mimic.offset
        for leader, weight in mimic.weights.items():
            matrix[row, robot.joint_names.index(leader)] = weight
    return matrix, offset


def test_the_equalities_hold_where_the_robot_has_its_joints(leg):
    robot, model = load_robot(leg), mujoco.MjModel.from_xml_path(str(leg))
    assert robot.joint_names == ("yaw", "pitch", "knee")  # what has no actuator follows
    matrix, offset = spread(robot, ORDER)
    data = mujoco.MjData(model)
    for q in np.random.default_rng(0).normal(size=(5, 3)):
        data.qpos[:] = matrix @ q + offset
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.efc_pos[: data.ne], 0.0, rtol=0, atol=1e-15)


@pytest.mark.parametrize("followers", [True, False])
def test_torques_are_those_of_mujoco_along_the_constraint(leg, followers):
    """What MuJoCo needs for a motion of all joints, without its constraints, does the work of our torques."""
    robot, model = load_robot(leg), mujoco.MjModel.from_xml_path(str(leg))
    assert robot.tree.shape.direct is False
    robot = robot if followers else robot.changed(joints=[dataclasses.replace(x, mimic=None) for x in free(robot)])
    matrix, offset = spread(robot, ORDER)
    q = np.random.default_rng(1).normal(size=(6, 3, len(robot.joint_names)))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    ours = np.asarray(jn.inverse_dynamics(robot, q))[:, 0]
    mass, bias = np.asarray(jn.mass_matrix(robot, q[:, 0])), np.asarray(jn.bias_forces(robot, q[:, :2]))
    np.testing.assert_allclose(np.einsum("sij,sj->si", mass, q[:, 2]) + bias, ours, rtol=0, atol=1e-13)
    moved = np.asarray(jn.forward_dynamics(robot, q[:, :2], ours[:, None]))[:, 2]
    np.testing.assert_allclose(moved, q[:, 2], rtol=0, atol=1e-11)
    for sample, torque in zip(q, ours, strict=True):
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.qacc[:] = matrix @ sample[0] + offset, matrix @ sample[1], matrix @ sample[2]
        mujoco.mj_inverse(model, data)
        friction = model.dof_frictionloss * np.sign(data.qvel)  # a constraint of MuJoCo
        np.testing.assert_allclose(torque, matrix.T @ (data.qfrc_inverse + friction), rtol=0, atol=1e-13)


def free(robot):
    return robot.joints.values()


def test_rates_of_torques_are_derivatives(leg):
    robot = load_robot(leg)
    x = np.random.default_rng(2).normal(size=(6, 3))
    step = 1e-3

    def at(t):
        powers = [
            [np.prod(range(k - d + 1, k + 1)) * t ** (k - d) if k >= d else 0.0 for k in range(6)] for d in range(4)
        ]
        return np.array(powers) @ x

    here = np.asarray(jn.inverse_dynamics(robot, at(0.3)[None]))[0]
    ends = [np.asarray(jn.inverse_dynamics(robot, at(0.3 + k * step)[None]))[0, 0] for k in (-2, -1, 1, 2)]
    slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)
    np.testing.assert_allclose(here[1], slope, rtol=1e-7)


@pytest.mark.parametrize(
    "equalities, held",
    [
        ('<tendon tendon1="two"/><tendon tendon1="three"/>', {"c": (["a"], [-0.5]), "b": (["a"], [-0.5])}),
        ('<tendon tendon1="three"/><tendon tendon1="two"/>', {"c": (["a"], [-0.5]), "b": (["a"], [-0.5])}),
        (
            '<tendon tendon1="three"/><tendon tendon1="two" tendon2="three"/>',
            {"c": (["b"], [1.0]), "a": (["b"], [-2.0])},
        ),
        ('<tendon tendon1="three" tendon2="other" polycoef="0 2 0 0 0"/>', {"d": (["a", "b", "c"], [0.5, 0.5, 0.5])}),
    ],
)
def test_equations_of_several_tendons_are_solved_together(tmp_path, equalities, held):
    """``a + b + c = 0`` and ``b - c = 0`` in any order, also where one joint is in both; one more than none follows."""
    joints = "".join(f'<body><joint name="{x}" axis="0 1 0"/><geom size="0.1" pos="0.1 0 0"/></body>' for x in "abcd")
    lines = {"two": {"b": 1, "c": -1}, "three": {"a": 1, "b": 1, "c": 1}, "other": {"d": 1}}
    tendons = "".join(
        f'<fixed name="{name}">' + "".join(f'<joint joint="{x}" coef="{w}"/>' for x, w in own.items()) + "</fixed>"
        for name, own in lines.items()
    )
    path = tmp_path / "several.xml"
    path.write_text(
        f"<mujoco><worldbody>{joints}</worldbody><tendon>{tendons}</tendon><equality>{equalities}</equality></mujoco>"
    )
    robot = load_robot(path)
    found = {x.name: (list(x.mimic.weights), list(x.mimic.weights.values())) for x in robot.moving_joints if x.mimic}
    assert found == held


def test_equalities_that_repeat_others_are_none_and_those_that_contradict_them_are_refused(leg):
    again = '<tendon tendon1="leg" polycoef="{} 0 0 0 0"/></equality>'
    leg.write_text(LEG.replace("</equality>", again.format("0.05")))
    assert load_robot(leg).joint_names == ("yaw", "pitch", "knee")
    leg.write_text(LEG.replace("</equality>", again.format("0.06")))
    with pytest.raises(RobotFileError, match=rf"line {LAST}, equality: contradicts the equalities before it, by 0\.01"):
        load_robot(leg)


def test_a_tendon_that_follows_another_by_a_curve_is_refused(leg):
    curved = '<tendon tendon1="leg" tendon2="line" polycoef="0 1 0.2 0 0"/></equality>'
    leg.write_text(LEG.replace("</equality>", curved))
    with pytest.raises(RobotFileError, match=rf"line {LAST}, equality: a tendon can follow another linearly only"):
        load_robot(leg)
