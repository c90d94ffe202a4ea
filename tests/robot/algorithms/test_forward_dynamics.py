"""Motion from torques: against Pinocchio and MuJoCo, and order by order against the inverse, which mpmath judges."""

from pathlib import Path

import jax
import mujoco
import numpy as np
import pinocchio
import pytest

import jounce as jn
from jounce.io.robots.loader import load_robot
from tests.problems.robots import random_inertia, random_robot, robot_named

ROBOTS = Path(__file__).parents[3] / "examples" / "robots"
HIGHEST = 6  # order of the rates of torque
SAMPLES = 4


def error(found, expected):
    """Return the largest error, by the peak."""
    assert found.shape == np.shape(expected)
    return np.abs(found - expected).max() / np.abs(expected).max()


def motion(robot, levels, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (SAMPLES, levels, len(robot.joint_names)))


def returned(robot, q, levels, **settings):
    """Return torques of a motion, and those of what forward dynamics makes of them."""
    torque = jn.inverse_dynamics(robot, q[:, : levels + 2], **settings)
    found = jn.forward_dynamics(robot, q[:, :2], torque, **settings)
    return torque, jn.inverse_dynamics(robot, found, **settings), found


def with_massive_base(robot):
    links = [
        link if link.name != robot.base else jn.Link(link.name, random_inertia(np.random.default_rng(5)))
        for link in robot.links.values()
    ]
    return jn.Robot(robot.name, links, list(robot.joints.values()))


def free_motion(levels, seed=1):
    generator = np.random.default_rng(seed)
    quaternion = generator.normal(size=(SAMPLES, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1)[:, None]
    return jn.robot.BaseMotion(
        generator.uniform(-1, 1, (SAMPLES, 3)), quaternion, generator.uniform(-1, 1, (SAMPLES, levels, 6))
    )


@pytest.mark.parametrize("name", ["ur5", pytest.param("solo12", marks=pytest.mark.slow)])
def test_accelerations_of_files_against_pinocchio(name):
    robot = load_robot(ROBOTS / f"{name}.urdf")
    model = pinocchio.buildModelFromUrdf(str(ROBOTS / f"{name}.urdf"))
    data = model.createData()
    order = [robot.joint_names.index(joint) for joint in list(model.names)[1:]]
    state, torque = motion(robot, 3)[:, :2], motion(robot, 1, 3)
    expected = [
        np.array(pinocchio.aba(model, data, q, v, t))
        for (q, v), (t,) in zip(state[..., order], torque[..., order], strict=True)
    ]
    assert error(jn.forward_dynamics(robot, state, torque, drives=False)[:, 2, order], np.array(expected)) <= 1e-13


def test_drives_against_mujoco():
    robot = load_robot(ROBOTS / "planar_arm.xml")
    model = mujoco.MjModel.from_xml_path(str(ROBOTS / "planar_arm.xml"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # its dry friction is soft, and limits push back
    data = mujoco.MjData(model)
    state, torque = motion(robot, 2), motion(robot, 1, 3)
    expected = []
    for (q, v), (t,) in zip(state, torque, strict=True):
        data.qpos, data.qvel = q, v
        data.qfrc_applied = t - model.dof_frictionloss * np.sign(v)
        mujoco.mj_forward(model, data)
        expected.append(np.array(data.qacc))
    assert error(jn.forward_dynamics(robot, state, torque, drives=True)[:, 2], np.array(expected)) <= 1e-13


@pytest.mark.slow
def test_free_base_against_pinocchio():
    robot = load_robot(ROBOTS / "solo12.urdf")
    model = pinocchio.buildModelFromUrdf(str(ROBOTS / "solo12.urdf"), pinocchio.JointModelFreeFlyer())
    data = model.createData()
    order = [robot.joint_names.index(joint) for joint in list(model.names)[2:]]
    base, state, torque = free_motion(1), motion(robot, 2), motion(robot, 1, 3)
    at_base = np.random.default_rng(4).uniform(-1, 1, (SAMPLES, 1, 6))
    moved, q = jn.forward_dynamics(robot, state, np.concatenate([at_base, torque], axis=-1), base=base)
    expected = []
    for k in range(SAMPLES):
        place = np.concatenate([base.position[k], np.roll(base.quaternion[k], -1), state[k, 0, order]])
        forces = np.concatenate([at_base[k, 0], torque[k, 0, order]])
        expected.append(
            np.array(pinocchio.aba(model, data, place, np.append(base.twist[k, 0], state[k, 1, order]), forces))
        )
    assert error(np.concatenate([moved.twist[:, 1], q[:, 2, order]], axis=1), np.array(expected)) <= 1e-12


CASES = {
    "sliding and branched": {"seed": 2, "joints": 9, "prismatic": 0.4},
    "following": {"seed": 4, "joints": 7, "mimic": 0.3},
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_inverse_after_forward_returns_torques_and_six_rates(case):
    robot = random_robot(**CASES[case])
    torque, again, found = returned(robot, motion(robot, HIGHEST + 3), HIGHEST + 1)
    assert found.shape[1] == HIGHEST + 3
    for level in range(HIGHEST + 1):
        assert error(again[:, level], torque[:, level]) <= 1e-12


@pytest.mark.slow
def test_hybrid_with_wrenches_and_drives():
    robot = random_robot(2, 5, prismatic=0.4)
    q, generator = motion(robot, 4), np.random.default_rng(3)
    wrenches = [
        jn.robot.Wrench(robot.moving_links[1], generator.uniform(-1, 1, (SAMPLES, 2, 3)), point=[0.1, 0.2, 0.3]),
        jn.robot.Wrench(robot.moving_links[-1], torque=[0.3, 0.1, 0.2], point=[0.1, 0, 0], frame="link"),
    ]
    torque = jn.inverse_dynamics(robot, q, wrenches=wrenches, drives=True)
    for driven in ([], [1, 3], [0, 1, 2, 3, 4]):
        mixed = torque.copy()
        mixed[:, :, driven] = q[:, 2:, driven]
        names = [robot.joint_names[k] for k in driven]
        found = jn.forward_dynamics(robot, q[:, :2], mixed, driven=names, wrenches=wrenches, drives=True)
        assert error(found, q) <= 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("seed, follow", [(4, False), (8, True)])
def test_free_base_order_by_order(seed, follow):
    robot = with_massive_base(random_robot(seed, 4, mimic=0.6 if follow else 0.0))
    assert robot.tree.shape.direct != follow
    levels = 2 if follow else 4  # of torques and their rates
    q, whole = motion(robot, levels + 2), free_motion(levels + 1)
    wrenches = [
        jn.robot.Wrench(robot.base, [1.0, 2.0, 3.0], point=[0.1, 0.2, 0.3]),
        jn.robot.Wrench(robot.moving_links[-1], [1, 0, 0]),
    ]
    forces = jn.inverse_dynamics(robot, q, base=whole, wrenches=wrenches)
    assert forces.shape == (SAMPLES, levels, 6 + len(robot.joint_names))
    start = jn.robot.BaseMotion(whole.position, whole.quaternion, whole.twist[:, :1])
    moved, found = jn.forward_dynamics(robot, q[:, :2], forces, base=start, wrenches=wrenches)
    again = jn.inverse_dynamics(robot, found, base=moved, wrenches=wrenches)
    for level in range(levels):
        assert error(again[:, level], forces[:, level]) <= 1e-12


@pytest.mark.slow
def test_free_base_is_that_of_slides_and_turns():
    levels = 3
    robot = load_robot(ROBOTS / "solo12.urdf")
    chain = load_robot(ROBOTS / "solo12.urdf", floating_base=True)
    q = motion(chain, levels + 2)
    link = jn.forward_kinematics(chain, q, robot.base)
    still = np.swapaxes(link.rotation[:, 0], 1, 2)
    # components in the axes of the base, with rates, by Leibniz's rule on those of its rotation matrix
    back = np.swapaxes(link.rotation, 2, 3)
    twist = np.zeros((SAMPLES, levels + 1, 6))
    for k in range(levels + 1):
        for j in range(k + 1):
            weight = float(np.prod(np.arange(k - j + 1, k + 1)) / np.prod(np.arange(1, j + 1)))
            twist[:, k, :3] += weight * np.einsum("sij,sj->si", back[:, j], link.position[:, k - j + 1])
            twist[:, k, 3:] += weight * np.einsum("sij,sj->si", back[:, j], link.angular_velocity[:, k - j])
    quaternion = np.array([np.roll(pinocchio.Quaternion(r.T).coeffs(), 1) for r in still])
    forces = jn.inverse_dynamics(robot, q[:, :, 6:], base=jn.robot.BaseMotion(link.position[:, 0], quaternion, twist))
    expected = jn.inverse_dynamics(chain, q)
    assert error(forces[:, :, 6:], expected[:, :, 6:]) <= 1e-12
    held = jn.robot.joint_wrenches(chain, q)[:, :, chain.moving_links.index(robot.base)]
    assert error(forces[:, :, :6], held) <= 1e-12


@pytest.mark.slow
def test_gradients_of_accelerations_and_their_rates():
    robot = random_robot(2, 2, prismatic=0.4)
    q, step = motion(robot, 4)[0], 1e-5
    torque, change = np.array([[1.0, -2.0], [3.0, 1.0]]), motion(robot, 4, 7)[0]

    def last(state, torque):
        return jn.forward_dynamics(robot, state, torque)[-1, 0]

    slope = jax.grad(last)(q[:2], torque[:1])  # backward, of the acceleration
    ends = (last(q[:2] + sign * step * change[:2], torque[:1]) for sign in (1, -1))
    assert abs(np.sum(slope * change[:2]) - np.subtract(*ends) / (2 * step)) <= 1e-8 * np.abs(slope).max()
    _, slope = jax.jvp(last, (q[:2], torque), (change[:2], change[2:]))  # forward, of its rate
    ends = (last(q[:2] + sign * step * change[:2], torque + sign * step * change[2:]) for sign in (1, -1))
    assert abs(slope - np.subtract(*ends) / (2 * step)) <= 1e-7 * max(1.0, abs(slope))


def test_bad_input_is_reported():
    robot = random_robot(2, 3)
    state = np.zeros((2, 3))
    with pytest.raises(jn.errors.RobotError, match=r"tau: must have the shape \(order \+ 1, 3\), as"):
        jn.forward_dynamics(robot, state, np.zeros(3))
    with pytest.raises(jn.errors.RobotError, match="driven: "):
        jn.forward_dynamics(robot, state, np.zeros((1, 3)), driven=["elbow"])
    base = jn.robot.BaseMotion([0, 0, 0], [1, 1, 0, 0], np.zeros((1, 6)))
    with pytest.raises(jn.errors.RobotError, match=r"base.quaternion: must be of unit length"):
        jn.forward_dynamics(robot, state, np.zeros((1, 3)), base=base)
    with pytest.raises(jn.errors.RobotError, match=r"base.twist: must have the shape \(1, 6\)"):
        jn.forward_dynamics(
            robot, state, np.zeros((1, 3)), base=jn.robot.BaseMotion([0, 0, 0], [1, 0, 0, 0], np.zeros(6))
        )


def test_joint_that_nothing_resists_is_named():
    needle = jn.Inertia(1.0, center_of_mass=[0, 0, 0.2], tensor=[0.1, 0.1, 0])
    links = [jn.Link("base"), jn.Link("arm", needle), jn.Link("tip", needle)]
    joints = [jn.Joint("swing", "base", "arm", axis=[0, 1, 0]), jn.Joint("roll", "arm", "tip", armature=0.1)]
    robot = jn.Robot("needle", links, joints)
    state, torque = [[0.3, 0.1], [0.2, 0.5]], [[1.0, 0.2]]
    with pytest.raises(jn.errors.SingularityError, match=r"roll: .*no inertia"):
        jn.forward_dynamics(robot, state, torque, drives=False)
    assert np.isnan(jn.forward_dynamics(robot, state, torque, strict=False, drives=False)[2]).all()
    assert np.isfinite(jn.forward_dynamics(robot, state, torque, driven="roll", drives=False)).all()
    assert np.isfinite(jn.forward_dynamics(robot, state, torque)).all()


def test_loops_are_sent_elsewhere():
    robot = robot_named("serial")
    closed = robot.with_closures([jn.robot.Closure("tip", (robot.base, robot.moving_links[-1]))])
    with pytest.raises(jn.errors.RobotError, match=r"jn.simulate\(robot.mechanism"):
        jn.forward_dynamics(closed, np.zeros((2, 6)), np.zeros((1, 6)))


def test_a_lone_body_that_is_fixed_has_no_motion():
    post = jn.Robot("post", [jn.Link("body", jn.Inertia(1.0))], [])
    assert jn.forward_dynamics(post, np.zeros((3, 2, 0)), np.zeros((3, 2, 0))).shape == (3, 4, 0)


@pytest.mark.slow
def test_free_base_without_inertia_is_reported():
    ball = jn.Inertia(1.0, center_of_mass=[0.1, 0, 0], tensor=[0.1, 0.1, 0.1])
    robot = jn.Robot("ball", [jn.Link("base"), jn.Link("ball", ball)], [jn.Joint("pin", "base", "ball")])
    base = jn.robot.BaseMotion([0, 0, 0], [1, 0, 0, 0], np.zeros((1, 6)))
    with pytest.raises(jn.errors.SingularityError, match="some motion of the joints or of the free base"):
        jn.forward_dynamics(robot, np.zeros((2, 1)), [[1.0]], base=base)


@pytest.mark.slow
def test_symmetric_top_in_closed_form():
    """Its angular velocity turns about its axis at a constant rate: all rates of the twist of a base are known."""
    across, along, spin = 2.0, 0.5, 3.0
    top = jn.Robot("top", [jn.Link("body", jn.Inertia(1.5, tensor=[across, across, along]))], [], gravity=[0, 0, 0])
    start = jn.robot.BaseMotion([0, 0, 0], [0.6, 0, 0.8, 0], [[0, 0, 0, 1.0, 0, spin]])
    moved, _ = jn.forward_dynamics(top, np.zeros((2, 0)), np.zeros((HIGHEST + 1, 0)), base=start)
    rates = (1j * (along - across) / across * spin) ** np.arange(HIGHEST + 2)
    expected = np.stack([rates.real, rates.imag, spin * (np.arange(HIGHEST + 2) == 0)], axis=1)
    assert error(moved.twist[:, 3:], expected) <= 1e-14
    assert not moved.twist[:, :3].any()
