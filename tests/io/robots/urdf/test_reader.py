"""Robots from URDF files against Pinocchio, entry by entry, and what the format leaves open."""

import contextlib

import numpy as np
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.errors import RobotFileError
from jounce.io.robots.loader import load_robot
from tests.problems.robots import FILES, body_poses, coordinates, poses

FEATURES = """\
<?xml version="1.0"?>
<!-- a robot with one of everything -->
<robot name="features" xmlns:drake="http://drake.mit.edu">
  <material name="gray"><color rgba="1 1 1 1"/></material>
  <link name="base"/>
  <link name="one">
    <visual><geometry><mesh filename="package://nowhere/one.dae"/></geometry></visual>
    <inertial>
      <mass value="1.5"/>
      <origin xyz=" 0.1  -2e-1 .3" rpy="0.4 -1.1 2.7"/>
      <inertia ixx="0.3" ixy="0.02" ixz="-0.03" iyy="0.4" iyz="0.01" izz="0.5"/>
    </inertial>
  </link>
  <link name="two">
    <inertial>
      <mass value="2"/>
      <inertia ixx="0.2" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/>
    </inertial>
  </link>
  <link name="held">
    <inertial>
      <mass value="0.7"/>
      <origin xyz="0.05 0 0" rpy="0 1.5707963267948966 0"/>
      <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.04"/>
    </inertial>
  </link>
  <link name="three">
    <inertial>
      <mass value="0.9"/>
      <origin xyz="0 0 0.2"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
  </link>
  <link name="four">
    <inertial>
      <mass value="0.4"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
  </link>
  <joint name="turn" type="continuous" drake:note="kept out">
    <parent link="base"/>
    <child link="one"/>
    <origin xyz="0 0 1" rpy="0.3 -0.2 2.9"/>
    <limit effort="0" velocity="0"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="one"/>
    <child link="two"/>
    <origin rpy="1.5707963267948966 0 -1.5707963267948966"/>
    <axis xyz="1 2 -2"/>
    <limit lower="-1" upper="inf" effort="30" velocity="2"/>
    <dynamics damping="1.5" friction="0.5" D="7"/>
  </joint>
  <joint name="weld" type="fixed">
    <parent link="two"/>
    <child link="held"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/>
  </joint>
  <joint name="follower" type="revolute">
    <parent link="held"/>
    <child link="three"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="3" velocity="2"/>
    <mimic joint="slide" multiplier="-0.5" offset="0.25"/>
  </joint>
  <joint name="skew" type="revolute">
    <parent link="base"/>
    <child link="four"/>
    <axis xyz="1 1 1"/>
    <limit lower="-1" upper="1" effort="3" velocity="2"/>
  </joint>
  <transmission name="t"><joint name="turn"/></transmission>
</robot>
"""
PEERS = ("panda", "ur5", "solo12", "scara", "lr_mate", "features")
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'


@pytest.fixture(params=PEERS)
def pair(request, tmp_path):
    path = FILES / f"{request.param}.urdf"
    if request.param == "features":
        path = tmp_path / "features.urdf"
        path.write_text(FEATURES.replace('"inf"', '"1.5"'))  # which Pinocchio's reader takes for no number
    return load_robot(path), pinocchio.buildModelFromUrdf(str(path))


def small(tmp_path, type_and_more, child=INERTIAL):
    """Return a robot of one joint."""
    path = tmp_path / "small.urdf"
    path.write_text(
        f'<robot name="small" version="1.1"><link name="base"/><link name="arm">{child}</link>'
        f'<joint name="j" {type_and_more}<parent link="base"/><child link="arm"/></joint></robot>'
    )
    return path


def test_moving_joints_are_those_of_the_file(pair):
    robot, model = pair
    assert {joint.name for joint in robot.joints.values() if joint.moving} == set(model.names) - {"universe"}


def test_mass_center_and_inertia_of_bodies_with_what_is_fixed_to_them(pair):
    robot, model = pair
    moving = [joint for joint in robot.joints.values() if joint.moving]
    for k, joint in enumerate(moving):
        theirs = model.inertias[model.getJointId(joint.name)]
        rotation = robot.frames[joint.child].rotation  # to the body, whose z is the axis, from the link
        np.testing.assert_allclose(robot.tree.mass[k], theirs.mass, rtol=1e-15)
        np.testing.assert_allclose(robot.tree.center[k], rotation @ theirs.lever, rtol=0, atol=1e-15)
        turned = rotation @ theirs.inertia @ rotation.T
        np.testing.assert_allclose(robot.tree.inertia[k], turned, rtol=0, atol=1e-15)


def test_poses_of_all_links_and_of_the_bodies_of_the_tree(pair):
    robot, model = pair
    values, data, q = coordinates(robot, seed=4), model.createData(), pinocchio.neutral(model)
    for name, value in values.items():
        number = model.getJointId(name)
        first, size = model.idx_qs[number], model.nqs[number]
        q[first : first + size] = value if size == 1 else (np.cos(value), np.sin(value))
    pinocchio.framesForwardKinematics(model, data, q)
    ours, bodies = poses(robot, values), body_poses(robot, values)
    for link in robot.link_names:
        theirs = data.oMf[model.getFrameId(link, pinocchio.FrameType.BODY)].homogeneous
        np.testing.assert_allclose(ours[link], theirs, rtol=0, atol=1e-14)
        frame, here = robot.frames[link], np.eye(4)
        here[:3, :3], here[:3, 3] = frame.rotation, frame.position
        whole = here if frame.body < 0 else bodies[frame.body] @ here
        np.testing.assert_allclose(whole, theirs, rtol=0, atol=1e-14)


def test_limits_are_those_of_pinocchio(pair):
    robot, model = pair
    for joint in (joint for joint in robot.joints.values() if joint.moving):
        number = model.getJointId(joint.name)
        v, q, limits = model.idx_vs[number], model.idx_qs[number], joint.limits
        assert (limits.effort or 0) == model.upperEffortLimit[v]
        assert (limits.velocity or 0) == model.upperVelocityLimit[v]
        assert joint.damping == model.damping[v]
        assert joint.friction == model.upperDryFrictionLimit[v]
        if joint.type != "continuous":
            assert limits.lower == model.lowerPositionLimit[q]
            assert limits.upper == model.upperPositionLimit[q]


def test_order_of_the_coordinates_and_names():
    robot = load_robot(FILES / "panda.urdf")
    assert robot.joint_names == (*(f"panda_joint{k}" for k in range(1, 8)), "panda_finger_joint1")
    assert robot.joints["panda_finger_joint2"].mimic.joint == "panda_finger_joint1"
    assert robot.frames["panda_hand_tcp"].body == 6
    assert robot.name == "panda"
    assert robot.base == "panda_link0"


def test_limits_and_friction_as_the_file_gives_them(tmp_path):
    path = tmp_path / "features.urdf"
    path.write_text(FEATURES)
    robot = load_robot(str(path))
    assert robot.joint_names == ("turn", "slide", "skew")
    turn, slide, follower = (robot.joints[name] for name in ("turn", "slide", "follower"))
    assert turn.limits == type(turn.limits)()
    assert (slide.limits.lower, slide.limits.upper, slide.limits.velocity, slide.limits.effort) == (-1, None, 2, 30)
    assert (slide.damping, slide.friction, slide.armature) == (1.5, 0.5, 0.0)
    assert (follower.mimic.joint, follower.mimic.multiplier, follower.mimic.offset) == ("slide", -0.5, 0.25)
    np.testing.assert_allclose(slide.axis, [1 / 3, 2 / 3, -2 / 3], rtol=1e-15)
    np.testing.assert_array_equal(turn.axis, [1, 0, 0])


def test_roll_pitch_yaw_is_about_fixed_axes(tmp_path):
    path = tmp_path / "features.urdf"
    path.write_text(FEATURES)
    rotation = load_robot(path).joints["turn"].rotation
    np.testing.assert_allclose(rotation, Rotation.from_euler("xyz", [0.3, -0.2, 2.9]).as_matrix(), rtol=0, atol=1e-15)


def test_a_joint_may_have_no_limits(tmp_path):
    robot = load_robot(small(tmp_path, 'type="revolute">'))
    assert robot.limits == {"j": type(robot.limits["j"])()}


def test_a_floating_joint_becomes_slides_and_turns(tmp_path):
    robot = load_robot(small(tmp_path, 'type="floating"><origin xyz="1 2 3" rpy="0 0 0.5"/>'))
    assert robot.joint_names == ("j_x", "j_y", "j_z", "j_angle_1", "j_angle_2", "j_angle_3")
    assert robot.base == "base"
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    place = Rotation.from_euler("z", 0.5)
    found = poses(robot, dict(zip(robot.joint_names, q, strict=True)))["arm"]
    np.testing.assert_allclose(found[:3, 3], np.add([1, 2, 3], place.apply(q[:3])), rtol=0, atol=1e-15)
    turned = (place * Rotation.from_euler("ZYX", q[3:])).as_matrix()
    np.testing.assert_allclose(found[:3, :3], turned, rtol=0, atol=1e-15)


def test_a_planar_joint_becomes_two_slides_across_its_axis_and_a_turn(tmp_path):
    robot = load_robot(small(tmp_path, 'type="planar"><origin xyz="0 0 1"/><axis xyz="0 0 2"/>'))
    assert robot.joint_names == ("j_x", "j_y", "j_angle")
    found = poses(robot, {"j_x": 0.3, "j_y": -0.4, "j_angle": 0.7})["arm"]
    np.testing.assert_allclose(found[:3, 3], [0.3, -0.4, 1], rtol=0, atol=1e-16)
    np.testing.assert_allclose(found[:3, :3], Rotation.from_euler("z", 0.7).as_matrix(), rtol=0, atol=1e-15)


def test_a_planar_joint_of_any_axis_slides_across_it(tmp_path):
    robot = load_robot(small(tmp_path, 'type="planar"><axis xyz="1 2 2"/>'))
    axes = np.array([joint.axis for joint in robot.joints.values()])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-15)
    np.testing.assert_allclose(axes[2], [1 / 3, 2 / 3, 2 / 3], rtol=1e-15)


@pytest.mark.parametrize("kind", ["planar", "floating"])
@pytest.mark.parametrize("key", ["damping", "friction"])
def test_damping_and_friction_of_joints_of_several_coordinates_are_reported(tmp_path, kind, key):
    zero = small(tmp_path, f'type="{kind}"><dynamics damping="0" friction="0"/>')
    load_robot(zero, strict=True)
    path = small(tmp_path, f'type="{kind}"><dynamics {key}="0.5"/>')
    with pytest.warns(
        jn.errors.RobotWarning, match=rf"{key} of planar, floating and spherical joints: j \(line 1\); make"
    ):
        robot = load_robot(path)
    assert not any(joint.damping or joint.friction for joint in robot.joints.values())
    with pytest.raises(RobotFileError, match=rf"line 1, joints\.j\.dynamics\.{key}: .* without {key} of .*, got 0\.5"):
        load_robot(path, strict=True)


def test_an_inertial_of_zeros_is_a_frame():
    robot = load_robot(FILES / "panda.urdf")
    assert robot.links["panda_link8"].inertia is None
    assert robot.links["panda_hand_tcp"].inertia is None


def test_a_massless_link_between_joints_is_warned_of_unless_it_is_meant(tmp_path):
    path = tmp_path / "gimbal.urdf"
    path.write_text(
        f'<robot name="gimbal"><link name="base"/><link name="ring"/><link name="rotor">{INERTIAL}</link>\n'
        '<joint name="a" type="continuous"><parent link="base"/><child link="ring"/></joint>\n'
        '<joint name="b" type="continuous"><parent link="ring"/><child link="rotor"/></joint></robot>'
    )
    with pytest.warns(jn.errors.RobotWarning, match=r"have no mass: ring \(line 1\)"):
        robot = load_robot(path)
    np.testing.assert_array_equal(robot.tree.mass, [0.0, 1.0])
    assert load_robot(path, massless=True).joint_names == robot.joint_names
    with pytest.raises(RobotFileError, match=r"line 1, links\.ring: <inertial> .*massless=True"):
        load_robot(path, strict=True)


def test_a_robot_without_any_mass_needs_no_torque_and_moves(tmp_path):
    with pytest.warns(jn.errors.RobotWarning, match=r"neither have nor carry mass.*: arm \(line 1\)"):
        robot = load_robot(small(tmp_path, 'type="continuous">', child=""))
    assert robot.massless_joints == ("j",)
    np.testing.assert_array_equal(jn.inverse_dynamics(robot, np.ones((4, 1))), np.zeros((2, 1)))
    assert robot.with_floating_base().massless_joints[-1] == "j"


def six_digits(tensor):
    """Return a tensor as the attributes of <inertia>, of six significant digits."""
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    return " ".join(f'{name}="{tensor[at]:.6g}"' for name, at in names.items())


def inertial(tensor, mass=1.0):
    return f'<inertial><mass value="{mass}"/><inertia {six_digits(tensor)}/></inertial>'


@pytest.mark.parametrize("seed", range(20))
def test_rods_and_plates_of_six_digits_have_no_warning(tmp_path, seed):
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    for moments in ([0, 1, 1], [1, 2, 3], [1e-8, 2e-8, 3e-8]):
        robot = load_robot(small(tmp_path, 'type="revolute">', inertial(turn @ np.diag(moments) @ turn.T)))
        assert not robot.links["arm"].inertia.fault  # and a warning would be an error here


def test_impossible_moments_are_used_as_they_are_with_a_warning(tmp_path):
    path = small(tmp_path, 'type="continuous"><axis xyz="0 0 1"/>', inertial(np.diag([1.0, 1.0, 3.0])))
    with pytest.warns(jn.errors.RobotWarning, match=r"exceeds the sum of the others: arm \(line 1\)"):
        robot = load_robot(path)
    assert jn.inverse_dynamics(robot, [[0.0], [0.0], [2.0]]).tolist() == [[6.0]]
    assert robot.links["arm"].inertia.fault
    path = small(tmp_path, 'type="continuous"><axis xyz="0 0 1"/>', inertial(np.diag([1.0, 1.0, -2.0])))
    with pytest.warns(jn.errors.RobotWarning, match=r"negative: arm \(line 1\)"):
        robot = load_robot(path)
    with pytest.raises(jn.errors.MechanismError, match=r"bodies\.arm\.inertia: .*kinetic energy is negative"):
        jn.simulate(robot.mechanism(), [0.0, 0.1])


def test_a_quaternion_of_urdf_1_1_is_read(tmp_path):
    quaternion = [0.2, -0.4, 0.8, 0.4]
    text = " ".join(map(str, quaternion))
    path = small(tmp_path, f'type="revolute"><origin xyz="1 2 3" quat_xyzw="{text}"/>')
    rotation = load_robot(path).joints["j"].rotation
    np.testing.assert_allclose(rotation, Rotation.from_quat(quaternion).as_matrix(), rtol=0, atol=1e-15)
    moments = np.diag([1.0, 2.0, 2.5])
    child = inertial(moments).replace("<mass", f'<origin quat_xyzw="{text}"/><mass')
    tensor = load_robot(small(tmp_path, 'type="revolute">', child)).links["arm"].inertia.tensor
    np.testing.assert_allclose(tensor, rotation @ moments @ rotation.T, rtol=0, atol=1e-15)


def test_a_quaternion_of_urdf_1_1_that_is_not_of_length_one_is_named(tmp_path):
    path = small(tmp_path, 'type="revolute"><origin quat_xyzw="0 0 1.2 1.6"/>')
    with pytest.warns(jn.errors.RobotWarning, match=r"length 1, and are divided by .*: joints\.j\.origin \(line 1\)"):
        rotation = load_robot(path).joints["j"].rotation
    np.testing.assert_allclose(rotation, [[0.28, -0.96, 0], [0.96, 0.28, 0], [0, 0, 1]], rtol=0, atol=1e-15)


@pytest.mark.parametrize("origin", ['quat_xyzw="0 0 0 0"', 'quat_xyzw="0 0 1"', 'quat_xyzw="0 0 0 1" rpy="0 0 0"'])
def test_a_quaternion_that_is_none_or_stands_beside_angles(tmp_path, origin):
    with pytest.raises(RobotFileError, match=r"line 1, joints\.j\.origin: .*quat_xyzw"):
        load_robot(small(tmp_path, f'type="revolute"><origin {origin}/>'))


@pytest.mark.parametrize(
    "limit, expected",
    [
        ('acceleration="5" deceleration="7" jerk="100"', {"acceleration": 5.0, "deceleration": 7.0, "jerk": 100.0}),
        ('lower="0" upper="0" effort="0" velocity="0" acceleration="0" jerk="inf"', {}),
        ('upper="2"', {"lower": 0.0, "upper": 2.0}),
        ('lower="-2" upper="inf"', {"lower": -2.0}),
        ('lower="0.5" upper="0.5"', {"lower": 0.5, "upper": 0.5}),
    ],
)
def test_limits_of_urdf_1_2_and_zeros(tmp_path, limit, expected):
    assert load_robot(small(tmp_path, f'type="revolute"><limit {limit}/>')).limits["j"] == jn.Limits(**expected)


@pytest.mark.parametrize("key", ["acceleration", "deceleration", "jerk"])
@pytest.mark.parametrize("value", ["-1", "fast", "nan"])
def test_limits_of_urdf_1_2_that_are_none(tmp_path, key, value):
    with pytest.raises(RobotFileError, match=rf"line 1, joints\.j\.limit\.{key}"):
        load_robot(small(tmp_path, f'type="revolute"><limit {key}="{value}"/>'))


def chain(tmp_path, *mimics):
    """Return the file of a chain of joints a, b, c, ... that follow others."""
    names = "abcd"[: len(mimics)]
    links = "".join(f'<link name="{name}">{INERTIAL}</link>' for name in ("base", *names))
    joints = "".join(
        f'<joint name="j{name}" type="continuous"><parent link="{parent}"/><child link="{name}"/>{mimic}</joint>'
        for parent, name, mimic in zip(("base", *names), names, mimics, strict=False)
    )
    path = tmp_path / "chain.urdf"
    path.write_text(f'<robot name="chain">{links}{joints}</robot>')
    return path


def test_what_a_joint_does_not_say_is_said_by_the_format(tmp_path):
    robot = load_robot(chain(tmp_path, "<axis/>", '<mimic joint="ja"/>'))
    assert robot.joints["jb"].mimic == jn.robot.Mimic("ja", 1.0, 0.0)
    np.testing.assert_array_equal(robot.joints["ja"].axis, [1.0, 0.0, 0.0])


def test_a_joint_may_follow_one_that_follows_another(tmp_path):
    second = '<mimic joint="ja" multiplier="2" offset="0.5"/>'
    robot = load_robot(chain(tmp_path, "", second, '<mimic joint="jb" multiplier="-3" offset="1"/>'))
    assert robot.joint_names == ("ja",)
    assert robot.joints["jc"].mimic == jn.robot.Mimic("ja", -6.0, -0.5)


def test_joints_that_follow_in_a_circle_or_one_that_is_not_there(tmp_path):
    with pytest.raises(RobotFileError, match=r"joints\.ja\.mimic: must follow a moving joint"):
        load_robot(chain(tmp_path, '<mimic joint="jb"/>', '<mimic joint="ja"/>'))
    with pytest.warns(jn.errors.RobotWarning, match=r"taken as free: jb \(line 1\)"):
        robot = load_robot(chain(tmp_path, "", '<mimic joint="jx"/>'))
    assert robot.joint_names == ("ja", "jb")


@pytest.mark.parametrize(
    "left", ['<visual><geometry><mesh filename="$(find x)/a.stl"/></geometry></visual>', "<visual/><collision/>"]
)
def test_leftovers_of_xacro_that_bear_on_looks_and_plugins_do_not_matter(tmp_path, left):
    path = small(tmp_path, 'type="revolute">', child=INERTIAL + left)
    path.write_text(path.read_text().replace("</robot>", '<gazebo><plugin file="${x}"/></gazebo></robot>'))
    assert load_robot(path).joint_names == ("j",)


def test_a_base_can_be_set_free():
    robot = load_robot(FILES / "solo12.urdf", floating_base="XYZ")
    assert len(robot.joint_names) == 18
    assert (robot.base, robot.joint_names[0]) == ("world", "base_x")
    assert [list(robot.joints[f"base_angle_{k}"].axis) for k in (1, 2, 3)] == np.eye(3).tolist()
    assert robot.mass == pytest.approx(load_robot(FILES / "solo12.urdf").mass, rel=1e-15)


def test_a_frame_that_only_carries_the_base_is_left_out_of_a_floating_robot(tmp_path):
    path = tmp_path / "world.urdf"
    path.write_text(
        f'<robot name="r"><link name="world"/><link name="body">{INERTIAL}</link>'
        '<joint name="stand" type="fixed"><parent link="world"/><child link="body"/></joint></robot>'
    )
    robot = load_robot(path, floating_base=True)
    assert robot.joints["base_angle_3"].child == "body"
    assert robot.link_names.count("world") == 1


def test_no_floating_base_where_a_link_is_named_world_already(tmp_path):
    path = tmp_path / "world.urdf"
    path.write_text(f'<robot name="r"><link name="world">{INERTIAL}</link></robot>')
    with pytest.raises(RobotFileError, match=r"links\.world: .*floating base"):
        load_robot(path, floating_base=True)


@pytest.mark.parametrize(
    "limit, expected, message",
    [
        ('lower="-1" upper="1" effort="9" velocity="inf"', (-1.0, 1.0, None), None),
        ('lower="-1" upper="1" effort="9" velocity="-1"', (-1.0, 1.0, None), "below zero, .* read as none: j"),
        ('upper="-0.3" effort="9" velocity="2"', (None, -0.3, 2.0), "one end of a range, .* taken for none: j"),
        ('lower="0.3" effort="9" velocity="2"', (0.3, None, 2.0), "one end of a range"),
        ('upper="0.3" effort="9" velocity="2"', (0.0, 0.3, 2.0), None),
    ],
)
def test_limits_that_say_little_are_read(tmp_path, limit, expected, message):
    moving = f'type="revolute"><limit {limit}/>'
    with pytest.warns(jn.errors.RobotWarning, match=message) if message else contextlib.nullcontext():
        limits = load_robot(small(tmp_path, moving)).joints["j"].limits
    assert (limits.lower, limits.upper, limits.velocity) == expected


def test_a_range_with_both_ends_the_wrong_way_round_is_none_and_reported(tmp_path):
    path = small(tmp_path, 'type="revolute"><limit lower="0.3" upper="0" effort="9" velocity="2"/>')
    with pytest.raises(jn.errors.RobotFileError, match="lower limit must not exceed"):
        load_robot(path, strict=True)
    with pytest.warns(jn.errors.RobotWarning, match="lower limits exceed upper ones, and are read as no range: j"):
        assert load_robot(path).limits["j"].lower is None
