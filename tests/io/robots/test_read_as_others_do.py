"""URDF files that other readers take: read as they read them, and told of; what simulators add is read, too."""

import numpy as np
import pytest

import jounce as jn

BODY = '<inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
BODY += '<inertia ixx="0.001" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
LIMIT = '<limit lower="-3" upper="3" effort="9" velocity="9"/>'


def arm(limit=LIMIT, inside="", more="", parent="base", base='<link name="base"/>'):
    return (
        f'<robot name="arm">{base}<link name="a">{BODY}</link><joint name="j" type="revolute"><parent link="{parent}"/>'
        f'<child link="a"/><axis xyz="0 0 1"/>{limit}{inside}</joint>{more}</robot>'
    )


def read(tmp_path, text, **options):
    path = tmp_path / "robot.urdf"
    path.write_text(text, newline="")
    return jn.load_robot(path, **options)


DECLARED = '<?xml version="1.0"?>\n'
TOLD = {
    "two hyphens": (DECLARED + "<!-- -- a -- -->\n" + arm(), "two hyphens within a comment (line 2)"),
    "blank line": ("\n" + DECLARED + arm(), "lines before the declaration <?xml (line 2)"),
    "comment first": ("<!-- a\n-->\n" + DECLARED + arm(), "lines before the declaration <?xml (line 3)"),
    "macro call": (arm(more="\n<xacro:camera name='c'/>"), "not expanded: <xacro:camera> (line 2)"),
    "zero bytes": (arm() + "\n\0\0", "zero bytes at the end (line 2)"),
    "closed twice": (arm() + "\n</robot>\n", "text after the end of its root element (line 2)"),
    "unknown": (arm(inside="\n<controller_gains k_p='3'/>"), "<controller_gains> of j (line 2)"),
    "reversed": (arm(limit='<limit lower="1" upper="-1" velocity="2"/>'), "read as no range: j (line 1)"),
    "no velocity": (arm(limit='<limit lower="-1" upper="1" velocity="-1"/>'), "read as none: j (line 1)"),
}


@pytest.mark.parametrize("case", TOLD)
def test_what_others_let_pass_is_read_and_reported(tmp_path, case):
    text, says = TOLD[case]
    with pytest.warns(jn.errors.RobotWarning) as caught:
        robot = read(tmp_path, text)
    assert says in str(caught[0].message)
    assert robot.joint_names == ("j",)
    if case in ("reversed", "no velocity"):
        limits = robot.limits["j"]
        expected = (None, None, 2.0) if case == "reversed" else (-1.0, 1.0, None)
        assert (limits.lower, limits.upper, limits.velocity) == expected
    with pytest.raises(jn.errors.RobotFileError):
        read(tmp_path, text, strict=True)


def test_text_that_no_reader_takes_is_refused_as_before(tmp_path):
    with pytest.raises(jn.errors.RobotFileError, match="is not well-formed XML: mismatched tag"):
        read(tmp_path, "<!-- -- -->" + arm().replace("</joint>", ""))
    with pytest.raises(jn.errors.RobotFileError, match="is not a text file"):
        read(tmp_path, arm().replace("base", "ba\0se"))


@pytest.mark.parametrize("tag", ["include", "macro", "property"])
def test_a_source_of_xacro_is_refused(tmp_path, tag):
    with pytest.raises(jn.errors.RobotFileError, match=r"is a xacro file.*run: xacro"):
        read(tmp_path, arm(more=f"<xacro:{tag} name='c'/><xacro:c/>"))


def test_a_spherical_joint_is_three_turns(tmp_path):
    """As MuJoCo and Bullet have it: the torque at rest is the weight on its lever, about the moved axes."""
    text = arm(limit="").replace('"revolute"', '"spherical"').replace('<axis xyz="0 0 1"/>', "")
    robot = read(tmp_path, text, strict=True)
    assert robot.joint_names == ("j_angle_1", "j_angle_2", "j_angle_3")
    np.testing.assert_allclose(jn.inverse_dynamics(robot, np.zeros((3, 3)))[0], [0, -9.81 * 0.1, 0], atol=1e-15)


def test_the_world_need_not_be_a_link(tmp_path):
    robot = read(tmp_path, arm(parent="world", base=""), strict=True)
    assert (robot.base, robot.joint_names) == ("world", ("j",))


def test_one_end_of_a_range_beside_the_zero_that_stands_for_the_other(tmp_path):
    limits = read(tmp_path, arm(limit='<limit lower="-1" effort="9" velocity="9"/>'), strict=True).limits["j"]
    assert (limits.lower, limits.upper) == (-1.0, 0.0)


@pytest.mark.parametrize("form", ["gazebo", "dynamics"])
def test_springs_by_extension(tmp_path, form):
    gazebo = "<gazebo reference='j'><springStiffness>5</springStiffness><springReference>0.3</springReference></gazebo>"
    dynamics = '<dynamics spring_stiffness="5" spring_reference="0.3"/>'
    robot = read(tmp_path, arm(more=gazebo) if form == "gazebo" else arm(inside=dynamics), strict=True)
    torque = np.asarray(jn.inverse_dynamics(robot, np.array([[0.5], [0.0], [2.0]])))
    np.testing.assert_allclose(torque, [[5 * 0.2 + (0.01 + 0.1**2) * 2.0]], rtol=1e-13)


def test_rotors_of_drake_seen_through_their_gears(tmp_path):
    rotor = '<drake:rotor_inertia value="0.0001321"/><drake:gear_ratio value="160"/>'
    more = (
        f'<transmission type="SimpleTransmission"><actuator name="m">{rotor}</actuator><joint name="j"/></transmission>'
    )
    robot = read(tmp_path, arm(more=more).replace("<robot ", '<robot xmlns:drake="d" '), strict=True)
    torque = np.asarray(jn.inverse_dynamics(robot, np.array([[0.5], [0.0], [2.0]])))
    np.testing.assert_allclose(torque, [[(0.01 + 0.1**2 + 0.0001321 * 160**2) * 2.0]], rtol=1e-12)


def test_a_mass_without_moments_is_a_point_mass(tmp_path):
    """As in Pinocchio and Drake: 1 kg at 0.1 m from a joint about y, at rest and accelerated."""
    text = arm().replace(BODY[BODY.index("<inertia ") :], "</inertial>").replace('axis xyz="0 0 1"', 'axis xyz="0 1 0"')
    with pytest.warns(jn.errors.RobotWarning, match=r"mass without <inertia>, .* point mass: a \(line 1\)"):
        robot = read(tmp_path, text)
    torque = np.asarray(jn.inverse_dynamics(robot, np.array([[0.5], [0.0], [2.0]])))
    np.testing.assert_allclose(torque, [[-9.81 * 0.1 * np.cos(0.5) + 0.1**2 * 2.0]], rtol=1e-13)


def test_links_out_of_gravity(tmp_path):
    off = "<gazebo reference='a'><turnGravityOff>true</turnGravityOff></gazebo>"
    upright = arm(more=off).replace('axis xyz="0 0 1"', 'axis xyz="0 1 0"')
    with pytest.warns(jn.errors.RobotWarning, match="takes out of gravity, which other readers of URDF count: a"):
        robot = read(tmp_path, upright)
    np.testing.assert_allclose(jn.inverse_dynamics(robot, np.zeros((3, 1))), 0, atol=1e-14)


def five_bar(loop):
    second = f'<link name="b">{BODY}</link><joint name="k" type="revolute"><parent link="base"/><child link="b"/>'
    second += f'<origin xyz="0.1 0 0"/><axis xyz="0 0 1"/>{LIMIT}</joint>'
    return arm(more=second + loop).replace("<robot ", '<robot xmlns:drake="d" ')


GAZEBO_LOOP = "<gazebo><joint name='tip' type='{}'><pose>0.1 0 0 0 0.2 0</pose>{}{}</joint></gazebo>"
ENDS = "<parent>a</parent><child>b</child>"


@pytest.mark.parametrize("kind, made", [("revolute", "pin"), ("ball", "connect"), ("prismatic", "slider")])
def test_a_joint_that_gazebo_adds_closes_a_loop(tmp_path, kind, made):
    """Its frame is that of the child, and the links are joined as they are at coordinates zero."""
    axis = "" if kind == "ball" else "<axis><xyz>1 0 0</xyz></axis>"
    robot = read(tmp_path, five_bar(GAZEBO_LOOP.format(kind, ENDS, axis)), strict=True)
    closure = robot.closures["tip"]
    assert (closure.type, closure.links) == (made, ("b", "a"))
    np.testing.assert_allclose(closure.points, [[0.1, 0, 0], [0.2, 0, 0]], atol=1e-15)
    if kind != "ball":
        np.testing.assert_allclose(closure.axis, [np.cos(0.2), 0, -np.sin(0.2)], atol=1e-15)


def test_a_closure_that_has_the_name_of_a_joint_gets_another(tmp_path):
    """As in the PR2: its gripper is a joint of the file and, between other links, a joint that Gazebo adds."""
    loop = GAZEBO_LOOP.format("ball", ENDS, "").replace("'tip'", "'k'")
    with pytest.warns(jn.errors.RobotWarning, match=r"are called NAME_closure: k \(line 1\)"):
        robot = read(tmp_path, five_bar(loop))
    assert robot.closures["k_closure"].links == ("b", "a")
    with pytest.raises(jn.errors.RobotFileError, match=r"closures\.k: a joint has the name of this closure, which is"):
        read(tmp_path, five_bar(loop), strict=True)


@pytest.mark.parametrize(
    "kind, inside",
    [
        ("universal", ENDS),
        ("revolute", "<parent>a</parent><child>c</child>"),
        ("revolute", ENDS + "<axis><xyz expressed_in='a'>1 0 0</xyz></axis>"),
    ],
)
def test_other_joints_that_gazebo_adds_are_reported(tmp_path, kind, inside):
    with pytest.warns(jn.errors.RobotWarning, match="links and joints that <gazebo> adds: tip"):
        assert not read(tmp_path, five_bar(GAZEBO_LOOP.format(kind, inside, ""))).closures


def test_a_loop_joint_is_a_pin_between_two_frames(tmp_path):
    ends = '<link1 link="a" xyz="0.2 0 0" rpy="0 0 0.3"/><link2 link="b" xyz="0.1 0 0"/>'
    robot = read(
        tmp_path,
        five_bar(f'<loop_joint name="tip" type="continuous">{ends}<axis xyz="0 0 1"/></loop_joint>'),
        strict=True,
    )
    closure = robot.closures["tip"]
    assert (closure.type, closure.links) == ("pin", ("a", "b"))
    assert closure.points.tolist() == [[0.2, 0, 0], [0.1, 0, 0]]
    np.testing.assert_allclose(closure.axis, [0, 0, 1])
    with pytest.raises(jn.errors.RobotFileError, match="no link has this name, got 'c'"):
        read(tmp_path, five_bar(f'<loop_joint name="tip" type="continuous">{ends.replace("b", "c")}</loop_joint>'))


def test_a_ball_constraint_of_drake(tmp_path):
    parts = "".join(
        f'<drake:ball_constraint_body_{x} name="{link}"/><drake:ball_constraint_p_{p} value="{at}"/>'
        for x, link, p, at in (("A", "a", "AP", "0.2 0 0"), ("B", "b", "BQ", "0.1 0 0"))
    )
    robot = read(tmp_path, five_bar(f"<drake:ball_constraint>{parts}</drake:ball_constraint>"), strict=True)
    closure = robot.closures["ball_constraint_0"]
    assert (closure.type, closure.points.tolist()) == ("connect", [[0.2, 0, 0], [0.1, 0, 0]])


FILE = """\
title: five-bar
joints:
  j: {stiffness: 2 N*m/rad, reference: 30 deg, rotor_inertia: 0.1 kg*m^2, gear_ratio: 3, friction: [0.2, 0.1]}
closures:
  tip:
    type: revolute
    frames: [{link: a, xyz: [20 cm, 0, 0]}, {link: b, xyz: [0.15, 0, 0]}]
    axis: [0, 0, 1]
"""


@pytest.mark.slow
def test_a_file_beside_it_closes_loops_and_gives_springs_and_rotors(tmp_path):
    beside = tmp_path / "more.yaml"
    beside.write_text(FILE)
    robot = read(tmp_path, five_bar(""), closures=beside)
    joint = robot.joints["j"]
    assert (joint.stiffness, joint.friction) == (2.0, (0.2, 0.1))
    np.testing.assert_allclose([joint.spring_reference, joint.armature], [np.pi / 6, 0.9], rtol=1e-14)
    motion = jn.solve(robot.mechanism({"j": 0.8, "k": 1.5}), [0.0], order=0)  # a triangle, which does not move
    q, k = (float(motion.outputs[name][0, 0]) for name in ("j", "k"))
    assert q == pytest.approx(np.arccos((0.2**2 + 0.1**2 - 0.15**2) / (2 * 0.2 * 0.1)), abs=1e-9)
    tips = [0.2 * np.exp(1j * q), 0.1 + 0.15 * np.exp(1j * k)]
    np.testing.assert_allclose(tips[0], tips[1], atol=1e-9)


def test_a_rotor_beside_it_that_is_likely_in_kg_cm2_is_reported(tmp_path):
    beside = tmp_path / "more.yaml"
    beside.write_text("joints:\n  j: {rotor_inertia: 0.6, gear_ratio: 100}\n")
    with pytest.warns(jn.errors.UnitWarning, match=r"line 2, joints.j.rotor_inertia: a rotor of 0.6 .*0.6 kg\*cm\^2\?"):
        robot = read(tmp_path, five_bar(""), closures=beside)
    assert robot.joints["j"].armature == pytest.approx(6000.0)


WRONG = {
    "no joint": ("  j: {stiff", "  jj: {stiff", "no moving joint has this name", 3, "joints.jj"),
    "unit": ("2 N*m/rad", "2 N/m", "the unit is that of", 3, "joints.j.stiffness"),
    "no link": ("link: b", "link: c", "no link has this name, got 'c'", 7, "closures.tip.frames"),
    "type": ("revolute", "hinge", "no closure has this type, got 'hinge'", 6, "closures.tip.type"),
    "never closed": ("[20 cm, 0, 0]", "[2 m, 0, 0]", "the loops cannot be closed", 5, "closures.tip"),
    "ratio alone": ("rotor_inertia: 0.1 kg*m^2, ", "", "is of no use without rotor_inertia", 3, "joints.j.gear_ratio"),
    "negative": ("2 N*m/rad", "-2 N*m/rad", "must be zero or greater", 3, "joints.j.stiffness"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_file_beside_it_is_refused_with_its_line(tmp_path, case):
    before, after, says, line, name = WRONG[case]
    beside = tmp_path / "more.yaml"
    beside.write_text(FILE.replace(before, after))
    with pytest.raises(jn.errors.RobotError, match=says) as caught:
        read(tmp_path, five_bar(""), closures=beside)
    assert (caught.value.line, caught.value.name) == (line, name)
