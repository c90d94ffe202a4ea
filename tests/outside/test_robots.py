"""Robot files and calls that people asked about in public, with values that do not come from this library.

Each test names its source, and says what is right and how that is known.
"""

import numpy as np
import pytest

import jounce as jn

LINK = (
    '<link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/>'
    '<inertia ixx="{3}" iyy="{3}" izz="{3}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)


def link(name, center="0 0 0", mass=1.0, moment=0.01):
    """Return a link with three equal moments about its center of mass."""
    return LINK.format(name, center, mass, moment)


def joint(name, parent, child, more="", kind="revolute", axis="0 0 1", origin="0 0 0"):
    """Return a joint; `more` holds its limits, its dynamics or whom it follows."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{origin}"/><axis xyz="{axis}"/>{more}</joint>'
    )


@pytest.fixture
def load(tmp_path):
    """Return a function that loads a robot from parts of a URDF file."""

    def robot(*parts, **options):
        path = tmp_path / "robot.urdf"
        path.write_text('<robot name="r"><link name="base"/>' + "".join(parts) + "</robot>")
        return jn.load_robot(path, **options)

    return robot


def limit(lower, upper):
    """Return a range of a joint."""
    return f'<limit lower="{lower}" upper="{upper}" effort="1000" velocity="2"/>'


def mimic(leader, multiplier=1.0, offset=0.0):
    """Return that a joint follows another."""
    return f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'


@pytest.mark.parametrize("count", [1, 3])
def test_followers_with_ranges_of_the_wrong_sign_leave_the_leader_its_own(load, count):
    """Robotiq 85 and 140 (ros-industrial robotiq pull 157, robotiq_arg85_description issue 1, and copies of them).

    Knuckles with multiplier -1 carry the range 0 to 0.8757 of their leader: theirs should be -0.8757 to 0. The gripper
    opens from 0 to 0.8757 nevertheless.
    """
    parts = [link("outer"), joint("finger", "base", "outer", limit(0, 0.8757))]
    for k in range(count):
        parts += [link(f"in{k}"), joint(f"knuckle{k}", "outer", f"in{k}", limit(0, 0.8757) + mimic("finger", -1))]
    with pytest.warns(jn.errors.RobotWarning, match="knuckle0"):
        robot = load(*parts)
    limits = robot.joints["finger"].limits
    assert (limits.lower, limits.upper) == (0.0, 0.8757)
    over = jn.JointTrajectory({"finger": "0.4 + 0.5*sin(t)"}, start=0.0, stop=2.0)
    rows = {row.quantity: row for row in jn.check_limits(robot, over).rows}
    assert rows["position"].ratio > 1  # reaches 0.9 rad


def test_a_follower_of_a_follower_multiplies(load):
    """MuJoCo issue 3527 (mimic in URDF): chains of followers, and offsets.

    b = 2 a + 0.1, c = -0.5 b + 0.3 = -a + 0.25: with unit inertia each about z, the leader's torque is 1 + 4 + 1 times
    its acceleration.
    """
    robot = load(
        *(link(name, moment=1.0) for name in "abc"),
        joint("a", "base", "a", limit(-1, 1)),
        joint("b", "base", "b", limit(-3, 3) + mimic("a", 2.0, 0.1)),
        joint("c", "base", "c", limit(-3, 3) + mimic("b", -0.5, 0.3)),
    )
    assert robot.joint_names == ("a",)
    tau = jn.inverse_dynamics(robot, np.array([[[0.2], [0.5], [3.0]]]))
    assert tau[0, 0, 0] == pytest.approx(18.0, abs=1e-12)
    pose = jn.forward_kinematics(robot, np.array([[[0.2], [0.5], [3.0]]]), "c")
    np.testing.assert_allclose(pose.angular_velocity[0, 0], [0, 0, -0.5], atol=1e-14)


def test_the_rotor_counts_at_rest_and_once(load):
    """OpenRAVE pull 1260: the rotor's inertia was skipped at zero velocity; Choreonoid issue 26: counted twice.

    RBDyn pull 125: rotor inertia times ratio squared on the diagonal of the mass matrix. Rod of 0.5 kg m^2 about its
    joint, rotor 1e-4 kg m^2 at 100 to 1: 1.5 kg m^2 in all.
    """
    rod = jn.Inertia(1.0, center_of_mass=[0, 0, 0], tensor=[0.5, 0.5, 0.5])
    pin = jn.Joint("pin", "base", "rod", axis=[0, 0, 1], armature=1e-4 * 100**2)
    robot = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    for rate in (0.0, 2.0):
        tau = jn.inverse_dynamics(robot, np.array([[[0.0], [rate], [2.0], [4.0]]]))
        np.testing.assert_allclose(tau[0, :, 0], [3.0, 6.0], atol=1e-13)
    assert jn.mass_matrix(robot, np.zeros((1, 1)))[0, 0, 0] == pytest.approx(1.5, abs=1e-14)
    bare = jn.inverse_dynamics(robot, np.array([[[0.0], [0.0], [2.0]]]), drives=False)
    assert bare[0, 0, 0] == pytest.approx(1.0, abs=1e-14)


def test_damping_and_friction_of_a_file_count(load):
    """Pinocchio issues 671 and 1602: what `rnea` holds of a file's rotor, damping and friction surprises its users.

    damping 0.7, friction 0.2, moment 0.5 at 2 rad/s and 3 rad/s^2: 1.5 + 1.4 + 0.2 N m, and none of them without
    drives.
    """
    dynamics = '<dynamics damping="0.7" friction="0.2"/>'
    robot = load(link("rod", moment=0.5), joint("pin", "base", "rod", limit(-9, 9) + dynamics))
    q = np.array([[[0.0], [2.0], [3.0]]])
    assert jn.inverse_dynamics(robot, q)[0, 0, 0] == pytest.approx(3.1, abs=1e-13)
    assert jn.inverse_dynamics(robot, q, drives=False)[0, 0, 0] == pytest.approx(1.5, abs=1e-13)


def test_the_torques_of_both_doors_are_the_same(load):
    """The same motion by `inverse_dynamics`, by `check_limits` and back by `forward_dynamics`: one number."""
    dynamics = '<dynamics damping="0.7" friction="0.0"/>'
    robot = load(link("rod", "0.3 0 0"), joint("pin", "base", "rod", limit(-9, 9) + dynamics, axis="0 1 0"))
    swing = jn.JointTrajectory({"pin": "0.5*sin(3*t)"}, start=0.0, stop=2.0)
    q = swing.derivatives(np.linspace(0.0, 2.0, 5001), order=3)
    tau = jn.inverse_dynamics(robot, q)
    (row,) = (row for row in jn.check_limits(robot, swing).rows if row.quantity == "torque")
    assert abs(tau[:, 0]).max() == pytest.approx(abs(row.value), rel=1e-6)
    back = jn.forward_dynamics(robot, q[:, :2], tau[:, :1])
    np.testing.assert_allclose(back[:, 2], q[:, 2], atol=1e-12)


def test_the_acceleration_of_a_tool_is_the_classical_one(load):
    """DART issue 294, Pinocchio issues 1171 and 2141, pull 2169: spatial acceleration taken for that of a point.

    A tool 0.4 m from an axis at 3 rad/s and 2 rad/s^2: 0.4 * 9 m/s^2 toward the axis, 0.8 m/s^2 along the tangent.
    """
    robot = load(
        link("rod"),
        joint("pin", "base", "rod", limit(-9, 9)),
        '<link name="tool"/>',
        joint("flange", "rod", "tool", kind="fixed", origin="0.4 0 0"),
    )
    found = jn.forward_kinematics(robot, np.array([[[0.0], [3.0], [2.0]]]), "tool")
    np.testing.assert_allclose(found.position[0, 2], [-3.6, 0.8, 0.0], atol=1e-13)


def test_the_speed_of_a_free_base_does_not_accelerate_a_frame(load):
    """Pinocchio issue 1921: the acceleration of a frame on a floating body changed with the body's linear velocity.

    With a constant velocity and a turn of 2 rad/s about z a frame 0.3 m away has 1.2 m/s^2 toward the center.
    """
    robot = load(
        link("body"),
        joint("free", "base", "body", kind="floating"),
        '<link name="tip"/>',
        joint("mount", "body", "tip", kind="fixed", origin="0.3 0 0"),
    )
    for speed in (0.0, 5.0):
        q = np.zeros((1, 3, 6))
        q[0, 1, :3] = speed
        q[0, 1, list(robot.joint_names).index("free_angle_1")] = 2.0  # about z, the first of Z, Y, X
        found = jn.forward_kinematics(robot, q, "tip")
        np.testing.assert_allclose(found.position[0, 2], [-1.2, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    "part",
    [
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="pin"/>'
        '<actuator name="m"><rotorInertia>0.01</rotorInertia><mechanicalReduction>10</mechanicalReduction></actuator>'
        "</transmission>",
        '<force_element name="f"/>',
    ],
)
def test_what_a_file_says_and_is_not_modeled_is_reported(load, part):
    """Files of Gazebo and Drake users: rotors by nobody's rule and forces beside a tree of links.

    Whatever changes forces or motion and is left out is told, once for a file, and an error with `strict`.
    """
    parts = [link("rod", "0.1 0 0"), joint("pin", "base", "rod", limit(-1, 1), axis="0 1 0"), part]
    with pytest.warns(jn.errors.RobotWarning) as caught:
        load(*parts)
    assert len(caught) == 1
    with pytest.raises(jn.errors.RobotFileError):
        load(*parts, strict=True)


def test_springs_gravity_switches_and_loops_of_simulators_are_read(load):
    """Files of Gazebo and Drake users: what they add to a tree of links is in the torques, and closes loops."""
    rod = link("rod", "0.1 0 0"), joint("pin", "base", "rod", limit(-1, 1), axis="0 1 0")
    spring = "<springStiffness>100</springStiffness><springReference>0.5</springReference>"
    bare, sprung = (
        np.asarray(jn.inverse_dynamics(load(*rod, part, strict=True), np.zeros((3, 1))))[0, 0]
        for part in ("", f'<gazebo reference="pin">{spring}</gazebo>')
    )
    with pytest.warns(jn.errors.RobotWarning, match="the weight of links that <gazebo> takes out of gravity"):
        weightless = load(*rod, f'<gazebo reference="rod">{OFF}</gazebo>')
    light = np.asarray(jn.inverse_dynamics(weightless, np.zeros((3, 1))))[0, 0]
    np.testing.assert_allclose([sprung - bare, light], [-50, 0], atol=1e-12)
    loop = '<loop_joint name="l" type="spherical"><link1 link="base"/><link2 link="rod"/></loop_joint>'
    assert load(*rod, loop, strict=True).closures["l"].type == "connect"


OFF = "<gravity>false</gravity>"
