"""Robots of the example files against Pinocchio and MuJoCo: torques and their rates, reactions, frames, Jacobians."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest
from mpmath import mp

import jounce as jn
from jounce.io.robots.loader import load_robot
from tests.oracles.mp_robot import State, cut, from_numbers, motion, rates, times, transposed

ROBOTS = Path(__file__).parents[2] / "examples" / "robots"
NAMES = ("panda", "ur5", "solo12")
WORLD = pinocchio.LOCAL_WORLD_ALIGNED
SAMPLES = 5


class Case:
    """A robot twice, with random states; columns of `spread` take our coordinates to those of Pinocchio."""

    def __init__(self, name, offset=0.0):
        self.robot = load_robot(ROBOTS / f"{name}.urdf")
        self.model = pinocchio.buildModelFromUrdf(str(ROBOTS / f"{name}.urdf"))
        self.data = self.model.createData()
        joints = self.robot.joint_names
        self.spread = np.zeros((self.model.nv, len(joints)))
        for row, joint in enumerate(list(self.model.names)[1:]):
            mimic = self.robot.joints[joint].mimic
            leader, factor = (joint, 1.0) if mimic is None else (mimic.joint, mimic.multiplier)
            self.spread[row, joints.index(leader)] = factor
        self.q = np.random.default_rng(len(joints)).uniform(-1, 1, (SAMPLES, 4, len(joints)))
        self.theirs = self.q @ self.spread.T

    def gathered(self, function):
        """Return what a function gives for the derivatives of each sample."""
        return np.array([np.array(function(*sample)) for sample in self.theirs])  # copies: Pinocchio reuses its arrays


@pytest.fixture(scope="module", params=[NAMES[0], *(pytest.param(name, marks=pytest.mark.slow) for name in NAMES[1:])])
def case(request):
    return Case(request.param)


def error(found, expected):
    """Return the largest error, by the peak."""
    assert found.shape == np.shape(expected)
    return np.abs(found - expected).max() / np.abs(expected).max()


def torque_rate(model, data, q, v, a, j):
    """Return the exact first rate of torque from Pinocchio's derivatives."""
    pinocchio.computeRNEADerivatives(model, data, q, v, a)
    mass = np.triu(data.M) + np.triu(data.M, 1).T
    return data.dtau_dq @ v + data.dtau_dv @ a + mass @ j


def test_torque_and_its_rate(case):
    model, data = case.model, case.data
    torque = jn.inverse_dynamics(case.robot, case.q, drives=False)
    expected = case.gathered(lambda q, v, a, j: pinocchio.rnea(model, data, q, v, a)) @ case.spread
    assert error(torque[:, 0], expected) <= 1e-13
    expected = case.gathered(lambda *sample: torque_rate(model, data, *sample)) @ case.spread
    assert error(torque[:, 1], expected) <= 1e-13


@pytest.mark.slow
def test_gravity_and_its_rate(case):
    model, data = case.model, case.data
    weight = jn.dynamics.gravity_forces(case.robot, case.q, rates=1)
    expected = case.gathered(lambda q, *_: pinocchio.computeGeneralizedGravity(model, data, q)) @ case.spread
    assert error(weight[:, 0], expected) <= 1e-13
    slopes = case.gathered(lambda q, v, *_: pinocchio.computeGeneralizedGravityDerivatives(model, data, q) @ v)
    assert error(weight[:, 1], slopes @ case.spread) <= 1e-13


def test_reactions(case):
    links = [case.robot.joints[joint].child for joint in list(case.model.names)[1:]]
    wrench = jn.robot.joint_wrenches(case.robot, case.q)[:, 0, [case.robot.moving_links.index(link) for link in links]]

    def reactions(q, v, a, j):
        pinocchio.rnea(case.model, case.data, q, v, a)
        return [case.data.f[k + 1].vector for k in range(len(links))]

    assert error(wrench, case.gathered(reactions)) <= 1e-13


@pytest.mark.slow
def test_frames_of_all_links(case):
    model, data = case.model, case.data
    links = [link for link in case.robot.link_names if model.existFrame(link)]
    assert len(links) == len(case.robot.link_names)

    def frames(q, v, a, j):
        pinocchio.forwardKinematics(model, data, q, v, a)
        pinocchio.updateFramePlacements(model, data)
        found = []
        for frame in map(model.getFrameId, links):
            speed = pinocchio.getFrameVelocity(model, data, frame, WORLD)
            rate = pinocchio.getFrameClassicalAcceleration(model, data, frame, WORLD)
            pose = data.oMf[frame]
            rows = pose.translation, speed.linear, rate.linear, speed.angular, rate.angular, *pose.rotation
            found.append(np.stack(rows))
        return found

    expected = case.gathered(frames)
    for k, link in enumerate(links):
        motion = jn.forward_kinematics(case.robot, case.q[:, :3], link)
        rows = np.concatenate([motion.position, motion.angular_velocity, motion.rotation[:, 0]], axis=1)
        assert np.abs(rows - expected[:, k]).max() <= 1e-13 * max(1.0, np.abs(expected[:, k]).max())


@pytest.mark.slow
def test_center_of_mass(case):
    base = case.model.inertias[0]  # Pinocchio leaves the fixed base out of the center of mass

    def center(q, v, a, j):
        pinocchio.centerOfMass(case.model, case.data, q, v, a)
        moments = np.array([case.data.com[0], case.data.vcom[0], case.data.acom[0]]) * case.data.mass[0]
        moments[0] += base.mass * base.lever
        return moments / (case.data.mass[0] + base.mass)

    assert error(jn.robot.center_of_mass(case.robot, case.q[:, :3]), case.gathered(center)) <= 1e-13


def test_jacobian_and_its_rate(case):
    model, data = case.model, case.data
    last = [link for link in case.robot.link_names if case.robot.frames[link].body >= 0][-1]
    frame = model.getFrameId(last)

    def jacobians(q, v, a, j):
        pinocchio.computeJointJacobiansTimeVariation(model, data, q, v)
        pinocchio.updateFramePlacements(model, data)
        slope = pinocchio.getFrameJacobianTimeVariation(model, data, frame, WORLD)
        return [pinocchio.getFrameJacobian(model, data, frame, WORLD) @ case.spread, slope @ case.spread]

    assert error(jn.jacobian(case.robot, case.q[:, :2], last), case.gathered(jacobians)) <= 1e-13


def body_twist(sample):
    """Return velocity of the base and two rates, as components in its own frame, from slides and turns z, y, x."""
    kinds = [("prismatic", k) for k in range(3)] + [("revolute", k) for k in (2, 1, 0)]
    bodies = [{"parent": k - 1, "type": kind, "axis": np.eye(3)[axis]} for k, (kind, axis) in enumerate(kinds)]
    with mp.workdps(30):
        state = State(from_numbers(bodies), [motion(column) for column in sample[:, :6].T])
        back = transposed([cut(row, 3) for row in state.attitude[5]])
        series = [*times(back, rates(state.origin[5])), *times(back, state.angular_velocity(5))]
        place = [float(x.c[0]) for x in state.origin[5]]
        attitude = np.array([[float(x.c[0]) for x in row] for row in state.attitude[5]])
        return place, attitude, np.array([[float(d) for d in x.derivatives()] for x in series]).T


@pytest.mark.slow
def test_floating_base():
    robot = load_robot(ROBOTS / "solo12.urdf", floating_base=True)
    model = pinocchio.buildModelFromUrdf(str(ROBOTS / "solo12.urdf"), pinocchio.JointModelFreeFlyer())
    data = model.createData()
    q = np.random.default_rng(18).uniform(-1, 1, (SAMPLES, 4, 18))
    order = [robot.joint_names.index(joint) for joint in list(model.names)[2:]]
    expected = []
    for sample in q:
        place, attitude, twist = body_twist(sample)
        joints = sample[:, order]
        start = np.concatenate([place, pinocchio.Quaternion(attitude).coeffs(), joints[0]])
        v, a, j = np.concatenate([twist, joints[1:]], axis=1)
        expected.append([pinocchio.rnea(model, data, start, v, a), torque_rate(model, data, start, v, a, j)])
    expected = np.array(expected)
    torque = jn.inverse_dynamics(robot, q, drives=False)[:, :, order]
    base = jn.robot.joint_wrenches(robot, q)[:, :, robot.moving_links.index("base_link")]
    for level in range(2):
        assert error(torque[:, level], expected[:, level, 6:]) <= 1e-13
        assert error(base[:, level], expected[:, level, :6]) <= 1e-13


def test_drives_against_mujoco():
    robot = load_robot(ROBOTS / "planar_arm.xml")
    model = mujoco.MjModel.from_xml_path(str(ROBOTS / "planar_arm.xml"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # its dry friction is soft, and limits push back
    data = mujoco.MjData(model)
    assert robot.joint_names == tuple(model.joint(k).name for k in range(model.njnt))
    q = np.random.default_rng(3).uniform(-1, 1, (SAMPLES, 3, model.nv))
    expected = []
    for sample in q:
        data.qpos, data.qvel, data.qacc = sample
        mujoco.mj_inverse(model, data)
        expected.append(data.qfrc_inverse + model.dof_frictionloss * np.sign(sample[1]))
    assert model.dof_armature.all()
    assert model.dof_damping.all()
    assert error(jn.inverse_dynamics(robot, q, drives=True)[:, 0], np.array(expected)) <= 1e-13
