"""Worlds of several models, nested and included ones: each is where SDF places it, and one is chosen by its name."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn

BODY = "<inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass>"
BODY += "<inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.2</izz></inertia></inertial>"


def link(name, pose="", more=""):
    return f'<link name="{name}">{f"<pose>{pose}</pose>" if pose else ""}{BODY}{more}</link>'


def joint(name, parent, child, axis="0 1 0", kind="revolute", more=""):
    inside = "" if kind == "fixed" else f"<axis><xyz>{axis}</xyz>{more}</axis>"
    return f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>{inside}</joint>'


def arm(name="arm", pose="0 0 0 0 0 0", attributes="", axis="0 1 0"):
    parts = link("base") + link("rod", "0.5 0 0.2 0.1 0.2 0.3") + joint("j", "base", "rod", axis)
    return f'<model name="{name}"{attributes}><pose>{pose}</pose>{parts}</model>'


STILL = f'<model name="table"><static>true</static>{link("top")}</model>'


def read(tmp_path, inside, version="1.9", name="robot.sdf", **options):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(f'<?xml version="1.0"?>\n<sdf version="{version}">{inside}</sdf>')
    return jn.load_robot(path, **options)


def world(*parts):
    return f'<world name="w">{"".join(parts)}</world>'


def test_the_one_model_that_moves_is_taken(tmp_path):
    robot = read(tmp_path, world(STILL, arm(pose="1 2 3 0 0 0"), f'<model name="box">{link("cube")}</model>'))
    assert (robot.name, robot.joint_names) == ("arm", ("j",))
    q = np.array([[0.3], [0.1], [0.2]])
    np.testing.assert_allclose(
        jn.inverse_dynamics(robot, q), jn.inverse_dynamics(read(tmp_path, arm()), q), rtol=0, atol=1e-14
    )


def test_of_several_one_is_named(tmp_path):
    several = world(arm("left"), arm("right", axis="1 0 0"))
    with pytest.raises(
        jn.errors.RobotFileError, match=r"holds 2 models that move, got .*; choose one with model=NAME"
    ) as caught:
        read(tmp_path, several)
    assert (caught.value.line, caught.value.value) == (2, ["left", "right"])
    np.testing.assert_allclose(read(tmp_path, several, model="right").joints["j"].axis, [1, 0, 0], atol=1e-15)
    with pytest.raises(jn.errors.RobotFileError, match=r"no model has this name.*did you mean .right."):
        read(tmp_path, several, model="rigth")
    with pytest.raises(jn.errors.RobotFileError, match="two models of one world have this name, the first in line 2"):
        read(tmp_path, world(arm("left"), arm("left")))


@pytest.mark.parametrize("placement", ["", ' placement_frame="rod"'])
@pytest.mark.parametrize("version", ["1.4", "1.9"])
def test_a_nested_model_is_where_it_is_placed(tmp_path, version, placement):
    pose = [0.3, -0.2, 0.5, 0.4, -0.3, 0.2]
    nested = arm("inner", " ".join(map(str, pose)), placement)
    whole = read(
        tmp_path,
        f'<model name="outer">{link("root")}{nested}{joint("mount", "root", "inner::base", kind="fixed")}</model>',
        version=version,
    )
    assert whole.joint_names == ("inner::j",)
    turn, at = Rotation.from_euler("xyz", pose[3:]), np.array(pose[:3])
    own_turn, own_at = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]), np.array([0.5, 0, 0.2])
    if placement:  # the pose is that of the rod
        turn, at = turn * own_turn.inv(), at - (turn * own_turn.inv()).apply(own_at)
    frame = whole.frames["inner::base"]
    np.testing.assert_allclose(frame.position, at, atol=1e-12)
    np.testing.assert_allclose(frame.rotation, turn.as_matrix(), atol=1e-12)
    moved = jn.forward_kinematics(whole, np.zeros((1, 1)), "inner::rod")
    np.testing.assert_allclose(moved.position[0], at + turn.apply(own_at), atol=1e-12)
    along = [0, 1, 0] if version == "1.4" else own_turn.apply([0, 1, 0])  # of old, in the axes of the model
    axis = moved.rotation[0] @ whole.joints["inner::j"].axis
    np.testing.assert_allclose(axis, turn.apply(along), atol=1e-12)


def test_included_models_are_read_where_they_lie(tmp_path):
    read(tmp_path, arm(), name="part/model.sdf")
    include = "<include><uri>model://part</uri><name>second</name><pose>1 0 0 0 0 0</pose></include>"
    whole = read(tmp_path, f'<model name="outer">{link("root")}{include}{joint("m", "root", "second::base")}</model>')
    assert whole.joint_names == ("m", "second::j")
    np.testing.assert_allclose(whole.frames["second::base"].body, 0)
    assert read(tmp_path, world(STILL, include)).name == "second"


def test_a_merged_model_keeps_its_names(tmp_path):
    read(tmp_path, arm(), name="part/model.sdf")
    include = '<include merge="true"><uri>part</uri><pose>1 0 0 0 0 0</pose></include>'
    whole = read(tmp_path, f'<model name="outer">{link("root")}{include}{joint("m", "root", "base")}</model>')
    assert whole.joint_names == ("m", "j")
    np.testing.assert_allclose(
        jn.forward_kinematics(whole, np.zeros((1, 2)), "base").position[0], [1, 0, 0], atol=1e-12
    )


def test_what_is_included_and_not_there_is_reported(tmp_path):
    with pytest.warns(
        jn.errors.RobotWarning, match=r"models that the world includes and that are not there: model://sun"
    ):
        read(tmp_path, world("<include><uri>model://sun</uri></include>", arm()))
    with pytest.raises(jn.errors.RobotFileError, match=r"there is no such model, got .*; put it beside the file"):
        read(tmp_path, f'<model name="outer">{link("root")}<include><uri>model://arm</uri></include></model>')


def test_models_that_include_one_another_are_refused(tmp_path):
    circle = f'<model name="again">{link("a")}<include><uri>robot.sdf</uri><name>in</name></include></model>'
    with pytest.raises(jn.errors.RobotFileError, match="include one another without end"):
        read(tmp_path, circle)


def test_joints_of_a_world_join_models(tmp_path):
    joined = joint("hinge", "table::top", "arm::base", axis="0 0 1")
    robot = read(tmp_path, world(STILL, arm(pose="0 0 1 0 0 0"), joined))
    assert robot.joint_names == ("hinge", "arm::j")
    assert robot.base == "world"
    with pytest.raises(jn.errors.RobotFileError, match="no model of this world has this name"):
        read(tmp_path, world(arm(), joint("hinge", "tabel::top", "arm::base")))


def test_models_that_joints_of_a_world_connect_are_one_robot(tmp_path):
    """None has to be chosen; a model that is not connected counts only if it moves, too."""
    box, hinge = f'<model name="box">{link("cube")}</model>', joint("hinge", "a", "b")
    bodies = [f'<model name="{name}">{link("body")}</model>' for name in "ab"]
    robot = read(tmp_path, world(box, *bodies, hinge))
    assert (robot.name, robot.joint_names, robot.base) == ("a", ("hinge",), "a::body")
    assert set(robot.links) == {"a::body", "b::body"}
    assert read(tmp_path, world(arm("a"), arm("b"), hinge)).joint_names == ("a::j", "hinge", "b::j")
    with pytest.raises(jn.errors.RobotFileError, match="holds 3 models that move"):
        read(tmp_path, world(arm("a"), arm("b"), arm("c"), hinge))


@pytest.mark.parametrize("attached", ["", ' attached_to="world"', ' attached_to="base::body"'])
def test_joints_of_a_world_are_at_its_frames(tmp_path, attached):
    """The child turns about the y axis of the frame: F R_y(q) F^-1 times its pose, seen from the parent."""
    poses = {"base": "0.3 0 0.1 0.2 0 0", "f": "1 -0.5 0.2 0.4 -0.3 0.2", "arm": "0.5 0 0.2 0.1 0.2 0.3"}
    base, frame, body = (matrix(pose) for pose in poses.values())
    parts = [f'<model name="{name}"><pose>{poses[name]}</pose>{link("body")}</model>' for name in ("base", "arm")]
    parts.append(f'<frame name="f"{attached}><pose>{poses["f"]}</pose></frame>')
    axis = '<axis><xyz expressed_in="f">0 1 0</xyz></axis>'
    ends = "<parent>f</parent><child>arm::body</child>"
    parts.append(f'<joint name="hinge" type="revolute"><pose relative_to="f"/>{ends}{axis}</joint>')
    robot = read(tmp_path, world(*parts), model="arm")
    at_base = attached.endswith('body"')
    frame, root = (base @ frame, base) if at_base else (frame, np.eye(4))
    assert (robot.base, robot.joint_names) == ("base::body" if at_base else "world", ("hinge",))
    motion = jn.forward_kinematics(robot, [[0.7]], "arm::body")
    turned = np.linalg.inv(root) @ frame @ matrix("0 0 0 0 0.7 0") @ np.linalg.inv(frame) @ body
    np.testing.assert_allclose(motion.position[0], turned[:3, 3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion.rotation[0], turned[:3, :3], rtol=0, atol=1e-14)


@pytest.mark.parametrize("reference", ["far", "far::body"])
def test_joined_models_may_be_placed_by_one_that_is_not_joined(tmp_path, reference):
    far, near = "1 -0.5 0.2 0.4 -0.3 0.2", "0.5 0 0.2 0.1 0.2 0.3"
    models = [f'<model name="far"><pose>{far}</pose>{link("body")}</model>', f'<model name="a">{link("body")}</model>']
    models.append(f'<model name="b"><pose relative_to="{reference}">{near}</pose>{link("body")}</model>')
    robot = read(tmp_path, world(*models, joint("hinge", "a", "b")))
    assert robot.links.keys() == {"a::body", "b::body"}
    motion = jn.forward_kinematics(robot, [[0.0]], "b::body")
    expected = matrix(far) @ matrix(near)
    np.testing.assert_allclose(motion.position[0], expected[:3, 3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion.rotation[0], expected[:3, :3], rtol=0, atol=1e-14)
    with pytest.raises(jn.errors.RobotFileError, match="no link, joint or frame has this name, got 'else'"):
        read(tmp_path, world(*models, joint("hinge", "a", "b")).replace(f'to="{reference}"', 'to="else"'))


@pytest.mark.parametrize("placed", ["a frame of the world", "a nested frame"])
def test_a_static_model_may_consist_of_frames(tmp_path, placed):
    far, tip, near = "1 -0.5 0.2 0.4 -0.3 0.2", "0 0.3 0.1 0.2 0 0.5", "0.5 0 0.2 0.1 0.2 0.3"
    marks = f'<model name="marks"><static>true</static><pose>{far}</pose><frame name="tip"><pose>{tip}</pose></frame>'
    pose, inner = f'<pose relative_to="marks::tip">{near}</pose>', link("body") + joint("hinge", "world", "body")
    if placed == "a nested frame":
        inner = inner.replace('<link name="body">', f'<link name="body">{pose}')
        text = world(f'<model name="arm">{marks}</model>{inner}</model>')
    else:
        text = world(f"{marks}</model>", f'<model name="arm">{pose}{inner}</model>')
    motion = jn.forward_kinematics(read(tmp_path, text), [[0.0]], "body")
    expected = matrix(far) @ matrix(tip) @ matrix(near)
    np.testing.assert_allclose(motion.position[0], expected[:3, 3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion.rotation[0], expected[:3, :3], rtol=0, atol=1e-14)


def matrix(pose):
    numbers = [float(x) for x in pose.split()]
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = Rotation.from_euler("xyz", numbers[3:]).as_matrix(), numbers[:3]
    return found


def test_a_joint_does_not_move_the_world(tmp_path):
    fixed = '<frame name="f"/>' + joint("hinge", "arm::base", "f")
    with pytest.raises(jn.errors.RobotFileError, match=r"no link, joint or frame has this name, got 'world'"):
        read(tmp_path, world(arm(), fixed))


def test_links_out_of_gravity_weigh_nothing(tmp_path):
    parts = link("base") + link("rod", "0.5 0 0 0 0 0", "<gravity>false</gravity>") + link("tip", "1 0 0 0 0 0")
    parts += joint("w", "world", "base", kind="fixed") + joint("j", "base", "rod") + joint("k", "rod", "tip")
    robot = read(tmp_path, f'<model name="m">{parts}</model>')
    torque = np.asarray(jn.inverse_dynamics(robot, np.zeros((3, 2))))[0]
    np.testing.assert_allclose(torque, [-2 * 9.81 * 0.6, -2 * 9.81 * 0.1], rtol=1e-13)  # of the tip alone


def test_springs_of_joints(tmp_path):
    spring = "<dynamics><spring_stiffness>30</spring_stiffness><spring_reference>0.2</spring_reference></dynamics>"
    parts = link("base") + link("rod") + joint("j", "base", "rod", axis="0 0 1", more=spring)
    robot = read(tmp_path, f'<model name="m">{parts}</model>')
    torque = np.asarray(jn.inverse_dynamics(robot, np.array([[0.5], [0.0], [0.0]])))
    np.testing.assert_allclose(torque, [[30 * 0.3]], rtol=1e-13)
