"""Robots from MJCF files against MuJoCo, which computes its own poses, masses and forces of the same model."""

import sys

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.errors import RobotFileError
from jounce.io.robots.loader import load_robot
from tests.problems.robots import FILES, body_poses, coordinates, poses

INERTIAL = '<inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.2 0.25"/>'
FEATURES = """\
<mujoco model="features">
  <compiler angle="degree" autolimits="true"/>
  <option gravity="0.5 0 -9"/>
  <default>
    <joint damping="0.3" axis="0 0 2"/>
    <default class="strong">
      <joint armature="0.4" frictionloss="0.7"/>
    </default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="stand" pos="0 0 1" euler="10 20 30">
      <inertial pos="0 0 0.1" mass="3" diaginertia="0.2 0.2 0.1"/>
      <body name="arm" pos="0.1 0.2 0.3" quat="0.9 0.1 -0.2 0.3">
        <joint name="swing" class="strong" pos="0.05 -0.02 0.1" axis="0 1 1" range="-100 60" ref="25"/>
        <joint name="reach" type="slide" axis="1 0 0.5" pos="0.3 0 0" range="-0.1 0.4" ref="0.15" armature="2"/>
        <inertial pos="0.2 0 0.05" mass="2.5" fullinertia="0.03 0.05 0.06 0.004 -0.003 0.002"/>
        <geom type="mesh" mesh="nowhere"/>
        <body pos="0.4 0 0">
          <joint name="twist" armature="0.1"/>
          <geom type="capsule" size="0.03 0.2" pos="0 0 0.2" density="700"/>
          <body name="flange" pos="0 0 0.4" axisangle="0 1 0 35">
            <inertial pos="0 0 0" mass="0.3" diaginertia="0.001 0.001 0.001" euler="0 0 45"/>
            <body name="gimbal" pos="0 0.05 0.1" euler="0 0 15">
              <joint name="wrist" type="ball" pos="0 0.01 -0.02" damping="0"/>
              <inertial pos="0 0.1 0" mass="0.6" diaginertia="0.002 0.003 0.004" quat="0.5 0.5 -0.5 0.5"/>
            </body>
          </body>
        </body>
      </body>
    </body>
    <body name="ball" pos="1 2 3" euler="40 0 0">
      <freejoint name="loose"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/>
    </body>
  </worldbody>
  <actuator>
    <motor joint="swing" gear="30" ctrlrange="-2 2" armature="0.001" damping="0.002"/>
    <position joint="reach" kp="100" forcerange="-55 55"/>
    <motor name="odd" joint="twist" ctrlrange="-1 2"/>
  </actuator>
</mujoco>
"""
MESHES = '<asset><mesh name="nowhere" file="nowhere.stl"/></asset>\n</mujoco>'


@pytest.fixture(params=["features", "planar_arm"])
def pair(request, tmp_path):
    path = FILES / f"{request.param}.xml"
    text = path.read_text() if request.param == "planar_arm" else FEATURES
    if request.param == "features":
        path = tmp_path / "features.xml"
        path.write_text(text.replace("</mujoco>", MESHES))
    return load_robot(path), mujoco.MjModel.from_xml_string(text.replace('<geom type="mesh" mesh="nowhere"/>', ""))


def positions(model, values):
    """Return MuJoCo's coordinates for ours."""
    q = np.array(model.qpos0)
    for k in range(model.njnt):
        first, name = model.jnt_qposadr[k], model.joint(k).name or f"joint_{k}"
        angles = [values.get(f"{name}_angle_{i}") for i in (1, 2, 3)]
        if name in values:
            q[first] = values[name]
            continue
        if f"{name}_x" in values:
            q[first : first + 3] = [values[f"{name}_{axis}"] for axis in "xyz"]
            first += 3
        q[first : first + 4] = Rotation.from_euler("ZYX", angles).as_quat(scalar_first=True)
    return q


def written(tmp_path, inside, after=""):
    path = tmp_path / "small.xml"
    path.write_text(
        f'<mujoco model="small">\n<worldbody>\n<body name="a">{INERTIAL}{inside}</body></worldbody>\n{after}</mujoco>'
    )
    return path


def named(model, kind, count):
    return [getattr(model, kind)(k).name or f"{kind}_{k}" for k in range(count)]


def test_names_and_order(pair):
    robot, model = pair
    bodies, joints = named(model, "body", model.nbody), named(model, "joint", model.njnt)
    assert set(bodies) <= set(robot.link_names)
    assert robot.base == "world"
    order = [name for name in robot.joint_names if name in joints]
    assert order == [name for name in joints if name in robot.joint_names]
    assert len(robot.joint_names) == model.nv


def test_poses_of_all_bodies(pair):
    robot, model = pair
    values, data = coordinates(robot, seed=7), mujoco.MjData(model)
    data.qpos[:] = positions(model, values)
    mujoco.mj_forward(model, data)
    ours, bodies = poses(robot, values), body_poses(robot, values)
    for k, name in enumerate(named(model, "body", model.nbody)):
        frame, here = robot.frames[name], np.eye(4)
        here[:3, :3], here[:3, 3] = frame.rotation, frame.position
        whole = here if frame.body < 0 else bodies[frame.body] @ here
        for pose in (ours[name], whole):
            np.testing.assert_allclose(pose[:3, 3], data.xpos[k], rtol=0, atol=1e-14)
            np.testing.assert_allclose(pose[:3, :3], data.xmat[k].reshape(3, 3), rtol=0, atol=1e-14)


def test_mass_center_and_inertia_of_bodies(pair):
    robot, model = pair
    values, data = coordinates(robot, seed=8), mujoco.MjData(model)
    data.qpos[:] = positions(model, values)
    mujoco.mj_forward(model, data)
    ours = poses(robot, values)
    assert robot.mass == pytest.approx(model.body_mass.sum(), rel=1e-15)
    for k, name in enumerate(named(model, "body", model.nbody)):
        if k == 0:
            assert robot.links[name].inertia is None
            continue
        inertia, rotation = robot.links[name].inertia, ours[name][:3, :3]
        assert inertia.mass == model.body_mass[k]
        center = rotation @ inertia.center_of_mass + ours[name][:3, 3]
        np.testing.assert_allclose(center, data.xipos[k], rtol=0, atol=1e-14)
        axes = data.ximat[k].reshape(3, 3)
        expected = axes @ np.diag(model.body_inertia[k]) @ axes.T
        np.testing.assert_allclose(rotation @ inertia.tensor @ rotation.T, expected, rtol=0, atol=1e-15)


def test_armature_damping_and_friction_of_joints_with_their_actuators(pair):
    robot, model = pair
    data, bare = mujoco.MjData(model), mujoco.MjData(model)
    matrices = []
    for state in (data, bare):
        mujoco.mj_forward(model, state)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, state, full)
        matrices.append(full)
        model.dof_armature[:], model.actuator_armature[:] = 0, 0  # for the second turn
    armature = np.diag(matrices[0] - matrices[1])
    data.qvel[:] = 1
    mujoco.mj_forward(model, data)
    for k in range(model.njnt):
        joint, dof = robot.joints.get(model.joint(k).name), model.jnt_dofadr[k]
        if joint is not None:
            assert joint.armature == pytest.approx(armature[dof], rel=1e-12)
            assert joint.damping == pytest.approx(-data.qfrc_passive[dof], rel=1e-15)
            assert joint.friction == model.dof_frictionloss[dof]


def test_a_drive_of_a_joint_in_its_parent_counts_like_one_in_the_child(tmp_path):
    """For a hinge or a slide there is no difference: the mass matrix, the damping and the limit are MuJoCo's."""
    drive = "<actuator><motor {}='j' gear='3' armature='0.2' damping='0.5' ctrlrange='-2 2'/></actuator>"
    for kind in ("joint", "jointinparent"):
        path = written(tmp_path, "<joint name='j' axis='0 1 0'/>", drive.format(kind))
        robot, model = load_robot(path), mujoco.MjModel.from_xml_path(str(path))
        data, matrix = mujoco.MjData(model), np.zeros((1, 1))
        data.qvel[:] = 1
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, matrix)
        np.testing.assert_allclose(jn.mass_matrix(robot, [0.0], drives=True), matrix, rtol=1e-15)
        assert robot.joints["j"].damping == -data.qfrc_passive[0]
        assert robot.limits["j"].effort == 6


def test_a_height_field_that_weighs_has_a_part_in_the_mass_of_its_body(tmp_path):
    field = "<asset><hfield name='h' nrow='2' ncol='2' size='1 1 0.1 0.1' elevation='0 1 1 0'/></asset>"
    path = tmp_path / "field.xml"
    path.write_text(
        f"<mujoco>{field}<worldbody><body name='a'><joint/><geom size='0.1'/>"
        "<geom type='hfield' hfield='h' mass='5' pos='0.1 0.2 0.3'/></body></worldbody></mujoco>"
    )
    inertia, model = load_robot(path).links["a"].inertia, mujoco.MjModel.from_xml_path(str(path))
    assert inertia.mass == model.body_mass[1] > 5
    np.testing.assert_allclose(np.linalg.eigvalsh(inertia.tensor), np.sort(model.body_inertia[1]), rtol=1e-14)


def test_ranges_are_limits_and_symmetric_forces_too(pair):
    robot, model = pair
    for k in range(model.njnt):
        joint = robot.joints.get(model.joint(k).name)
        if joint is not None and model.jnt_limited[k]:
            assert [joint.limits.lower, joint.limits.upper] == model.jnt_range[k].tolist()
            assert joint.type in ("revolute", "prismatic")
        elif joint is not None:
            assert (joint.type, joint.limits.lower, joint.limits.upper) == ("continuous", None, None)
    efforts = {name: limits.effort for name, limits in robot.limits.items() if limits.effort is not None}
    expected = {"swing": 60, "reach": 55} if robot.name == "features" else {"shoulder": 120, "elbow": 60, "ram": 150}
    assert efforts == pytest.approx(expected, rel=1e-15)
    np.testing.assert_array_equal(robot.gravity, model.opt.gravity)


def test_two_joints_of_one_body_have_a_massless_link_between_them(pair):
    robot, _ = pair
    if robot.name == "features":
        assert robot.joints["swing"].child == robot.joints["reach"].parent == "arm_swing"
        assert robot.links["arm_swing"].inertia is None


def test_a_body_on_a_ball_and_a_free_one_have_three_turns_each(tmp_path):
    path = tmp_path / "features.xml"
    path.write_text(FEATURES.replace("</mujoco>", MESHES))
    names = load_robot(path).joint_names
    assert names[3:6] == ("wrist_angle_1", "wrist_angle_2", "wrist_angle_3")
    assert names[6:] == (*(f"loose_{axis}" for axis in "xyz"), *(f"loose_angle_{k}" for k in (1, 2, 3)))


def test_the_turns_and_slides_of_a_free_joint_have_names_that_no_other_joint_has(tmp_path):
    inside = "<freejoint name='root'/><body name='root_frame_4'><joint name='root_x'/><geom size='0.1'/></body>"
    robot = load_robot(written(tmp_path, inside))
    assert robot.joint_names[:3] == ("root_x_", "root_y", "root_z")
    assert robot.joint_names[-1] == "root_x"
    assert robot.joints["root_angle_1"].child == "root_frame_4_"
    assert robot.joints["root_x"].child == "root_frame_4"


def test_the_arm_of_the_examples_has_its_pose_in_the_file_at_the_reference():
    robot = load_robot(FILES / "planar_arm.xml")
    assert robot.joint_names == ("shoulder", "elbow", "ram")
    straight = poses(robot, dict.fromkeys(robot.joint_names, 0.0))
    np.testing.assert_allclose(straight["ram"][:3, 3], [0.65, 0, 0.64], rtol=0, atol=1e-15)
    np.testing.assert_allclose(straight["ram"][:3, :3], np.eye(3), rtol=0, atol=1e-15)


def test_unnamed_parts_are_called_by_their_number(tmp_path):
    path = tmp_path / "unnamed.xml"
    path.write_text(f"<mujoco><worldbody><body>{INERTIAL}<joint/><joint type='slide'/></body></worldbody></mujoco>")
    robot = load_robot(path)
    assert robot.joint_names == ("joint_0", "joint_1")
    assert set(robot.link_names) == {"world", "body_1_joint_0", "body_1"}


def test_gravity_that_is_switched_off(tmp_path):
    robot = load_robot(written(tmp_path, "<joint name='j'/>", "<option><flag gravity='disable'/></option>"))
    np.testing.assert_array_equal(robot.gravity, [0, 0, 0])


@pytest.mark.parametrize(
    "flag, kept", [("damper", (0.0, 2.0)), ("frictionloss", (5.0, 0.0)), ("constraint", (5.0, 0.0))]
)
def test_damping_and_friction_that_are_switched_off(tmp_path, flag, kept):
    inside = "<joint name='j' axis='0 1 0' damping='3' frictionloss='2'/>"
    drive = "<actuator><motor joint='j' damping='2'/></actuator>"
    path = written(tmp_path, inside, f"<option gravity='0 0 0'><flag {flag}='disable'/></option>{drive}")
    joint, model = load_robot(path).joints["j"], mujoco.MjModel.from_xml_path(str(path))
    assert (joint.damping, joint.friction) == kept
    data = mujoco.MjData(model)
    data.qvel[:] = 1
    mujoco.mj_forward(model, data)
    assert (-data.qfrc_passive[0], bool(data.nf)) == (kept[0], bool(kept[1]))


@pytest.mark.parametrize("flag", ["equality", "constraint"])
def test_equalities_that_are_switched_off(tmp_path, flag):
    inside = "<joint name='j'/><joint name='k' type='slide'/>"
    ties = "<equality><joint joint1='j' joint2='k'/><connect body1='a' body2='world' anchor='0 0 0'/></equality>"
    robot = load_robot(written(tmp_path, inside, f"<option><flag {flag}='disable'/></option>{ties}"))
    assert robot.joint_names == ("j", "k")
    assert not robot.closures


def test_a_linear_equality_of_joints_is_a_joint_that_follows(tmp_path):
    inside = "<joint name='j' ref='20'/><joint name='k' type='slide' ref='0.3'/>"
    robot = load_robot(
        written(tmp_path, inside, "<equality><joint joint1='j' joint2='k' polycoef='0.1 -2 0 0 0'/></equality>")
    )
    assert robot.joint_names == ("k",)
    mimic = robot.joints["j"].mimic
    assert (mimic.joint, mimic.multiplier) == ("k", -2)
    assert mimic.offset == pytest.approx(np.radians(20) + 0.1 + 2 * 0.3, rel=1e-15)  # about the references, as MuJoCo


TIED = """
<mujoco><compiler angle="radian"/><worldbody>
  <body><joint name="a" axis="0 1 0" ref="0.3"/><geom size="0.1"/>
    <body pos="0.1 0 0"><joint name="b" type="slide" axis="1 0 0" ref="-0.2"/><geom size="0.1"/>
      <body pos="0 0.1 0"><joint name="c" ref="0.5"/><geom size="0.1"/>
        <body pos="0 0 0.1"><joint name="d" axis="1 0 0"/><geom size="0.1"/>
          <body pos="0 0 0.2"><joint name="e" axis="0 1 0" ref="0.1"/><geom size="0.1"/></body>
  </body></body></body></body></worldbody>
  <tendon>
    <fixed name="ab"><joint joint="a" coef="2"/><joint joint="b" coef="-3"/></fixed>
    <fixed name="cb"><joint joint="c" coef="0.5"/><joint joint="b" coef="0.7"/></fixed>
    <fixed name="d"><joint joint="d" coef="4"/></fixed>
    <fixed name="e"><joint joint="e" coef="-2"/></fixed>
  </tendon>
  <equality>
    <tendon tendon1="ab" polycoef="0.1 1 0 0 0"/>
    <tendon tendon1="cb"/>
    <tendon tendon1="d" tendon2="ab" polycoef="0.2 0 0 0 0"/>
    <tendon tendon1="e" tendon2="cb" polycoef="0.3 2 0 0 0" active="{}"/>
  </equality>
</mujoco>
"""


def test_an_equality_of_tendons_along_joints_ties_these(tmp_path):
    """Where the joints are as the robot has them, no equality of MuJoCo is off; b follows a, and c follows b."""
    path = tmp_path / "tied.xml"
    path.write_text(TIED.format("false"))
    robot, model = load_robot(path), mujoco.MjModel.from_xml_path(str(path))
    assert robot.joint_names == ("a", "e")
    data = mujoco.MjData(model)
    for values in ([0.0, 0.0], [0.8, -0.3]):
        q = dict(zip(robot.joint_names, values, strict=True))
        ours = body_poses(robot, q)
        for name, joint in robot.joints.items():
            if joint.mimic:
                q[name] = joint.mimic.multiplier * q[joint.mimic.joint] + joint.mimic.offset
        q["d"] = 0.2 / 4  # the joint that is held is none any more
        data.qpos[:] = [q[name] for name in "abcde"]
        mujoco.mj_forward(model, data)
        assert data.ne == 3
        np.testing.assert_allclose(data.efc_pos[:3], 0.0, rtol=0, atol=1e-15)
        last = robot.frames["body_5"]
        here = ours[last.body]
        np.testing.assert_allclose(here[:3, 3] + here[:3, :3] @ last.position, data.xpos[5], rtol=0, atol=1e-15)
    path.write_text(TIED.format("true"))
    assert load_robot(path).joint_names == ("a",)  # e follows c and b, which follow a


def test_parts_that_are_only_seen_need_no_material(tmp_path):
    """Published hands and arms color their sites; materials go, because their textures need not be there."""
    path = tmp_path / "seen.xml"
    path.write_text(
        "<mujoco><asset><texture name='t' type='2d' file='no.png'/><material name='m' texture='t'/></asset><default>"
        "<site material='m'/><tendon material='m'/></default><worldbody><site name='mark' material='m'/><body>"
        "<joint name='j'/><joint name='k' axis='0 1 0'/><geom size='0.1' material='m'/><site material='m'/></body>"
        "</worldbody><tendon><fixed name='f'><joint joint='j' coef='1'/><joint joint='k' coef='1'/></fixed>"
        "</tendon><equality><tendon tendon1='f'/></equality></mujoco>"
    )
    assert load_robot(path).joint_names == ("j",)


def test_an_equality_that_holds_a_joint_locks_it(tmp_path):
    inside = "<joint name='j' axis='0 0 1'/><joint name='k' axis='1 0 0'/>"
    robot = load_robot(written(tmp_path, inside, "<equality><joint joint1='j' polycoef='0.4 0 0 0 0'/></equality>"))
    assert robot.joint_names == ("k",)
    turned = Rotation.from_euler("z", 0.4).as_matrix()
    np.testing.assert_allclose(robot.joints["j"].rotation, turned, rtol=0, atol=1e-15)


def test_an_equality_that_is_not_active_is_left_out(tmp_path):
    loop = "<equality><weld name='grip' body1='a' active='false'/></equality>"
    assert load_robot(written(tmp_path, "<joint name='j'/>", loop)).joint_names == ("j",)


def test_an_actuated_range_of_force_counts(tmp_path):
    robot = load_robot(
        written(tmp_path, "<joint name='j' actuatorfrcrange='-7 7'/>", "<actuator><motor joint='j'/></actuator>")
    )
    assert robot.limits["j"].effort == 7


def test_what_refers_to_shapes_goes_with_them(tmp_path):
    inside = "<joint name='j'/><geom name='g' size='0.1' material='m'/><site name='s'/>"
    after = (
        "<asset><texture name='t' type='2d' file='no.png'/><material name='m' texture='t'/></asset>"
        "<contact><pair geom1='g' geom2='g'/><exclude body1='a' body2='world'/></contact>"
        "<tendon><spatial name='cord'><site site='s'/><geom geom='g'/><site site='s'/></spatial></tendon>"
        "<actuator><general tendon='cord'/><motor joint='j' gear='3' ctrlrange='-1 1'/></actuator>"
        "<sensor><tendonpos tendon='cord'/><jointpos joint='j'/></sensor><keyframe><key qpos='0'/></keyframe>"
    )
    robot = load_robot(written(tmp_path, inside, after))
    assert robot.limits["j"].effort == 3


@pytest.mark.parametrize("weightless", ["mass='0'", "density='0'", "class='picture'", "group='4'"])
def test_a_mesh_without_weight_need_not_be_there(tmp_path, weightless):
    path = tmp_path / "meshes.xml"
    path.write_text(
        "<mujoco><compiler inertiagrouprange='0 3'/>"
        "<default><default class='picture'><geom mass='0'/></default></default>"
        "<asset><mesh name='m' file='no.stl'/><hfield name='h' file='no.png' size='1 1 1 1'/></asset><worldbody>"
        "<geom type='hfield' hfield='h'/><body name='a'><joint/><geom size='0.1' density='500'/>"
        f"<geom type='mesh' mesh='m' {weightless}/></body></worldbody></mujoco>"
    )
    assert load_robot(path).mass == pytest.approx(500 * 4 / 3 * np.pi * 0.1**3, rel=1e-14)


def test_a_free_base_in_place_of_the_world():
    robot = load_robot(FILES / "planar_arm.xml", floating_base=True)
    assert robot.joints["base_angle_3"].child == "post"
    assert len(robot.joint_names) == 9


def test_without_the_extra_the_message_says_what_to_install(tmp_path, monkeypatch):
    path = written(tmp_path, "<joint/>")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    words = 'reading MJCF files needs the package mujoco, which is not installed: pip install "jounce[mjcf]"'
    assert str(caught.value) == f"{path}: {words}"


@pytest.mark.parametrize("inside", ["<joint axis='0 nan 0'/>", "<joint/><geom size='NaN'/>", "<joint margin='-nan'/>"])
def test_nothing_is_written_beside_the_user(tmp_path, monkeypatch, inside):
    monkeypatch.chdir(tmp_path)  # where MuJoCo would leave a log
    path = written(tmp_path, inside)
    with pytest.raises(RobotFileError, match=r"(?i)line 3, .*finite number.*got .*nan"):
        load_robot(path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["small.xml"]


def test_a_part_may_be_called_nan(tmp_path):
    robot = load_robot(written(tmp_path, "<joint name='nan'/>", "<actuator><motor joint='nan'/></actuator>"))
    assert robot.joint_names == ("nan",)


CLOSURES = """\
<mujoco model="loops"><compiler angle="radian"/>
  <worldbody>
    <site name="sw" pos="0.3 0.4 0.1" quat="0.9 0.1 0.2 0.3"/>
    <body name="a" quat="0.9 0.1 0.2 0.3"><joint axis="0 0 1"/><geom size="0.1"/>
      <body name="b" pos="0.3 0 0" euler="0 0 1"><joint axis="0 0.1 1" ref="0.2"/><geom size="0.1"/>
        <site name="sb" pos="0.11 0.12 0.13" quat="0.5 -0.1 0.7 0.3"/>
      </body>
    </body>
    <body name="c" pos="0.2 0.1 0"><joint axis="1 0 1"/><geom size="0.1"/>
      <site name="sc" pos="0.1 0.5 0.3" quat="0.5 0.2 0.7 0.3"/>
    </body>
  </worldbody>
  <equality>
    <connect body1="b" body2="c" anchor="0.3 0.02 0.05"/>
    <connect name="sites" site1="sb" site2="sc"/>
    <connect name="to the world" body1="b" anchor="0.3 0.02 0.05"/>
    <weld name="weld" body1="b" body2="c" anchor="0.3 0.02 0.05"/>
    <weld name="posed" body1="b" body2="c" anchor="0.3 0.02 0.05" relpose="0.1 0.2 0.3 0.9 0.1 0.3 0.2"/>
    <weld name="frames" site1="sb" site2="sc"/>
    <weld name="frame of the world" site1="sb" site2="sw"/>
    <weld name="whole body" body1="b"/>
    <weld name="without torque" body1="b" body2="c" torquescale="0"/>
    <connect name="not active" body1="b" anchor="0 0 0" active="false"/>
  </equality>
</mujoco>
"""


def test_connects_and_welds_are_closures_that_miss_what_mujoco_says(tmp_path):
    path = tmp_path / "loops.xml"
    path.write_text(CLOSURES)
    robot, model = load_robot(path), mujoco.MjModel.from_xml_string(CLOSURES)
    assert (*robot.closures,)[:3] == ("closure_0", "sites", "to the world")
    assert [c.type for c in robot.closures.values()] == [*["connect"] * 3, *["weld"] * 5, "connect"]
    data = mujoco.MjData(model)
    data.qpos[:] = [0.7, -0.4, 1.1]
    mujoco.mj_forward(model, data)
    ours = poses(robot, dict(zip(robot.joint_names, data.qpos, strict=True)))
    for k, closure in enumerate(robot.closures.values()):
        gap = data.efc_pos[[row for row in range(data.nefc) if data.efc_id[row] == k]]
        first, second = (ours[link] for link in closure.links)
        ends = [pose[:3, :3] @ p + pose[:3, 3] for pose, p in zip((first, second), closure.points, strict=True)]
        np.testing.assert_allclose(ends[0] - ends[1], gap[:3], rtol=0, atol=1e-14)
        if closure.type == "weld":
            turn = Rotation.from_matrix(second[:3, :3].T @ first[:3, :3] @ closure.rotation).magnitude()
            assert np.sin(turn / 2) == pytest.approx(np.linalg.norm(gap[3:]), rel=1e-13)


def test_loops_are_closed_from_the_pose_of_the_file(tmp_path):
    """Which of the two sides a plate on two legs is on, is told by nothing else."""
    plate = '<freejoint name="f"/><site name="l" pos="-0.2 0 0"/><site name="r" pos="0.2 0 0"/>'
    text = written(tmp_path, plate).read_text().replace('name="a"', 'name="a" pos="0.1 0 -0.8" euler="10 20 30"')
    legs = "".join(
        f'<body name="{name}" pos="{x} 0 0"><joint name="{name}x" axis="1 0 0" ref="20"/><joint name="{name}y" '
        f'axis="0 1 0"/><joint name="{name}s" type="slide" axis="0 0 1" ref="-0.8"/>{INERTIAL}'
        f'<site name="{name}e" pos="0 0 -0.8"/></body>'
        for name, x in (("p", -0.2), ("q", 0.2))
    )
    ties = '<equality><connect site1="pe" site2="l"/><connect site1="qe" site2="r"/></equality>'
    path = tmp_path / "platform.xml"
    path.write_text(text.replace("</worldbody>", f"{legs}</worldbody>{ties}"))
    robot, model = load_robot(path), mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start = {name: robot.joints[name].start for name in robot.joint_names}
    for name, pose in ((name, poses(robot, start)[name]) for name in "apq"):
        np.testing.assert_allclose(pose[:3, 3], data.body(name).xpos, rtol=0, atol=1e-15)
        np.testing.assert_allclose(pose[:3, :3].ravel(), data.body(name).xmat, rtol=0, atol=1e-15)
    body = robot.mechanism().bodies["a"]
    assert np.linalg.norm(np.array(body.position) - data.body("a").xpos) < 0.5
    origin = np.array(robot.mechanism({"f_z": 0.8, "ps": 0.8, "qs": 0.8}).bodies["a"].position)
    assert origin[2] > 0  # the other side is where it was asked for


def test_moments_without_mass_count_as_in_mujoco_and_are_warned_of(tmp_path):
    path = tmp_path / "rotor.xml"
    rotor = '<body name="rotor" pos="0.1 0 0"><inertial pos="0 0 0" mass="0" diaginertia="0.2 0.3 0.4"/></body>'
    path.write_text(
        f'<mujoco><worldbody><body name="arm"><joint axis="0 0 1"/>{INERTIAL}{rotor}</body></worldbody></mujoco>'
    )
    with pytest.warns(jn.errors.RobotWarning, match=r"no mass beside them: rotor \(line 1\)"):
        robot = load_robot(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qacc[:] = 2.0
    mujoco.mj_inverse(model, data)
    torque = jn.inverse_dynamics(robot, [[0.0], [0.0], [2.0]])
    np.testing.assert_allclose(torque[0], data.qfrc_inverse, rtol=1e-14)
    with pytest.raises(RobotFileError, match=r"line 1, links\.rotor\.inertia: .*no mass"):
        load_robot(path, strict=True)


def test_a_joint_may_follow_one_that_follows_another(tmp_path):
    path = tmp_path / "chain.xml"
    bodies = "".join(f'<body name="b{k}"><joint name="j{k}"/>{INERTIAL}' for k in range(3)) + "</body>" * 3
    ties = (
        '<joint joint1="j2" joint2="j1" polycoef="1 -3 0 0 0"/><joint joint1="j1" joint2="j0" polycoef="0.5 2 0 0 0"/>'
    )
    path.write_text(f"<mujoco><worldbody>{bodies}</worldbody><equality>{ties}</equality></mujoco>")
    robot = load_robot(path)
    assert robot.joint_names == ("j0",)
    assert robot.joints["j2"].mimic == jn.robot.Mimic("j0", -6.0, -0.5)


def test_closures_stay_where_the_base_is_set_free(tmp_path):
    path = tmp_path / "loop.xml"
    legs = "".join(
        f'<body name="{n}" pos="{x} 0 0"><joint axis="0 1 0"/>{INERTIAL}</body>' for n, x in (("a", 0), ("b", 1))
    )
    tie = '<equality><connect name="tie" body1="a" body2="b" anchor="0 0 -1"/></equality>'
    path.write_text(f'<mujoco><worldbody><body name="trunk">{INERTIAL}{legs}</body></worldbody>{tie}</mujoco>')
    assert list(load_robot(path, floating_base=True).closures) == ["tie"]


@pytest.mark.parametrize("count, within", [("3000", 1), ("50", 50), ("1e9", 0)])
def test_repeated_bodies_are_counted_before_they_are_made(tmp_path, count, within):
    body = '<body><joint/><geom size="0.1"/></body>'
    inner = f'<replicate count="{within}" offset="1 0 0">{body}</replicate>' if within else body
    path = written(tmp_path, f'<replicate count="{count}" offset="0 1 0">{inner}</replicate>')
    with pytest.raises(RobotFileError, match="more than 2000 bodies"):
        load_robot(path)


@pytest.mark.parametrize("repeated", [False, True])
def test_bodies_of_files_within_files_are_counted(tmp_path, repeated):
    frames = "".join(f'<frame><attach model="m" prefix="p{k}"/></frame>' for k in range(1 if repeated else 3))
    body = '<body><joint/><geom size="0.1"/></body>'
    leaf = f'<replicate count="1500" offset="1 0 0">{body}</replicate>' if repeated else body
    if repeated:  # by one file, and by the one that attaches it
        frames = f'<replicate count="2" offset="1 0 0">{frames}</replicate>'
    text = "<mujoco>{}<worldbody>{}</worldbody></mujoco>"
    depth = 1 if repeated else 7  # 3**7 bodies
    for k in range(depth):
        path = tmp_path / f"level{k}.xml"
        path.write_text(text.format(f'<asset><model name="m" file="level{k + 1}.xml"/></asset>', frames))
    (tmp_path / f"level{depth}.xml").write_text(text.format("", leaf))
    with pytest.raises(RobotFileError, match="more than 2000 bodies"):
        load_robot(tmp_path / "level0.xml")


def test_a_few_repeated_bodies_are_a_robot(tmp_path):
    text = '<replicate count="3" offset="0 1 0"><body name="b"><joint/><geom size="0.1"/></body></replicate>'
    assert len(load_robot(written(tmp_path, text)).joint_names) == 3


@pytest.mark.parametrize("given", [(a, b) for a in ("ix", "x", "i") for b in ("ix", "x", "i", "")])
@pytest.mark.parametrize("settings", ['fusestatic="true"', 'fusestatic="true" inertiafromgeom="true"'])
def test_masses_of_fused_bodies_are_those_of_mujoco_or_refused(tmp_path, settings, given):
    parts = {"i": '<inertial mass="2" pos="0 0 0" diaginertia="0.1 0.1 0.1"/>', "x": '<geom size="0.1" mass="0.7"/>'}
    inner, outer = ("".join(parts[key] for key in own) for own in reversed(given))
    path = tmp_path / "fused.xml"
    path.write_text(
        f'<mujoco><compiler {settings}/><worldbody><body name="a"><joint/>{outer}<body name="b" pos="0.1 0 0">'
        f"{inner}</body></body></worldbody></mujoco>"
    )
    mass = float(mujoco.MjModel.from_xml_path(str(path)).body_mass.sum())
    whole = sum(2.0 if "i" in own and ("x" not in own or "geom" not in settings) else 0.7 for own in given if own)
    if mass == whole:
        assert load_robot(path).mass == pytest.approx(mass, rel=1e-12)
    else:
        with pytest.raises(RobotFileError, match=r"MuJoCo drops the inertia of a body without shapes;"):
            load_robot(path)
