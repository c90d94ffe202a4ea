"""Solids are closed, face outward and have the volume of what they are; bodies and robots are made of them."""

import math

import numpy as np
import pytest

import jounce as jn
from jounce.viewer.server import robot_subject
from jounce.viewer.shapes import meshes
from jounce.viewer.shapes.mechanism_appearance import mechanism_appearance
from jounce.viewer.shapes.robot_appearance import robot_appearance
from jounce.viewer.shapes.robot_shapes import file_shapes
from jounce.viewer.subjects.closed_loops import independent
from jounce.viewer.subjects.robots import swing_of

CIRCLE = 24 / 2 * math.sin(2 * math.pi / 24)  # area of the polygon that stands for a circle of radius one
WHEEL = 96 / 2 * math.sin(2 * math.pi / 96)
TRIANGLE = meshes.Polygon([[0, 0], [2, 0], [0, 2]])


@pytest.mark.parametrize(
    "mesh, expected",
    [
        (meshes.box([1, 2, 3], [5, 5, 5]), 6.0),
        (meshes.cylinder(2.0, 3.0, [1, 1, 0], [0, 0, 4]), 12 * CIRCLE),
        (meshes.sleeve(1.0, 2.0, 3.0, [1, 1, 0], [0, 0, 4]), 9 * CIRCLE),
        (meshes.extruded(TRIANGLE, -1.0, 1.0), 4.0),
        (meshes.extruded(TRIANGLE, -1.0, 1.0, sharp=False), 4.0),
        (meshes.plate(np.array([[0.0, 0], [4, 0]]), 1.0, 0.0, 1.0), CIRCLE + 8),
        (meshes.wheel(2.0, 0.0, 1.0, [3, 0]), 4 * WHEEL),
        (meshes.wheel(2.0, 0.0, 2.0, [3, 0], outside=3.0), 10 * WHEEL),
    ],
)
def test_volumes(mesh, expected):
    assert mesh.volume == pytest.approx(expected, rel=1e-9)  # positive: the faces face outward


def test_round_meshes_come_near_to_what_they_stand_for():
    assert meshes.sphere(2.0, [1, 2, 3]).volume == pytest.approx(32 / 3 * math.pi, rel=0.03)
    bar = meshes.capsule([0, 0, 0], [0, 3, 4], 0.5)
    assert bar.volume == pytest.approx(math.pi * (0.25 * 5 + 0.5 / 3), rel=0.03)
    assert bar.center_mass == pytest.approx([0, 1.5, 2])
    assert meshes.wheel(2.0, 0.0, 1.0, [0, 0], module=0.2).volume == pytest.approx(4 * math.pi, rel=0.06)
    turns = 2 * math.pi * 0.1 * 6 * 0.8 / 0.8
    assert meshes.coil(6, 0.1, 0.02).volume == pytest.approx(math.pi * 0.02**2 * turns, rel=0.15)
    assert meshes.arc_arrow().volume > math.pi * 0.08**2 * 1.4 * math.pi


def test_edges_are_sharp_where_they_are():
    for mesh in (meshes.cylinder(1.0, 2.0), meshes.plate(np.array([[0.0, 0], [4, 0]]), 1.0, 0.0, 1.0)):
        upright = np.abs(mesh.vertex_normals[:, 2])
        assert ((upright < 1e-6) | (upright > 1 - 1e-6)).all()  # of a cap or of a wall, never between them
    assert len(meshes.box([1, 2, 3]).vertices) == 36


SLOW = [pytest.param(file, marks=pytest.mark.slow) for file in ("rsur", "scotch_yoke", "screw_press")]


@pytest.mark.parametrize("file", ["four_bar", "epicyclic", *SLOW])
def test_every_body_of_an_example_can_be_seen(file):
    mechanism = jn.load(f"examples/{file}.yaml")
    appearance = mechanism_appearance(jn.solve(mechanism, np.array([0.0, 0.01]), order=0))
    rods = {body for connector in appearance.connectors for body in connector.bodies}
    for body in mechanism.bodies:
        assert appearance.meshes[body] or body in rods
        assert all(np.isfinite(each.mesh.vertices).all() and len(each.mesh.faces) for each in appearance.meshes[body])
    assert {point.body for point in appearance.points} >= set(mechanism.bodies) - rods


def test_planar_bodies_lie_in_layers_of_their_own():
    appearance = mechanism_appearance(jn.solve(jn.load("examples/four_bar.yaml"), [0.0], order=0))
    plates = [appearance.meshes[body][0].mesh.vertices[:, 2] for body in ("crank", "rocker")]
    assert plates[0].max() < plates[1].min() < appearance.front


@pytest.mark.slow
def test_joints_swing_within_their_limits():
    robot = jn.load_robot("examples/robots/panda.urdf")
    subject = robot_subject(robot)
    recording = subject.solve({p.name: p.value for p in subject.parameters}, 2)
    for name in robot.joint_names:
        low, high, _, _ = swing_of(robot.joints[name], robot.limits[name])
        values = recording.outputs[name].values[:, 0]
        assert low <= values.min() < values.max() <= high
        limit = robot.limits[name].velocity
        assert limit is None or np.abs(recording.outputs[name].values[:, 1]).max() <= limit * (1 + 1e-9)
    point = recording.appearance.points[0]
    q = np.stack([recording.outputs[name].values[7, :, 0] for name in robot.joint_names], axis=-1)
    expected = jn.forward_kinematics(robot, q, point.name)
    np.testing.assert_allclose(recording.motion(point)[7], expected.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        recording.global_point(point.body, point.point)[7], expected.position[0], rtol=0, atol=1e-12
    )
    drives = {e.name: e for e in recording.loads if e.kind == "driver"}
    torque = np.linalg.norm(drives["panda_joint2"].torque, axis=1)
    np.testing.assert_allclose(torque, np.abs(jn.inverse_dynamics(robot, _coordinates(recording, robot))[:, 0, 1]))


def test_a_followed_joint_swings_within_the_range_of_its_followers():
    wide, narrow = jn.Limits(lower=-1.0, upper=1.0), jn.Limits(lower=0.0, upper=0.2)
    joints = [jn.Joint("a", "base", "left", "revolute", limits=wide)]
    joints.append(jn.Joint("b", "base", "right", "revolute", limits=narrow, mimic=jn.robot.Mimic("a", -2.0)))
    links = [jn.Link(name) for name in ("base", "left", "right")]
    subject = robot_subject(jn.Robot("gripper", links, joints, strict=False))
    follower = -2.0 * subject.solve({p.name: p.value for p in subject.parameters}, 0).outputs["a"].values[:, 0]
    assert 0.0 <= follower.min() < follower.max() <= 0.2


def _coordinates(recording, robot):
    return np.stack([recording.outputs[name].values[..., 0] for name in robot.joint_names], axis=-1)


def test_a_trajectory_moves_a_robot_and_must_fit_it():
    robot = jn.load_robot("examples/robots/scara.urdf")
    law = jn.JointTrajectory({"shoulder": "0.3*t"}, 0.0, 1.0)
    subject = robot_subject(robot, law)
    assert subject.parameters == ()
    recording = subject.solve({}, 1)
    np.testing.assert_allclose(recording.outputs["shoulder"].values[:, 0, 0], 0.3 * recording.time, atol=1e-14)
    assert not recording.outputs["elbow"].values.any()
    with pytest.raises(jn.errors.RobotError, match="did you mean 'elbow'"):
        robot_subject(robot, jn.JointTrajectory({"elbo": "t"}, 0.0, 1.0))


@pytest.mark.slow
def test_a_robot_with_closed_loops_moves_as_one():
    robot = jn.load_robot("examples/robots/five_bar.xml")
    assert independent(robot) == ("left_motor", "right_motor")
    subject = robot_subject(robot)
    recording = subject.solve({p.name: p.value for p in subject.parameters}, 2)
    assert not recording.notice
    (closure,) = robot.closures.values()
    ends = [recording.global_point(link, point) for link, point in zip(closure.links, closure.points, strict=True)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-9)
    assert np.ptp(ends[0], axis=0).max() > 0.01
    assert {load.kind for load in recording.loads} >= {"reaction", "driver"}


URDF = """<robot name="two">
  <material name="red"><color rgba="1 0 0 0.5"/></material>
  <link name="base"><visual><geometry><box size="1 2 3"/></geometry><material name="red"/></visual></link>
  <link name="arm"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="hand">
    <visual><origin xyz="0 0 1" rpy="0 1.5707963267948966 0"/>
      <geometry><mesh filename="package://pack/wedge.obj" scale="2 2 2"/></geometry></visual>
    <visual><geometry><mesh filename="package://pack/missing.stl"/></geometry></visual>
  </link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="grip" type="fixed"><parent link="arm"/><child link="hand"/><origin xyz="5 0 0"/></joint>
</robot>"""


def test_shapes_of_a_urdf_are_read_with_places_colors_and_scales(tmp_path):
    (tmp_path / "pack").mkdir()
    (tmp_path / "pack" / "wedge.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    path = tmp_path / "pack" / "two.urdf"
    path.write_text(URDF)
    shapes = file_shapes(path)
    (block,), (wedge,) = shapes["base"], shapes["hand"]
    assert block.color == (255, 0, 0)
    assert block.opacity == 0.5
    assert np.ptp(block.mesh.vertices, axis=0).tolist() == [1, 2, 3]
    assert wedge.mesh.volume == pytest.approx(8 / 6)
    assert wedge.mesh.vertices.min(axis=0) == pytest.approx([0, 0, -1])  # x turned to -z, then lifted by one
    appearance = robot_appearance(jn.load_robot(path), path)
    assert appearance.meshes["arm"][0].mesh.vertices.min(axis=0) == pytest.approx(
        [5, 0, -1]
    )  # the hand is part of the arm


def test_a_link_whose_shape_cannot_be_read_is_a_bar(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(URDF.replace('xyz="0 0 1" rpy', 'xyz="0 zero 1" rpy'))
    assert not file_shapes(path)["hand"]
    appearance = robot_appearance(jn.load_robot(path), path)
    assert np.ptp(appearance.meshes["base"][0].mesh.vertices, axis=0).tolist() == [1, 2, 3]  # from the file
    assert appearance.meshes["arm"]


def test_shapes_of_an_mjcf_are_read(tmp_path):
    path = tmp_path / "one.xml"
    path.write_text("""<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="arm" pos="1 0 0">
      <joint name="turn" axis="0 0 1"/><geom type="capsule" size="0.1" fromto="0 0 0 1 0 0" rgba="0 0 1 1"/>
      <geom type="box" size="0.1 0.2 0.3" pos="0 0 2" group="3"/></body></worldbody></mujoco>""")
    (capsule,) = file_shapes(path)["arm"]
    assert capsule.color == (0, 0, 255)
    assert np.ptp(capsule.mesh.vertices, axis=0) == pytest.approx([1.2, 0.2, 0.2], rel=1e-6)
    recording = robot_subject(jn.load_robot(path), path=path).solve(
        {"turn swing": 0.2, "turn middle": 0.0, "period": 1.0}, 1
    )
    assert recording.appearance.meshes["arm"]
    assert recording.position[0, 1] == pytest.approx([1, 0, 0])


SDF = """<sdf version="1.9"><model name="m"><pose>0 0 1 0 0 0</pose>
  <link name="base"><pose>1 0 0 0 0 0</pose>
    <inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
    <visual name="v"><pose relative_to="lamp">0 0 1 0 0 0</pose><transparency>0.25</transparency>
      <geometry><box><size>1 2 3</size></box></geometry>
      <material><ambient>0 0 1 1</ambient><diffuse>1 0 0 1</diffuse></material></visual>
    <visual name="floor"><geometry><plane><normal>0 0 1</normal></plane></geometry></visual>
    <visual name="broken"><geometry><sphere><radius>wide</radius></sphere></geometry></visual></link>
  <link name="arm"><pose relative_to="base">0 2 0 0 0 0</pose>
    <inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
    <visual name="a"><geometry><mesh><uri>model://pack/wedge.obj</uri><scale>2 2 2</scale></mesh></geometry></visual>
    <visual name="b"><geometry><cylinder><radius>0.5</radius><length>4</length></cylinder></geometry>
      <material><ambient>0 1 0 1</ambient></material></visual>
    <visual name="c"><geometry><ellipsoid><radii>1 2 3</radii></ellipsoid></geometry></visual>
    <visual name="d"><geometry><polyline><point>0 0</point><point>2 0</point><point>0 1</point><height>3</height>
      </polyline></geometry></visual>
    <visual name="e"><geometry><capsule><radius>0.5</radius><length>2</length></capsule></geometry></visual></link>
  <frame name="lamp" attached_to="arm"><pose>0 0 5 0 0 0</pose></frame>
  <joint name="turn" type="revolute"><parent>base</parent><child>arm</child><axis><xyz>0 0 1</xyz></axis></joint>
</model></sdf>"""


def test_shapes_of_an_sdf_are_read_with_places_colors_and_scales(tmp_path):
    (tmp_path / "pack").mkdir()
    (tmp_path / "pack" / "wedge.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    path = tmp_path / "pack" / "two.sdf"
    path.write_text(SDF)
    shapes = file_shapes(path)
    (block,) = shapes["base"]
    assert (block.color, block.opacity) == ((255, 0, 0), 0.75)
    assert block.mesh.bounds == pytest.approx(np.array([[-0.5, 1, 4.5], [0.5, 3, 7.5]]))  # beside the base, at the lamp
    wedge, cylinder, ellipsoid, prism, capsule = (shape.mesh for shape in shapes["arm"])
    assert wedge.volume == pytest.approx(8 / 6)
    assert shapes["arm"][1].color == (0, 255, 0)
    assert np.ptp(cylinder.vertices, axis=0) == pytest.approx([1, 1, 4], rel=1e-6)
    assert np.ptp(ellipsoid.vertices, axis=0) == pytest.approx([2, 4, 6], rel=0.02)
    assert prism.volume == pytest.approx(3.0)
    assert np.ptp(capsule.vertices, axis=0) == pytest.approx([1, 1, 3], rel=1e-6)
    appearance = robot_appearance(jn.load_robot(path), path)
    assert len(appearance.meshes["arm"]) == 5
