"""Robots from SDF files: the same ones built without a file, in every dialect; loops, gearboxes; Cassie."""

import re
import warnings
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

import jounce as jn
from jounce.errors import RobotFileError, RobotWarning
from tests.problems.closed_robots import in_contact, in_pinocchio
from tests.problems.published_robots import sdf_files
from tests.problems.robots import coordinates, poses, random_robot
from tests.problems.sdf_files import NOTHING, sdf

DIALECTS = ("1.4", "1.6", "1.7", "1.11")
CASSIE = sdf_files()["cassie_description/robots/cassie_v2.sdf"]
SOME = "<inertial><mass>2</mass><inertia><ixx>.1</ixx><iyy>.2</iyy><izz>.25</izz></inertia></inertial>"


def read(tmp_path, text, **settings):
    (tmp_path / "robot.sdf").write_text(text)
    return jn.load_robot(tmp_path / "robot.sdf", **settings)


def model(*parts, version="1.9", attributes=""):
    return f'<sdf version="{version}"><model name="m" {attributes}>{"".join(parts)}</model></sdf>'


def link(name, pose="0 0 0 0 0 0", body=SOME):
    return f'<link name="{name}"><pose>{pose}</pose>{body}</link>'


def joint(name, parent, child, kind="revolute", inside="<axis><xyz>0 0 1</xyz></axis>"):
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def same(robot, expected, gravity, seed=1):
    """Check that a robot has the poses and the torques, with two rates, of the one expected."""
    q = coordinates(expected, seed)
    here, there = poses(robot, q), poses(expected, q)
    for name in expected.links:
        np.testing.assert_allclose(here[name], there[name], rtol=0, atol=1e-13)
    np.testing.assert_allclose(robot.gravity, gravity, rtol=0, atol=1e-14)
    states = np.random.default_rng(seed).normal(size=(5, len(expected.joint_names)))
    by_name = [robot.joint_names.index(name) for name in expected.joint_names]
    states_here = np.empty_like(states)
    states_here[:, by_name] = states
    same_gravity = jn.Robot("e", list(expected.links.values()), list(expected.joints.values()), gravity, strict=False)
    torque = jn.robot.inverse_dynamics(robot, states_here)[:, by_name]
    exact = jn.robot.inverse_dynamics(same_gravity, states)
    np.testing.assert_allclose(torque, exact, rtol=0, atol=1e-11 * np.abs(exact).max())
    for name in expected.joint_names:
        assert robot.joints[name].damping == expected.joints[name].damping
        assert robot.joints[name].friction == expected.joints[name].friction
        assert robot.limits[name] == expected.limits[name]


def without_armature(robot):
    joints = [jn.Joint(**{**vars(joint), "armature": 0.0}) for joint in robot.joints.values()]
    return jn.Robot(robot.name, list(robot.links.values()), joints, strict=False)


@pytest.mark.parametrize("version", DIALECTS)
@pytest.mark.parametrize("seed", [1, 2])
def test_random_trees_are_those_built_without_a_file(tmp_path, version, seed):
    expected = without_armature(random_robot(seed, 6))
    form = ("euler_rpy", "quat_xyzw", "degrees")[seed % 3] if version == "1.11" else "euler_rpy"
    text, place = sdf(expected, version, seed, form)
    robot = read(tmp_path, text)
    assert robot.base == expected.base
    base = ElementTree.fromstring(text).find("model/link/pose").text.split()
    turn = place[:3, :3] @ turned(base, form)
    same(robot, expected, turn.T @ [0, 0, -9.81])


def turned(words, form):
    if form == "quat_xyzw":
        return Rotation.from_quat([float(word) for word in words[3:]]).as_matrix()
    return Rotation.from_euler("xyz", [float(word) for word in words[3:]], degrees=form == "degrees").as_matrix()


def test_a_quaternion_that_is_not_of_length_one_is_named(tmp_path):
    def arm(scale):
        words = " ".join(f"{scale * x:.2f}" for x in (0.48, 0.6, 0.0, 0.64))
        posed = f'<pose rotation_format="quat_xyzw">0 0 1 {words}</pose>'
        inside = SOME.replace("<mass>", f"{posed}<mass>")
        return model(link("a"), f'<link name="b">{posed}{inside}</link>', joint("j", "a", "b"))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        expected = read(tmp_path, arm(1.0))
        read(tmp_path, arm(0.995))  # what rounding makes of one
    note = r"do not have the length 1, and are divided by .*: links\.b\.inertial\.pose \(line 1\), b\.pose \(line 1\)"
    with pytest.warns(RobotWarning, match=note):
        same(read(tmp_path, arm(2.0)), expected, expected.gravity)
    with pytest.raises(
        RobotFileError, match=r"line 1, .*the quaternion has the length 2, not 1.*got \[0\.96, 1\.2, 0\.0, 1\.28\]"
    ):
        read(tmp_path, arm(2.0), strict=True)


def test_joints_away_from_the_base_or_toward_it(tmp_path):
    expected = without_armature(random_robot(4, 5, fixed=0.0))
    text, place = sdf(expected, "1.7", 4, turned=("joint_0", "joint_2", "joint_3"))
    robot = read(tmp_path, text)
    base = ElementTree.fromstring(text).find("model/link/pose").text.split()
    same(robot, expected, (place[:3, :3] @ turned(base, "euler_rpy")).T @ [0, 0, -9.81])


def test_the_world_holds_a_model(tmp_path):
    text = model(
        "<pose>1 2 3 0.5 0 0</pose>", link("arm", "0.1 0 0 0 0 0.3"), joint("pin", "world", "arm"), version="1.7"
    )
    robot = read(tmp_path, text)
    assert robot.base == "world"
    np.testing.assert_array_equal(robot.gravity, [0, 0, -9.81])
    expected = Rotation.from_euler("x", 0.5).as_matrix()
    here = poses(robot, {"pin": 0.0})["arm"]
    np.testing.assert_allclose(here[:3, 3], [1, 2, 3] + expected @ [0.1, 0, 0], rtol=0, atol=1e-15)
    turn = Rotation.from_euler("x", 0.5) * Rotation.from_euler("z", 0.3 + 0.7)
    np.testing.assert_allclose(poses(robot, {"pin": 0.7})["arm"][:3, :3], turn.as_matrix(), rtol=0, atol=1e-15)


def pendulum(inside=""):
    """Return a link of 2 kg on a horizontal hinge, its center 0.5 m beside it."""
    body = SOME.replace("<inertial>", "<inertial><pose>0.5 0 0 0 0 0</pose>") + inside
    hinge = joint("j", "a", "b", inside="<axis><xyz>0 1 0</xyz></axis>")
    return link("a", body=body) + link("b", body=body) + hinge


def torque_at_rest(robot):
    """Return the torque that holds the pendulum where it is, N m."""
    return float(jn.inverse_dynamics(robot, np.zeros((3, 1)))[0, 0])


@pytest.mark.parametrize("version, holder", [("1.9", "{}"), ("1.4", "<physics type='ode'>{}</physics>")])
def test_the_gravity_of_the_world_in_the_file(tmp_path, version, holder):
    moon = holder.format("<gravity>0 0 -1.62</gravity>")
    inside = f"<model name='m'><pose>0 0 1 0.5 0 0</pose>{pendulum()}</model>"
    robot = read(tmp_path, f'<sdf version="{version}"><world name="w">{moon}{inside}</world></sdf>')
    np.testing.assert_allclose(robot.gravity, [0, -1.62 * np.sin(0.5), -1.62 * np.cos(0.5)], rtol=0, atol=1e-15)
    assert torque_at_rest(robot) == pytest.approx(-2 * 0.5 * 1.62 * np.cos(0.5), rel=1e-14)


@pytest.mark.parametrize("felt", [True, False])
def test_links_that_feel_no_gravity(tmp_path, felt):
    robot = read(tmp_path, model(pendulum(f"<gravity>{felt}</gravity>")))
    assert torque_at_rest(robot) == pytest.approx(-2 * 0.5 * 9.81 if felt else 0.0, rel=1e-14)


def test_a_static_model_is_fixed_to_the_world_and_that_its_joints_move_is_reported(tmp_path):
    text = model("<static>true</static>", link("a", "1 0 0 0 0 0"), link("b"), joint("j", "a", "b"))
    with pytest.warns(RobotWarning, match=r"<static>, which holds all joints .* where they are: m \(line 1\)"):
        robot = read(tmp_path, text)
    assert (robot.base, robot.joint_names) == ("world", ("j",))
    np.testing.assert_allclose(poses(robot, {"j": 0.0})["a"][:3, 3], [1, 0, 0])


def test_a_static_model_without_joints_that_move_is_as_in_its_file(tmp_path):
    parts = link("a"), link("b"), joint("j", "a", "b", "fixed", "")
    assert read(tmp_path, model("<static>true</static>", *parts), strict=True).joint_names == ()


AXIS = "<axis><xyz>0 0 1</xyz><dynamics>{}</dynamics></axis>"
LEFT_OUT = {  # what the joint of a tree, that of a loop and a link hold; what is said in a warning and in an error
    "a spring in a loop": (
        *("", "<spring_stiffness>2</spring_stiffness>", ""),
        r"springs of joints: k \(line 1\); make",
        r"joints\.k\.axis\.dynamics\.spring_stiffness",
    ),
    "damping in a loop": (
        *("<damping>2</damping>", "<damping>3</damping>", ""),
        r"damping of joints that close a loop: k \(line 1\); make",
        r"joints\.k\.axis\.dynamics\.damping: .*, got 3\.0",
    ),
    "friction in a loop": (
        *("<friction>2</friction>", "<friction>3</friction>", ""),
        r"friction of joints that close a loop: k \(line 1\); make",
        r"joints\.k\.axis\.dynamics\.friction: .*, got 3\.0",
    ),
    "decay": (
        *("", "", "<velocity_decay><linear>0.1</linear><angular>0.2</angular></velocity_decay>"),
        r"the decay of the velocities of links: b \(line 1\); make",
        r"links\.b\.velocity_decay\.linear: .*, got 0\.1",
    ),
    "a link that no force moves": (
        *("", "", "<kinematic>true</kinematic>"),
        r"<kinematic>, by which no force moves these links: b \(line 1\); make",
        r"links\.b\.kinematic: .*, got true; set it to false",
    ),
}


def looped(first, second, inside):
    """Return a model of two links whose second joint closes a loop, with what both joints and the second link hold."""
    parts = link("a"), link("b", body=SOME + inside), joint("j", "a", "b", inside=AXIS.format(first))
    return model(*parts, joint("k", "b", "a", inside=AXIS.format(second)))


@pytest.mark.parametrize("case", LEFT_OUT)
def test_what_bears_on_motions_and_is_left_out_is_reported(tmp_path, case):
    *parts, warns, refuses = LEFT_OUT[case]
    text = looped(*parts)
    with pytest.warns(RobotWarning, match=warns) as caught:
        assert list(read(tmp_path, text).closures) == ["k"]
    assert len(caught) == 1
    with pytest.raises(RobotFileError, match=refuses):
        read(tmp_path, text, strict=True)


def test_what_is_zero_or_read_is_not_left_out(tmp_path):
    first = "<damping>2</damping><friction>1</friction><spring_stiffness>0</spring_stiffness>"
    text = looped(
        first + "<spring_reference>3</spring_reference>",
        "<damping>0</damping><spring_reference>1</spring_reference>",
        "<velocity_decay><linear>0</linear></velocity_decay><kinematic>false</kinematic>",
    )
    assert list(read(tmp_path, text, strict=True).closures) == ["k"]


def test_the_canonical_link_is_the_base(tmp_path):
    parts = link("a"), link("b"), joint("j", "a", "b")
    assert read(tmp_path, model(*parts)).base == "a"
    assert read(tmp_path, model(*parts, attributes='canonical_link="b"')).base == "b"


def test_a_universal_joint_and_a_ball(tmp_path):
    axes = (
        "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis2>"
    )
    text = model(
        link("a"), link("b"), link("c"), joint("u", "a", "b", "universal", axes), joint("s", "b", "c", "ball", "")
    )
    robot = read(tmp_path, text)
    assert robot.joint_names == ("u_1", "u_2", "s_angle_1", "s_angle_2", "s_angle_3")
    assert robot.limits["u_2"].upper == 1
    q = dict(zip(robot.joint_names, (0.3, -0.4, 0.5, 0.6, 0.7), strict=True))
    turn = Rotation.from_euler("XY", [0.3, -0.4]) * Rotation.from_euler("ZYX", [0.5, 0.6, 0.7])
    np.testing.assert_allclose(poses(robot, q)["c"][:3, :3], turn.as_matrix(), rtol=0, atol=1e-15)


def test_the_turns_of_a_ball_have_names_that_nothing_else_has(tmp_path):
    """A ball called s beside a hinge called s_angle_2 was refused because of a name that the file does not hold."""
    text = model(*map(link, ("a", "s_frame_4", "c")), joint("s", "a", "s_frame_4", "ball", ""))
    text = text.replace("</model>", joint("s_angle_2", "s_frame_4", "c") + "</model>")
    robot = read(tmp_path, text)
    assert robot.joint_names == ("s_angle_1", "s_angle_2_", "s_angle_3", "s_angle_2")
    assert [robot.joints[name].child for name in robot.joint_names] == ["s_frame_4_", "s_frame_5", "s_frame_4", "c"]


def test_a_universal_joint_toward_the_base_keeps_the_numbers_of_its_axes(tmp_path):
    axes = (
        "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis2>"
    )
    robot = read(tmp_path, model(link("a"), link("b"), joint("u", "b", "a", "universal", axes)))
    assert (robot.base, robot.joint_names) == ("a", ("u_2", "u_1"))
    assert robot.limits["u_2"].upper == 1
    turn = Rotation.from_euler("XY", [0.3, -0.4])  # of a, the child in the file, seen from b
    here = poses(robot, {"u_1": 0.3, "u_2": -0.4})["b"][:3, :3]
    np.testing.assert_allclose(here, turn.inv().as_matrix(), rtol=0, atol=1e-15)


def test_axes_of_universal_joints_follow_and_are_followed(tmp_path):
    """Twice the first turn of one universal joint is the second turn of the next, whose first a hinge follows."""
    first = "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>"
    follows = '<mimic joint="{}" axis="{}"><multiplier>{}</multiplier></mimic>'
    second = f"<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz>{follows.format('u', 'axis', 2)}</axis2>"
    third = f"<axis><xyz>0 0 1</xyz>{follows.format('u', 'axis2', 3)}</axis>"
    text = model(
        *map(link, "abcd"),
        joint("u", "a", "b", "universal", first),
        joint("v", "b", "c", "universal", second),
        joint("w", "c", "d", inside=third),
    )
    robot = read(tmp_path, text)
    assert robot.joint_names == ("u_1", "u_2", "v_1")
    followed = {
        name: (joint.mimic.joint, joint.mimic.multiplier) for name, joint in robot.joints.items() if joint.mimic
    }
    assert followed == {"v_2": ("u_1", 2.0), "w": ("u_2", 3.0)}


def test_a_gearbox_and_a_mimic(tmp_path):
    gear = (
        "<gearbox_reference_body>frame</gearbox_reference_body><gearbox_ratio>0.25</gearbox_ratio>"
        "<axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 -1</xyz></axis2>"
    )
    follows = '<axis><xyz>0 0 1</xyz><mimic joint="in"><multiplier>3</multiplier><offset>1</offset>'
    follows += "<reference>0.5</reference></mimic></axis>"
    text = model(
        *map(link, ("frame", "fast", "slow", "hand")),
        joint("in", "frame", "fast"),
        joint("out", "slow", "frame"),
        joint("gear", "fast", "slow", "gearbox", gear),
        joint("grip", "frame", "hand", inside=follows),
    )
    robot = read(tmp_path, text)
    assert robot.joint_names == ("in",)
    # slow turns about -z by -0.25 of fast about z; the coordinate of `out` is that of the frame about z seen from slow
    angle = 0.8
    here = poses(robot, {"in": angle, "out": robot.joints["out"].mimic.multiplier * angle, "grip": 0.0})
    turn = Rotation.from_matrix(here["slow"][:3, :3]).as_rotvec()
    np.testing.assert_allclose(turn, [0, 0, 0.25 * angle], rtol=0, atol=1e-15)
    mimic = robot.joints["grip"].mimic
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("in", 3.0, 1.0 - 3.0 * 0.5)


@pytest.mark.slow
def test_four_bar_with_a_pin_that_closes_it(tmp_path):
    """Crank 1, coupler 3, rocker 2.5, base 3.2: closed by a revolute joint, against its closed form."""
    text = model(
        link("base"),
        link("crank", "0 0 0 0 0 0"),
        link("coupler", "1 0 0 0 0 0.7"),
        link("rocker", "3.2 0 0 0 0 1.5"),
        joint("A", "base", "crank"),
        joint("B", "crank", "coupler"),
        joint("D", "base", "rocker"),
        joint("C", "coupler", "rocker", inside="<pose>2.5 0 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis>"),
    )
    text = text.replace("1.5</pose>", f"{two_links()}</pose>").replace("0.7</pose>", f"{coupler_angle()}</pose>")
    robot = read(tmp_path, text)
    assert {name: closure.type for name, closure in robot.closures.items()} == {"C": "pin"}
    borne, redundant = jn.robot.closure_wrenches(robot)["C"]
    assert (len(borne), len(redundant)) == (2, 3)
    mechanism = robot.mechanism(drivers={"A": "0.4*sin(t)"}, outputs={"D": "D"}, time=[0.0, 0.5, 1.0])
    found = jn.solve(mechanism, order=0).outputs["D"][:, 0]
    start = two_links()
    for t, angle in zip([0.0, 0.5, 1.0], found, strict=True):
        crank = 0.4 * np.sin(t)
        tip = np.array([3.2 + 2.5 * np.cos(start + angle), 2.5 * np.sin(start + angle)])
        assert abs(np.linalg.norm(tip - [np.cos(crank), np.sin(crank)]) - 3.0) < 1e-13


def two_links():
    """Return the angle of the rocker where the crank lies along the base."""
    reach = 3.2 - 1.0
    return np.pi - np.arccos((reach**2 + 2.5**2 - 3.0**2) / (2 * reach * 2.5))


def coupler_angle():
    tip = np.array([3.2 + 2.5 * np.cos(two_links()), 2.5 * np.sin(two_links())]) - [1.0, 0.0]
    return np.arctan2(tip[1], tip[0])


def test_a_link_without_inertia_weighs_a_kilogram_and_is_reported(tmp_path):
    text = model(link("a"), link("bare", body=""), joint("j", "a", "bare"))
    with pytest.warns(RobotWarning, match=r"1 kg.*bare \(line 1\)"):
        robot = read(tmp_path, text)
    assert (robot.links["bare"].inertia.mass, np.trace(robot.links["bare"].inertia.tensor)) == (1.0, 3.0)
    with pytest.raises(RobotFileError, match="bare"):
        read(tmp_path, text, strict=True)


def test_what_an_inertia_does_not_give_is_one_and_is_reported(tmp_path):
    body = "<inertial><mass>2</mass><inertia><ixx>0.5</ixx><iyy>0.5</iyy></inertia></inertial>"
    with pytest.warns(RobotWarning, match=r"lack their mass or moments .*: bare \(line 1\)"):
        robot = read(tmp_path, model(link("a"), link("bare", body=body), joint("j", "a", "bare")))
    np.testing.assert_array_equal(robot.links["bare"].inertia.tensor, np.diag([0.5, 0.5, 1.0]))
    with pytest.raises(RobotFileError, match="does not give izz, which SDF takes for 1"):
        read(tmp_path, model(link("a"), link("bare", body=body), joint("j", "a", "bare")), strict=True)


def test_an_inertia_may_say_that_it_is_placed_in_its_own_link(tmp_path):
    body = SOME.replace("<inertial>", '<inertial><pose relative_to="{}">1 2 3 0 0 0</pose>')
    robot = read(tmp_path, model(link("a"), link("b", body=body.format("b")), joint("j", "a", "b")))
    np.testing.assert_array_equal(robot.links["b"].inertia.center_of_mass, [1, 2, 3])
    with pytest.raises(RobotFileError, match=r"links\.b\.inertial\.pose: .*frame of its link.*got 'a'"):
        read(tmp_path, model(link("a"), link("b", body=body.format("a")), joint("j", "a", "b")))


def test_a_link_of_no_mass_and_no_moments_is_a_frame(tmp_path):
    body = "<inertial><mass>0</mass>" + NOTHING
    robot = read(tmp_path, model(link("a"), link("tip", body=body), joint("j", "a", "tip", "fixed", "")))
    assert robot.links["tip"].inertia is None


BAD = {
    "no model": ('<sdf version="1.7"/>', "one <model>"),
    "two models": ('<sdf version="1.7"><model name="a"/><model name="b"/></sdf>', "holds 2 models and none that moves"),
    "no version": ("<sdf><model/></sdf>", "version"),
    "a version of letters": ('<sdf version="new"><model/></sdf>', "'new'"),
    "no links": (model(), "at least one <link>"),
    "a nested model": (model(link("a"), '<model name="b"/>'), "at least one <link>"),
    "an include": (model(link("a"), "<include><uri>model://b</uri></include>"), "there is no such model"),
    "an axis that the leader does not have": (
        model(
            *map(link, "abc"),
            joint("j", "a", "b"),
            joint("k", "b", "c", inside='<axis><xyz>0 0 1</xyz><mimic joint="j" axis="axis2"/></axis>'),
        ),
        "j has no axis of this name, got 'axis2'",
    ),
    "a negative damping": (
        model(*map(link, "ab"), joint("j", "a", "b", inside="<axis><dynamics><damping>-1</damping></dynamics></axis>")),
        "zero or greater, got -1.0",
    ),
    "a world of included models": (
        '<sdf version="1.7"><world name="w"><include><uri>model://b</uri></include></world></sdf>',
        "must hold one <model>",
    ),
    "an unknown type": (model(link("a"), link("b"), joint("j", "a", "b", "hinge")), "'hinge'"),
    "a pitch of no radians": (
        model(link("a"), link("b"), joint("j", "a", "b", "screw", "<thread_pitch>0</thread_pitch><axis/>")),
        "must not be zero",
    ),
    "an unknown link": (model(link("a"), joint("j", "a", "b")), "'b'"),
    "a joint of one link": (model(link("a"), joint("j", "a", "a")), "two different links"),
    "a name twice": (model(link("a"), link("a")), "given twice"),
    "the name of the world": (model(link("world")), "'world'"),
    "no axis": (model(link("a"), link("b"), joint("j", "a", "b", inside="")), "no <axis>"),
    "an axis of no length": (
        model(link("a"), link("b"), joint("j", "a", "b", inside="<axis><xyz>0 0 0</xyz></axis>")),
        "direction",
    ),
    "five numbers of a pose": (model(link("a", "0 0 0 0 0"), link("b"), joint("j", "a", "b")), "6 finite numbers"),
    "a number that is none": (model(link("a", "0 0 nan 0 0 0")), "finite"),
    "a mass below zero": (model(link("a", body="<inertial><mass>-1</mass></inertial>")), "greater than zero"),
    "a pose in a circle": (
        model(
            '<link name="a"><pose relative_to="b">1 0 0 0 0 0</pose></link>',
            '<link name="b"><pose relative_to="a">1 0 0 0 0 0</pose></link>',
            joint("j", "a", "b"),
        ),
        "relative to itself",
    ),
    "a frame that is not there": (model('<link name="a"><pose relative_to="c">1 0 0 0 0 0</pose></link>'), "'c'"),
    "a universal joint that closes a loop": (
        model(
            *map(link, "ab"),
            joint("j", "a", "b"),
            joint("u", "a", "b", "universal", "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>"),
        ),
        "closes a loop",
    ),
    "a mimic that closes a loop": (
        model(
            *map(link, "ab"),
            joint("j", "a", "b"),
            joint("k", "a", "b", inside='<axis><xyz>0 0 1</xyz><mimic joint="j"/></axis>'),
        ),
        "closes a loop",
    ),
    "a gearbox without joints": (
        model(
            *map(link, "abc"),
            joint("j", "a", "b"),
            joint("k", "a", "c", "prismatic"),
            joint(
                "g",
                "b",
                "c",
                "gearbox",
                "<gearbox_reference_body>a</gearbox_reference_body><gearbox_ratio>2</gearbox_ratio>"
                "<axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 1</xyz></axis2>",
            ),
        ),
        "revolute joint between a and c",
    ),
    "limits the wrong way round": (
        model(
            *map(link, "ab"),
            joint("j", "a", "b", inside="<axis><limit><lower>1</lower><upper>-1</upper></limit></axis>"),
        ),
        "lower limit",
    ),
}


UNKNOWN = {
    "of a model": (model(link("a"), "<lnik/>"), "<lnik>"),
    "of a link": (model(link("a", body=SOME + "<inretial/>")), "<inretial> of a"),
    "of an axis": (
        model(link("a"), link("b"), joint("j", "a", "b", inside="<axis><xzy>0 0 1</xzy></axis>")),
        "<xzy> of j",
    ),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_unknown_elements_are_left_out_and_reported(tmp_path, case):
    text, says = UNKNOWN[case]
    with pytest.warns(RobotWarning, match=f"elements that their formats do not have: {says}"):
        read(tmp_path, text)
    with pytest.raises(RobotFileError, match="no element of SDF here has this name"):
        read(tmp_path, text, strict=True)


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_with_their_line(tmp_path, case):
    text, says = BAD[case]
    with pytest.raises(RobotFileError) as caught:
        read(tmp_path, text)
    assert says in str(caught.value)
    assert "robot.sdf, line 1" in str(caught.value)


MOTORS = ("roll-op", "yaw-op", "pitch-op", "knee-op", "knee-shin-joint", "foot-op")


@pytest.fixture(scope="module")
def cassie():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        robot = jn.load_robot(CASSIE)
    assert robot.joints["left-knee-shin-joint"].stiffness > 0
    return robot


def test_cassie_has_the_bodies_of_its_file(cassie):
    """Masses, their centers, and the ends of its rods, from the file by a plain reading of SDF 1.6."""
    robot = cassie
    here = poses(robot, dict.fromkeys(robot.joints, 0.0))
    root = ElementTree.parse(CASSIE).getroot().find("model")
    places = {}
    for element in root.iterfind("link"):
        x, y, z, *turns = (float(word) for word in element.find("pose").text.split())
        places[element.get("name")] = np.eye(4)
        places[element.get("name")][:3, :3] = Rotation.from_euler("xyz", turns).as_matrix()
        places[element.get("name")][:3, 3] = x, y, z
    base = np.linalg.inv(places[robot.base])
    for element in root.iterfind("link"):
        name = element.get("name")
        np.testing.assert_allclose(here[name], base @ places[name], rtol=0, atol=1e-14)
        assert robot.links[name].inertia.mass == float(element.find("inertial/mass").text)
    assert {name: closure.type for name, closure in robot.closures.items()} == {
        f"{side}-{rod}-joint": "connect" for side in ("left", "right") for rod in ("pitch-rod", "plantar-foot")
    }


def test_all_files_of_cassie_are_read():
    loops, springs = {}, {}
    for name, path in sdf_files().items():
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", RobotWarning)  # also of a moment of inertia that no real body has
            robot = jn.load_robot(path)
        said = " ".join(str(warning.message) for warning in caught)
        read = [joint.name for joint in robot.joints.values() if joint.stiffness]
        left = re.findall(r"(\S+) \(line", said.partition("springs of joints: ")[2])
        springs[name.rpartition("/")[2]] = read + left
        loops[name.rpartition("/")[2]] = (len(robot.joint_names), len(robot.closures))
    assert loops == {
        "cassie.sdf": (24, 6),  # ten gears make as many joints follow the motors; springs of the shins slide
        "cassie_reduced.sdf": (23, 4),  # with a slide from the world
        "cassie_simple.sdf": (23, 4),
        "cassie_v2.sdf": (22, 4),
        "cassie_wo_gearbox_spring.sdf": (23, 4),
    }
    for name, path in sdf_files().items():
        stiff = [
            joint.get("name")
            for joint in ElementTree.parse(path).getroot().iterfind("model/joint")
            if float(joint.findtext("axis/dynamics/spring_stiffness", "0"))
        ]
        assert sorted(springs[name.rpartition("/")[2]]) == sorted(stiff)


@pytest.mark.slow
def test_cassie_moves_as_in_pinocchio(cassie):
    """The torques found, with their forces in the rods, make Pinocchio's constrained model accelerate as ours does."""
    robot = cassie
    drivers = {
        f"{side}-{name}": f"{0.03 * (k + 1)}*sin({2 + k % 3}*t)"
        for side in ("left", "right")
        for k, name in enumerate(MOTORS)
    }
    mechanism = robot.mechanism(drivers=drivers, time=[0.0, 0.05, 0.1], drives=False)
    motion = jn.solve(mechanism, order=4)
    model_, frames = in_pinocchio(robot.opened())
    data = model_.createData()
    names = list(model_.names)[1:]
    q = np.stack([motion.outputs[name][:, :3] for name in names], axis=2)
    torque = np.zeros((3, len(names)))
    for name in drivers:
        torque[:, names.index(name)] = jn.driver_force(motion, f"{name}_drive").values[:, 0]
    rods = [in_contact(model_, frames, closure) for closure in robot.closures.values()]
    for state, known in zip(q, torque, strict=True):
        force = pinocchio.rnea(model_, data, *state)
        pinocchio.computeJointJacobians(model_, data, state[0])
        kept = [rod.createData() for rod in rods]
        for rod, found in zip(rods, kept, strict=True):
            rod.calc(model_, data, found)
        pairs = zip(rods, kept, strict=True)
        jacobian = np.vstack([pinocchio.getConstraintJacobian(model_, data, rod, found) for rod, found in pairs])
        # in one direction of each rod at a foot the hinges hold it already, to the digits that the file gives of axes
        np.testing.assert_allclose(jacobian @ state[1], 0, atol=1e-8)
        borne = np.linalg.lstsq(jacobian.T, force - known, rcond=1e-9)[0]
        np.testing.assert_allclose(known + jacobian.T @ borne, force, rtol=0, atol=1e-10 * np.abs(force).max())


@pytest.mark.slow
def test_the_hook_of_the_crane_travels_level():
    robot = jn.load_robot("examples/robots/luffing_crane.sdf")
    mechanism = robot.mechanism(drivers={"luff": "0.25*cos(t)"}, time=np.linspace(0, np.pi, 9))
    motion = jn.solve(mechanism, order=2)
    hook = motion.point(*jn.robot.body_point(robot, "hook")).values[:, 0]
    assert np.ptp(hook[:, 0]) > 10.0  # m, as the file says of itself
    assert np.ptp(hook[:, 2]) < 0.05
    pin, luff = np.array([-7.6, 0.0, 5.18]), 0.95 + motion.outputs["luff"][:, 0]
    head = np.stack([14 * np.cos(luff), 0 * luff, 2 + 14 * np.sin(luff)], axis=1)
    tail = head - 2.94 / 9 * (hook - head)  # the jib is straight: its tail is 17.41 m from the pin of the stay
    np.testing.assert_allclose(np.linalg.norm(hook - head, axis=1), 9.0, rtol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(tail - pin, axis=1), 17.41, rtol=1e-14)
