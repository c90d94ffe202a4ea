"""What URDF files hold beside links and joints: rotors are read, what else bears on motions is told of."""

import warnings

import numpy as np
import pinocchio
import pytest

import jounce as jn
from jounce.errors import RobotFileError
from jounce.io.robots.loader import load_robot

MASS = '<mass value="1"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.04"/>'
GAZEBO = '<gazebo reference="{}">{}</gazebo>'
ROTOR = '<transmission name="t">{}<actuator name="m">{}</actuator></transmission>'
CONTROL = '<ros2_control name="c"><joint name="{}"><param name="mimic">rigid</param></joint></ros2_control>'
TWO = f"""<link name="k"><inertial>{MASS}</inertial><inertial>{MASS}</inertial></link>
<joint name="k" type="fixed"><parent link="l"/><child link="k"/></joint>"""
TURN = (0.2, 0.2, 0.2, 0.938083151964686)
WEIGHTLESS = r"takes out of gravity, which other readers of URDF count: l \(line 4\)"
CASES = {  # what follows the links and joints of a file; what is said of it, if it is
    "a bushing": ("<drake:linear_bushing_rpy/>", r"<drake:linear_bushing_rpy> between links: "),
    "a force": ('<force_element name="f"/>', r"<force_element>, which is a force: f \(line 4\)"),
    "a spring": (GAZEBO.format("j", "<springStiffness>3</springStiffness>"), None),
    "no spring": (GAZEBO.format("j", "<springStiffness>0.0</springStiffness>"), None),
    "a spring of a fixed joint": (GAZEBO.format("rigid", "<springStiffness>3</springStiffness>"), None),
    "no weight": (GAZEBO.format("l", "<gravity>false</gravity>"), WEIGHTLESS),
    "no weight, as a number": (GAZEBO.format("l", "<gravity> 0 </gravity>"), WEIGHTLESS),
    "no weight, as it was": (GAZEBO.format("l", "<turnGravityOff>true</turnGravityOff>"), WEIGHTLESS),
    "weight": (GAZEBO.format("l", "<gravity>true</gravity><turnGravityOff>0</turnGravityOff>"), None),
    "no weight of the base": (GAZEBO.format("base", "<gravity>false</gravity>"), None),
    "a kinematic link": (GAZEBO.format("l", "<kinematic>true</kinematic>"), r"<kinematic>, .*: l \(line 4\)"),
    "a static model": ("<gazebo><static>true</static></gazebo>", r"<static>, .*: p \(line 4\)"),
    "decay": (GAZEBO.format("l", "<dampingFactor>0.1</dampingFactor>"), r"decay of the velocities of links: l "),
    "decay apart": (
        GAZEBO.format("l", "<velocity_decay><linear>0</linear><angular>0.1</angular></velocity_decay>"),
        r"decay of the velocities of links: l ",
    ),
    "an inertia": (
        GAZEBO.format("l", "<inertial><mass>5</mass></inertial>"),
        r"inertia and poses that <gazebo> gives links: l \(line 4\)",
    ),
    "damping": (
        GAZEBO.format("j", "<axis><dynamics><damping>5</damping></dynamics></axis>"),
        r"axes, dynamics and poses that <gazebo> gives joints: j \(line 4\)",
    ),
    "damping of a fixed joint": (GAZEBO.format("rigid", "<dynamics><damping>5</damping></dynamics>"), None),
    "a sensor": (GAZEBO.format("l", "<sensor><pose>0 0 1 0 0 0</pose></sensor>"), None),
    "a joint": ('<gazebo><joint name="k" type="ball"/></gazebo>', r"links and joints that <gazebo> adds: k "),
    "a joint, as it was": ('<gazebo><joint:hinge name="k"/></gazebo>', r"joints that <gazebo> adds: k "),
    "a follower": ("<gazebo><plugin><mimicJoint>j</mimicJoint></plugin></gazebo>", r"by a plugin: j \(line 4\)"),
    "a plugin": ("<gazebo><plugin><joint>j</joint><gravity>false</gravity></plugin></gazebo>", None),
    "a follower of ros2_control": (CONTROL.format("j"), r"by a plugin: j \(line 4\)"),
    "no joint of ros2_control": (CONTROL.format("rigid_"), None),
    "an include": ('<include filename="arm.urdf"/>', r"xacro that are not expanded: <include> \(line 4\)"),
    "two inertias": (TWO, r"elements that are given twice.*: links\.k \(line 4\)"),
    "water": ('<gazebo><plugin name="w" filename="gz-sim-hydrodynamics-system"/></gazebo>', r"water by plugins: w "),
    "contact": (GAZEBO.format("l", "<mu1>0.2</mu1><selfCollide>true</selfCollide>"), None),
    "two rotors in one": (
        ROTOR.format('<joint name="j"/><joint name="rigid"/>', '<drake:rotor_inertia value="2"/>'),
        r"inertia of the rotors of drives: t \(line 4\)",
    ),
    "gravity of MuJoCo": ('<mujoco><option gravity="0 0 0"/></mujoco>', r"settings .*: gravity 0 0 0 \(line 4\)"),
    "shapes of MuJoCo": ('<mujoco><compiler inertiafromgeom="true"/></mujoco>', r"masses that follow from shapes"),
    "meshes of MuJoCo": ('<mujoco><compiler meshdir="a" balanceinertia="true"/></mujoco>', None),
}


def write(tmp_path, more="", version="", kind="revolute", dynamics="", turn=""):
    """Write a robot of one moving joint and a fixed one; what is added stands in line 4."""
    limit = '<limit lower="-3" upper="3" effort="1" velocity="1" drake:acceleration="7"/>'
    text = f"""<robot name="p"{version} xmlns:drake="http://drake.mit.edu">
<link name="base"/><link name="l"><inertial><origin xyz="0.1 0.2 0.3" {turn}/>{MASS}</inertial></link><link name="tip"/>
<joint name="rigid" type="fixed"><parent link="l"/><child link="tip"/></joint>
{more}
<joint name="j" type="{kind}"><parent link="base"/><child link="l"/><origin xyz="0 0 0" {turn}/><axis xyz="1 0 0"/>
{limit}{dynamics}</joint></robot>"""
    path = tmp_path / "p.urdf"
    path.write_text(text)
    return path


def read_with_warning(path, says):
    """Check that one warning says something, that it is an error if the file is read strictly, and return the robot."""
    with pytest.warns(jn.errors.RobotWarning, match=says) as caught:
        robot = load_robot(path)
    assert len(caught) == 1
    with pytest.raises(RobotFileError) as refused:
        load_robot(path, strict=True)
    assert refused.value.line is not None
    return robot


@pytest.mark.parametrize("case", CASES)
def test_what_bears_on_motions_is_reported_once_and_nothing_else_is(tmp_path, case):
    more, says = CASES[case]
    path = write(tmp_path, more)
    if says is None:
        load_robot(path, strict=True)
    else:
        read_with_warning(path, says)


@pytest.mark.parametrize(
    "dynamics, says",
    [
        ('stiffness="3"', r"springs of joints: j"),
        ('rotor_inertia="3"', r"inertia of the rotors of drives: j"),
        ('armature="3"', r"inertia of the rotors of drives: j"),
    ],
)
def test_attributes_of_dynamics_of_other_simulators(tmp_path, dynamics, says):
    read_with_warning(write(tmp_path, dynamics=f"<dynamics {dynamics}/>"), says)
    load_robot(write(tmp_path, dynamics='<dynamics damping="1" D="1" K="7000" mu_coulomb="0"/>'), strict=True)


@pytest.mark.parametrize("rotors", [[(1.321e-4, 160)], [(2e-3, None)], [(1e-4, 50), (2e-4, -30)]])
def test_rotors_of_transmissions_are_armature_as_drake_reads_them(tmp_path, rotors):
    """Reflected inertia is rotor inertia times the square of the gear ratio, which is 1 unless given."""
    more = ""
    for inertia, ratio in rotors:
        gear = (
            "" if ratio is None else f'<drake:gear_ratio value="{ratio}"/><mechanicalReduction>3</mechanicalReduction>'
        )
        parts = f'<drake:rotor_inertia value="{inertia}"/>{gear}'
        more += ROTOR.format('<joint name="j"/>', parts)
    robot = load_robot(write(tmp_path, more), strict=True)
    reflected = sum(inertia * (ratio or 1) ** 2 for inertia, ratio in rotors)
    assert robot.joints["j"].armature == pytest.approx(reflected, rel=1e-15)
    bare, whole = (float(jn.mass_matrix(robot, [0.3], drives=drives)[0, 0]) for drives in (False, True))
    assert whole - bare == pytest.approx(reflected, rel=1e-12)
    assert robot.limits["j"].acceleration == 7.0


@pytest.mark.parametrize(
    "joint, parts, name",
    [
        ('<joint name="jj"/>', '<drake:rotor_inertia value="1"/>', "transmissions.t.joint"),
        ('<joint name="j"/>', '<drake:rotor_inertia value="-1"/>', "transmissions.t.drake:rotor_inertia"),
        ('<joint name="j"/>', '<drake:rotor_inertia value="much"/>', "transmissions.t.drake:rotor_inertia"),
        ('<joint name="j"/>', "<drake:rotor_inertia/>", "transmissions.t.drake:rotor_inertia"),
    ],
)
def test_rotors_that_cannot_be_are_refused(tmp_path, joint, parts, name):
    with pytest.raises(RobotFileError) as caught:
        load_robot(write(tmp_path, ROTOR.format(joint, parts)))
    assert (caught.value.name, caught.value.line) == (name, 4)


REDUCTION = "<mechanicalReduction>50</mechanicalReduction>"
OF_ROTOR = '<drake:rotor_inertia value="2e-3"/>'


@pytest.mark.parametrize(
    "joint, actuator",
    [('<joint name="j"/>', OF_ROTOR + REDUCTION), (f'<joint name="j">{REDUCTION}</joint>', OF_ROTOR)],
)
def test_a_reduction_that_a_rotor_does_not_count_with_is_reported(tmp_path, joint, actuator):
    """Without a rotor a reduction says nothing about the joint; with one, Drake's ratio counts, and is 1 if missing."""
    path = write(tmp_path, ROTOR.format(joint, actuator))
    read_with_warning(path, r"<mechanicalReduction> of transmissions with rotors, .*: t \(line 4\)")
    with pytest.raises(RobotFileError, match=r"line 4, transmissions\.t\.mechanicalReduction: give <drake:gear_ratio>"):
        load_robot(path, strict=True)
    load_robot(write(tmp_path, ROTOR.format(joint, actuator.replace(OF_ROTOR, ""))), strict=True)
    load_robot(write(tmp_path, ROTOR.format(joint, actuator).replace("50", "1")), strict=True)


def control(interface, **ends):
    params = "".join(f'<param name="{key}">{value}</param>' for key, value in ends.items())
    command = f'<command_interface name="{interface}">{params}</command_interface>'
    return f'<ros2_control name="c"><joint name="j">{command}</joint></ros2_control>'


@pytest.mark.parametrize(
    "interface, ends, says",
    [
        ("position", {"min": -3, "max": 2.5}, r"j position max 2\.5 \(line 4\); make"),
        ("position", {"min": "-2.5", "max": 4}, r"j position min -2\.5 \(line 4\); make"),
        ("velocity", {"min": -1, "max": 0.5}, r"j velocity max 0\.5 \(line 4\); make"),
        ("effort", {"max": 0.1}, r"j effort max 0\.1 \(line 4\); make"),
        ("position", {"min": -3, "max": 3}, None),
        ("velocity", {"min": -2, "max": 2, "initial": 0.1}, None),
        ("voltage", {"max": 0.1}, None),
        ("position", {"min": "${low}"}, None),
    ],
)
def test_limits_of_ros2_control_that_are_tighter_are_reported(tmp_path, interface, ends, says):
    """The range of the joint is from -3 to 3 rad, its velocity and effort 1: controllers keep the tighter limits."""
    path = write(tmp_path, control(interface, **ends))
    if says is None:
        load_robot(path, strict=True)
    else:
        read_with_warning(path, r"limits of <ros2_control> that are tighter than <limit>: " + says)


@pytest.mark.parametrize(
    "ends, says",
    [
        ((-2.9, 2.9), r"j from -2\.9 to 2\.9 \(line 6\); make"),
        ((-3, 2), r"j from -3 to 2 \(line 6\); make"),
        ((-3, 3), None),
        ((-4, 5), None),
        ((0, 0), None),
        ((1, -1), None),
    ],
)
def test_soft_limits_that_are_tighter_are_reported(tmp_path, ends, says):
    soft = f'<safety_controller k_velocity="1" soft_lower_limit="{ends[0]}" soft_upper_limit="{ends[1]}"/>'
    path = write(tmp_path, dynamics=f"\n{soft}")
    if says is None:
        load_robot(path, strict=True)
    else:
        path.write_text(path.read_text().replace(f"\n{soft}", soft))
        read_with_warning(path, r"soft limits of <safety_controller> that are tighter than <limit>: " + says)


@pytest.mark.parametrize(
    "unit, told",
    [("kg m^2", False), ("kg cm^2", True), ("kg mm^2", True), ("g mm^2", True)],
)
def test_moments_of_inertia_in_small_units_are_told_of(tmp_path, unit, told):
    """A rod of 2.3 kg and 0.6 m, whose moment is 0.069 kg m^2."""
    size = {"kg m^2": 1.0, "kg cm^2": 1e4, "kg mm^2": 1e6, "g mm^2": 1e9}[unit]
    moment = 2.3 * 0.6**2 / 12 * size
    path = tmp_path / "rod.urdf"
    path.write_text(f"""<robot name="rod"><link name="base"/><link name="rod"><inertial><origin xyz="0.3 0 0"/>
<mass value="2.3"/>
<inertia ixx="{moment / 100}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>""")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_robot(path)
    found = [str(x.message) for x in caught if issubclass(x.category, jn.errors.UnitWarning)]
    assert len(found) == told
    assert not told or f"all lies in 0.3 m: rod ({(0.03 * size) ** 0.5:.3g} m); write kg m^2" in found[0]


@pytest.mark.parametrize(
    "lower, upper, told",
    [
        (-180, 180, True),
        (0, 90, True),
        (-165, 50, True),
        (-3, 3, False),
        (-100, 100, False),  # a common stand-in for no limit
        (-31.4, 31.4, False),
        (0, 40, False),
        (-720, 720, False),
    ],
)
def test_ranges_in_degrees_are_told_of(tmp_path, lower, upper, told):
    path = write(tmp_path)
    path.write_text(path.read_text().replace('lower="-3" upper="3"', f'lower="{lower}" upper="{upper}"'))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = load_robot(path, strict=True)
    assert (robot.limits["j"].lower, robot.limits["j"].upper) == (lower, upper)
    found = [str(x.message) for x in caught if issubclass(x.category, jn.errors.UnitWarning)]
    assert len(found) == told
    assert not told or f"look like degrees, and are read as radians: j ({lower} to {upper}); write" in found[0]
    slide = path.read_text().replace('type="revolute"', 'type="prismatic"')
    path.write_text(slide)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_robot(path)


def test_a_rotor_of_a_joint_of_several_coordinates(tmp_path):
    rotor = ROTOR.format('<joint name="j"/>', '<drake:rotor_inertia value="1"/>')
    read_with_warning(write(tmp_path, rotor, kind="planar"), r"armature of planar, floating and spherical joints: j")


def pinocchio_torque(path):
    model = pinocchio.buildModelFromUrdf(str(path))
    return float(pinocchio.rnea(model, model.createData(), np.array([0.2]), np.zeros(1), np.zeros(1))[0])


@pytest.mark.parametrize("version", ["", "1.0", "1.1", "1.2", "01.1"])
def test_quaternions_count_from_version_1_1_on_as_in_the_reference_parser(tmp_path, version):
    version = f' version="{version}"' if version else ""
    path = write(tmp_path, version=version, turn=f'quat_xyzw="{" ".join(map(str, TURN))}"')
    old = "1.1" not in version and "1.2" not in version
    robot = (
        read_with_warning(path, r"quat_xyzw, which the version .*: l \(line 2\), j \(line 5\)")
        if old
        else load_robot(path)
    )
    found = float(jn.inverse_dynamics(robot, [[0.2], [0.0], [0.0]])[0, 0])
    assert found == pytest.approx(pinocchio_torque(path), rel=1e-13)


@pytest.mark.parametrize("version", ["abc", "2.0", "1.3", "1", "0.9", "1.1.1", "", "-1.0"])
def test_versions_that_there_are_not_are_refused_as_in_the_reference_parser(tmp_path, version):
    path = write(tmp_path, version=f' version="{version}"')
    with pytest.raises(RobotFileError, match=r"no such version of URDF") as caught:
        load_robot(path)
    assert (caught.value.name, caught.value.line) == ("version", 1)
    with pytest.raises(ValueError, match="valid URDF"):
        pinocchio.buildModelFromUrdf(str(path))


def test_all_that_is_left_out_is_in_one_warning(tmp_path):
    more = "".join(text for text, says in CASES.values() if says)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_robot(write(tmp_path, more))
    assert len(caught) == 1
    assert str(caught[0].message).count("what follows is left out") == 1
