"""How Pinocchio and MuJoCo number the coordinates of a file: torques of both through what `as_read_by` says."""

import mujoco
import numpy as np
import pinocchio
import pytest

import jounce as jn
from jounce.errors import RobotError, RobotFileError
from jounce.io.robots.other_readers import READERS, as_read_by, permutation

MASS = '<inertial><origin xyz="0.1 0.2 0.3"/><mass value="1.5"/>'
MASS += '<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0.01" ixz="0" iyz="0.02"/></inertial>'
TREE = [  # name, type, parent, child, axis, more; neither joints nor links are in the order of names
    ("waist", "continuous", "base", "z", "0 0 1", ""),
    ("right", "revolute", "z", "b", "0 1 0", ""),
    ("left", "revolute", "z", "c", "1 1 0", ""),
    ("wrist", "prismatic", "b", "a", "0 0 1", ""),
    ("plate", "fixed", "c", "f", "0 0 1", ""),
    ("elbow", "revolute", "f", "d", "0 1 1", ""),
    ("alike", "revolute", "base", "e", "1 0 0", '<mimic joint="wrist" multiplier="-2" offset="0.3"/>'),
]


def urdf(joints):
    links = dict.fromkeys(end for joint in joints for end in joint[2:4])
    text = "".join(f'<link name="{name}">{"" if name == "base" else MASS}</link>' for name in links)
    for k, (name, kind, parent, child, axis, more) in enumerate(joints):
        limit = '<limit lower="-3" upper="3" effort="9" velocity="9"/>' if kind in ("revolute", "prismatic") else ""
        origin = f'<origin xyz="0.1 0.{k} -0.2" rpy="0.3 0.{k} -0.4"/>'
        ends = f'<parent link="{parent}"/><child link="{child}"/>'
        axis = f'<axis xyz="{axis}"/>' if axis else ""
        text += f'<joint name="{name}" type="{kind}">{origin}{ends}{axis}{limit}{more}</joint>'
    return f'<robot name="r">{text}</robot>'


def written(tmp_path, text, name="robot.urdf"):
    (tmp_path / name).write_text(text)
    return str(tmp_path / name)


def theirs(joints, robot, q):
    """Return positions, velocities, accelerations of another program, and how its velocities depend on ours."""
    position, rows = [], []
    for joint in joints:
        values = [sum(x * q[0, robot.joint_names.index(n)] for n, x in row.items()) for row in joint.factors]
        if joint.positions == ("cos", "sin"):
            position += [np.cos(values[0]), np.sin(values[0])]
        else:
            position += [value + joint.offset for value in values]
        rows += [[row.get(name, 0.0) for name in robot.joint_names] for row in joint.factors]
    spread = np.array(rows)
    return position, spread @ q[1], spread @ q[2], spread


def torques_of_mujoco(path, position, velocity, acceleration):
    model = mujoco.MjModel.from_xml_path(path)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)  # torques alone, without those of followers
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = position, velocity, acceleration
    mujoco.mj_inverse(model, data)
    return data.qfrc_inverse


def torques_of_pinocchio(path, *state):
    model = pinocchio.buildModelFromUrdf(path)
    return pinocchio.rnea(model, model.createData(), *(np.array(x) for x in state))


TORQUES = {"pinocchio": torques_of_pinocchio, "mujoco": torques_of_mujoco}


@pytest.mark.parametrize("reader", TORQUES)
def test_torques_are_those_of_the_other_program(tmp_path, reader):
    path = written(tmp_path, urdf(TREE))
    robot = jn.load_robot(path)
    joints = as_read_by(reader, path, robot)
    q = np.random.default_rng(1).normal(size=(3, len(robot.joint_names)))
    *state, spread = theirs(joints, robot, q)
    expected = spread.T @ TORQUES[reader](path, *state)
    found = jn.inverse_dynamics(robot, q, drives=False)[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    indices, factors = permutation(joints, robot)
    np.testing.assert_array_equal(state[1], np.array(factors) * q[1][indices])


@pytest.mark.parametrize(
    "reader, names",
    [
        ("pinocchio", ["alike", "waist", "left", "elbow", "right", "wrist"]),
        ("mujoco", ["waist", "right", "wrist", "left", "elbow", "alike"]),
        ("drake", ["waist", "right", "wrist", "left", "elbow", "alike"]),
        ("pybullet", ["waist", "right", "wrist", "left", "elbow", "alike"]),
        ("yourdfpy", ["waist", "right", "left", "wrist", "elbow"]),
    ],
)
def test_orders_are_those_that_were_seen(tmp_path, reader, names):
    """Seen with the versions of `READERS` in 120, 88, 116, 122 and 125 published files."""
    path = written(tmp_path, urdf(TREE))
    assert [joint.joint for joint in as_read_by(reader, path, jn.load_robot(path))] == names
    assert reader in READERS


@pytest.mark.parametrize("axis", ["0 0 1", "", "0 1 0", "0.6 0 0.8", "1 2 3"])
def test_planar_joints_of_mujoco_in_our_coordinates(tmp_path, axis):
    path = written(tmp_path, urdf([("j", "planar", "base", "a", axis, ""), ("k", "revolute", "a", "b", "0 0 1", "")]))
    robot = jn.load_robot(path)
    joints = as_read_by("mujoco", path, robot)
    q = np.random.default_rng(2).normal(size=(3, 4))
    *state, spread = theirs(joints, robot, q)
    expected = spread.T @ torques_of_mujoco(path, *state)
    np.testing.assert_allclose(jn.inverse_dynamics(robot, q)[0], expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_free_joints_and_balls_say_what_they_hold(tmp_path):
    path = written(tmp_path, urdf([("j", "floating", "base", "a", "", ""), ("k", "continuous", "a", "b", "0 0 1", "")]))
    robot = jn.load_robot(path)
    for reader, first, size in (("pinocchio", "x", 9), ("mujoco", "x", 8), ("drake", "qw", 8)):
        free, turn = as_read_by(reader, path, robot)
        assert (free.positions[0], len(free.coordinates), free.factors) == (first, 6, None)
        assert len(free.positions) + len(turn.positions) == size
        assert permutation([free, turn], robot) is None
    assert pinocchio.buildModelFromUrdf(path).nq == 9
    assert mujoco.MjModel.from_xml_path(path).nq == 8
    assert as_read_by("pybullet", path, robot)[0].positions == ()
    with pytest.raises(RobotFileError, match=r"line 1, joints\.j: how yourdfpy numbers this floating joint"):
        as_read_by("yourdfpy", path, robot)


def test_files_of_mujoco_have_its_order(tmp_path):
    geom = '<geom size="0.1"/>'
    path = written(
        tmp_path,
        f'<mujoco><worldbody><body><freejoint name="f"/>{geom}<body><joint name="h"/>{geom}<body><joint type="ball"/>'
        f'{geom}</body></body><body><joint name="held"/><joint name="s" type="slide"/>{geom}</body></body></worldbody>'
        '<equality><joint joint1="held"/></equality></mujoco>',
        "robot.xml",
    )
    robot = jn.load_robot(path)
    joints = as_read_by("mujoco", path, robot)
    model = mujoco.MjModel.from_xml_path(path)
    assert [len(joint.positions) for joint in joints] == [7, 1, 4, 1, 1]
    assert [model.jnt_qposadr[k] for k in range(5)] == np.cumsum([0, 7, 1, 4, 1]).tolist()
    assert [name for joint in joints for name in joint.coordinates] == list(robot.joint_names)
    assert joints[3].note.startswith("an equality holds it")
    with pytest.raises(RobotFileError, match="has not been examined, got 'drake'; known readers of it: mujoco"):
        as_read_by("drake", path, robot)


def test_what_is_not_known_is_refused(tmp_path):
    path = written(tmp_path, urdf([("j", "planar", "base", "a", "0 0 -1", "")]))
    robot = jn.load_robot(path)
    with pytest.raises(RobotError, match="unknown reader, got 'kdl'"):
        as_read_by("kdl", path, robot)
    with pytest.raises(RobotFileError, match="planar joint with this axis"):
        as_read_by("mujoco", path, robot)
