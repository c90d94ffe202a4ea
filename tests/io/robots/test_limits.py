"""Files of limits: what they may say, what goes before what, and the messages about what they may not."""

import math
import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.io.robots.limits import load_limits, load_motion_limits
from jounce.io.robots.loader import load_robot
from jounce.io.robots.payloads import with_payloads

ROOT = pathlib.Path(__file__).resolve().parents[3]
FRANKA = ROOT / "examples" / "limits" / "franka_panda.yaml"


@pytest.fixture(scope="module")
def robot():
    """Return a carriage with a rod, a finger that follows the rod, and a plate fixed to it."""
    body = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    links = [jn.Link(name, body) for name in ("base", "carriage", "rod", "finger", "plate")]
    joints = [
        jn.Joint("slide", "base", "carriage", "prismatic", limits=jn.Limits(lower=-1.0, upper=1.0, velocity=2.0)),
        jn.Joint("pin", "carriage", "rod", limits=jn.Limits(velocity=3.0, effort=5.0)),
        jn.Joint("finger", "rod", "finger", mimic=jn.robot.Mimic("pin")),
        jn.Joint("plate", "rod", "plate", "fixed"),
    ]
    return jn.Robot("crane", links, joints)


@pytest.fixture
def read(robot, tmp_path):
    def call(text, name="limits.yaml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return load_limits(path, robot)

    return call


@pytest.fixture
def refused(read):
    def call(text):
        with pytest.raises(jn.errors.RobotError) as raised:
            read(text)
        return str(raised.value).partition("limits.yaml, ")[2]

    return call


def test_joints_that_follow_keep_their_limits_beside_those_of_the_file(tmp_path):
    lead = jn.Joint("lead", "base", "a", limits=jn.Limits(lower=-3.0, upper=3.0, velocity=5.0))
    own = jn.Limits(lower=-1.0, upper=1.0, velocity=1.0, deceleration=3.0)
    follow = jn.Joint("follow", "base", "b", limits=own, mimic=jn.robot.Mimic("lead", -2.0))
    pair = jn.Robot("pair", [jn.Link("base"), jn.Link("a"), jn.Link("b")], [lead, follow], strict=False)
    path = tmp_path / "limits.yaml"
    path.write_text("joints: {lead: {velocity: 4, lower: -0.2, upper: null, acceleration: 9}}", encoding="utf-8")
    assert load_limits(path, pair)["lead"] == jn.Limits(-0.2, 0.5, 0.5, 9.0, deceleration=1.5)
    path.write_text("title: far\njoints:\n  lead: {lower: 0.6}", encoding="utf-8")
    with pytest.raises(jn.errors.RobotError, match=r"line 3, joints\.lead: no coordinate"):
        load_limits(path, pair)


def test_the_franka_arm_has_its_published_limits():
    robot = load_robot(ROOT / "examples" / "robots" / "panda.urdf")
    limits = load_limits(FRANKA, robot)
    arm = [limits[f"panda_joint{k}"] for k in range(1, 8)]
    assert [x.lower for x in arm] == [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    assert [x.upper for x in arm] == [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]
    assert [x.velocity for x in arm] == [2.175] * 4 + [2.61] * 3
    assert [x.acceleration for x in arm] == [15, 7.5, 10, 12.5, 15, 20, 20]
    assert [x.jerk for x in arm] == [7500, 3750, 5000, 6250, 7500, 10000, 10000]
    assert [x.effort for x in arm] == [87] * 4 + [12] * 3
    assert [x.effort_rate for x in arm] == [1000] * 7
    assert limits["panda_finger_joint1"] == robot.limits["panda_finger_joint1"]


def test_values_have_units_and_leave_the_others_as_they_are(read):
    found = read("joints: {pin: {velocity: 90 deg/s, jerk: 1 rev/s**3, effort: 2 kN*mm}, slide: {upper: 250 mm}}")
    assert found["pin"] == jn.Limits(velocity=math.pi / 2, jerk=2 * math.pi, effort=2.0)
    assert found["slide"] == jn.Limits(lower=-1.0, upper=0.25, velocity=2.0)
    bare = read("joints: {pin: {effort_rate: 1e3, acceleration: 5 Hz^2, jerk: 2*pi}}")["pin"]
    assert (bare.effort_rate, bare.acceleration, bare.jerk) == (1000.0, 5.0, 2 * math.pi)


def test_a_joint_goes_before_the_default_and_that_before_the_robot(read):
    found = read("default: {velocity: 1.5, jerk: 40}\njoints: {pin: {velocity: 1.2}}")
    assert (found["slide"].velocity, found["pin"].velocity) == (1.5, 1.2)
    assert (found["slide"].jerk, found["pin"].jerk, found["pin"].effort) == (40.0, 40.0, 5.0)


def test_a_default_with_a_unit_is_for_the_joints_that_it_fits(read):
    found = read("default: {acceleration: 3 m/s^2, jerk: 9 rad/s^3, effort: 7 N, effort_rate: 8 N*m/s}")
    assert found["slide"] == jn.Limits(lower=-1.0, upper=1.0, velocity=2.0, acceleration=3.0, effort=7.0)
    assert found["pin"] == jn.Limits(velocity=3.0, effort=5.0, jerk=9.0, effort_rate=8.0)


def test_a_joint_may_be_held_by_its_limits(read):
    assert read("joints: {slide: {lower: 0.5, upper: 0.5}}")["slide"] == jn.Limits(lower=0.5, upper=0.5, velocity=2.0)


def test_null_takes_a_limit_away(read):
    found = read("default: {velocity: null}\njoints: {slide: {lower: null}}")
    assert found["slide"] == jn.Limits(upper=1.0)
    assert found["pin"] == jn.Limits(effort=5.0)


def test_toml_and_json_are_read_too(read):
    assert read("[joints.pin]\njerk = 4\n", "limits.toml")["pin"].jerk == 4.0
    assert read('{"joints": {"pin": {"jerk": "4 rad/s^3"}}}', "limits.json")["pin"].jerk == 4.0


@pytest.mark.parametrize(
    "text, message",
    [
        (
            "joints:\n  pim: {jerk: 1}",
            "line 2, joints.pim: no moving joint of crane has this name; did you mean 'pin'? valid: pin, slide",
        ),
        ("joints:\n  finger: {jerk: 1}", "line 2, joints.finger: this joint follows pin; give limits of that one"),
        ("joints: {plate: {jerk: 1}}", "line 1, joints.plate: this joint is fixed and has no limits; leave it out"),
        ("joints:\n  pin:\n    speed: 1", "line 3, joints.pin.speed: unknown key; valid: acceleration, deceleration,"),
        ("joints:\n  pin:\n    velocty: 1", "line 3, joints.pin.velocty: unknown key; did you mean 'velocity'?"),
        ("max_velocity: 1", "line 1, max_velocity: unknown key; valid: default, joints, points, title"),
        ("title: none", "line 1: a limits file has the keys 'joints', 'default' or 'points', got ['title']"),
        ("joints: {pin: 3}", "line 1, joints.pin: must be a mapping with at least one entry, got 3"),
        ("joints:", "line 1, joints: must be a mapping with at least one entry, got nothing"),
        ("- 1", "line 1: must be a mapping with at least one entry, got [1]"),
        (
            "joints: {pin: {jerk: -5}}",
            "line 1, joints.pin.jerk: must be greater than zero, got -5; null means no limit",
        ),
        ("joints: {pin: {jerk: 0}}", "line 1, joints.pin.jerk: must be greater than zero, got 0"),
        ("default: {jerk: -5 m/s^3}", "line 1, default.jerk: must be greater than zero, got '-5 m/s^3'"),
        ("joints: {pin: {jerk: .inf}}", "line 1, joints.pin.jerk: must be a finite number, got inf"),
        ("joints: {pin: {jerk: .nan}}", "line 1, joints.pin.jerk: must be a finite number, got nan"),
        ("joints: {pin: {jerk: 1e400 rad/s^3}}", "line 1, joints.pin.jerk: must be a finite number"),
        ("joints: {pin: {jerk: true}}", "line 1, joints.pin.jerk: must be a number, a number with a unit"),
        ("joints: {pin: {jerk: fast}}", "line 1, joints.pin.jerk: "),
        (
            "joints: {pin: {velocity: 2 m/s}}",
            "line 1, joints.pin.velocity: the unit is that of a speed, got '2 m/s'; a joint that turns has "
            "velocity in rad/s",
        ),
        (
            "joints: {slide: {effort: 2 N*m}}",
            "the unit is that of a torque, got '2 N*m'; a joint that slides has effort in N",
        ),
        ("joints: {pin: {effort: 87 NM}}", "joints.pin.effort: unknown unit 'NM', got '87 NM'; did you mean 'Nm'?"),
        ("default: {effort: 3 kg}", "default.effort: the unit is that of a mass, got '3 kg'; effort is in N*m or N"),
        (
            "joints:\n  slide:\n    lower: 2",
            "line 3, joints.slide.lower: the lower limit of slide, 2, must not exceed the upper one, 1",
        ),
        ("joints: {pin: {jerk: 1, jerk: 2}}", "line 1, joints.pin.jerk: duplicate name"),
    ],
)
def test_messages_name_line_entry_and_value(text, message, refused):
    assert message in refused(text)


def test_a_file_that_is_none(robot, tmp_path):
    with pytest.raises(jn.errors.RobotError, match="file not found"):
        load_limits(tmp_path / "none.yaml", robot)
    with pytest.raises(jn.errors.RobotError, match=r"limits file .*extension; valid: \.yaml"):
        load_limits(tmp_path / "limits.txt", robot)


def test_payloads_are_point_masses_at_links(robot):
    loaded = with_payloads(robot, ["rod=500 g", "finger = 2"])
    assert loaded.mass == pytest.approx(robot.mass + 2.5)
    assert loaded.links["rod"].inertia.center_of_mass[0] == pytest.approx(0.5 / 1.5)


@pytest.mark.parametrize(
    "text, message",
    [
        ("rod", "--payload: a load is given by LINK=MASS, such as 'hand=3 kg', got 'rod'"),
        ("rod=", "--payload: a load is given by LINK=MASS"),
        ("rodd=1", "--payload: no link has this name, got 'rodd'; did you mean 'rod'?"),
        ("rod=-1 kg", "--payload: must be greater than zero, got '-1 kg'"),
        ("rod=1 m", "--payload: expected a mass, such as 2 kg"),
        ("rod=heavy", "--payload: "),
    ],
)
def test_what_a_payload_cannot_be(robot, text, message):
    with pytest.raises(jn.errors.RobotError) as raised:
        with_payloads(robot, [text])
    assert message in str(raised.value)


@pytest.mark.parametrize(
    "text",
    [
        "joints: {panda_joint1: {jounce: 100}}",
        "joints: {panda_joint1: {velocity: {q: [0, 1], value: [1, 2]}}}",
        "points: {panda_hand: {point: [0, 0, 0], speed: 1}}",
    ],
)
def test_a_limit_of_any_further_kind_is_not_left_out(tmp_path, text):
    path = tmp_path / "limits.yaml"
    path.write_text(text)
    robot = load_robot("examples/robots/panda.urdf")
    load_motion_limits(path, robot)
    with pytest.raises(jn.errors.RobotError, match="load_motion_limits"):
        load_limits(path, robot)


def test_limits_of_all_kinds_are_read_for_retiming(tmp_path):
    robot = load_robot("examples/robots/panda.urdf")
    found = load_motion_limits("examples/limits/panda_careful.yaml", robot)
    assert found.jounce["panda_joint3"] == 1e5
    assert "panda_finger_joint1" not in found.jounce  # it slides, and the default turns
    np.testing.assert_allclose(found.varying["panda_joint1"]["velocity"](np.array([-3.0, 0.0, 2.55])), [0.3, 2.0, 1.15])
    np.testing.assert_allclose(found.varying["panda_joint2"]["velocity"](np.array([0.0, 1.0])), [2.0, 1.5])
    assert found.points[0].acceleration == 6.0
    with pytest.raises(jn.errors.RobotError, match="load_motion_limits"):
        load_limits("examples/limits/panda_careful.yaml", robot)
    bad = tmp_path / "bad.yaml"
    for text, message in (
        ("points: {hand: {speed: 1 m/s}}", "line 1, points.hand"),
        ("points: {panda_hand: {speed: 1 rad/s}}", "it is in m/s"),
        ("joints: {panda_joint1: {velocity: {q: [1, 0], value: [1, 2]}}}", "increase"),
        ("joints: {panda_joint1: {velocity: 2 - x*q}}", "unknown name 'x'"),
    ):
        bad.write_text(text)
        with pytest.raises(jn.errors.RobotError, match=message):
            load_motion_limits(bad, robot)


@pytest.mark.parametrize(
    "text, words",
    [
        (
            "joints:\n  pin: {velocity: 180}",
            r"2, joints.pin.velocity: 180 rad/s is 60 times the robot's own 3 rad/s",
        ),
        ("joints: {pin: {upper: 170}}", r"line 1, joints.pin.upper: 170 rad is 27 turns: 170 deg\? A number without a"),
        ("joints: {slide: {velocity: 900}}", r"slide.velocity: 900 m/s is 4.5e\+02 times .* own 2 m/s: 900 mm/s\?"),
        (
            "joints: {slide: {lower: -800, upper: 800}}",
            r"slide.lower: -800 m is .* own 1 m: -800 mm\? \(and 1 like",
        ),
        ("default: {velocity: 180}", r"line 1, default.velocity: 180 rad/s .* 180 deg/s\? A"),
    ],
)
def test_limits_without_a_unit_that_suit_the_robot_in_degrees_or_millimeters_are_doubted(read, text, words):
    with pytest.warns(jn.errors.UnitWarning, match=words):
        read(text)


@pytest.mark.parametrize(
    "text",
    [
        "joints: {pin: {velocity: 180 deg/s}, slide: {velocity: 900 mm/s}}",
        "joints: {pin: {velocity: 3.1}, slide: {velocity: 1.5}}",
        "joints: {pin: {velocity: 180 rad/s}, slide: {velocity: 900 m/s}}",
        "joints: {pin: {velocity: 2000}}",  # a rotor: neither in degrees is it what the robot has
        "joints: {pin: {acceleration: 500, jerk: 7500, effort: 200}}",
    ],
)
def test_limits_that_may_be_meant_as_they_stand_are_not_doubted(read, text):
    read(text)  # warnings are errors here


def test_other_words_for_the_keys_are_refused_with_the_key(refused):
    assert refused("joints: {pin: {torque: 5 N*m}}").startswith(
        "line 1, joints.pin.torque: the key for that is 'effort'"
    )
    assert "the key for that is 'velocity'" in refused("default: {max_velocity: 5 rad/s}")


MOVEIT = """
default_velocity_scaling_factor: 0.1
joint_limits:
  slide:
    has_velocity_limits: false
    max_velocity: 1.5
    has_position_limits: true
    min_position: -0.5
    max_position: 0.5
    has_acceleration_limits: false
    max_acceleration: 0
  pin: {has_velocity_limits: true, max_velocity: !degrees 90, max_acceleration: 4, has_jerk_limits: true, max_jerk: 50}
  finger: {has_velocity_limits: true, max_velocity: 1}
"""


def test_limits_of_moveit(read):
    """A false flag takes a limit away, also the robot's own; without a flag a value counts, as MoveIt has it."""
    with pytest.warns(jn.errors.RobotWarning) as caught:
        limits = read(MOVEIT)
    assert limits["slide"] == jn.Limits(lower=-0.5, upper=0.5)
    assert limits["pin"] == jn.Limits(velocity=math.pi / 2, acceleration=4.0, jerk=50.0, effort=5.0)
    words = str(caught[0].message)
    assert "line 3, joint_limits: left out, as no coordinates of crane: finger; default_velocity" in words
    assert "default_velocity_scaling_factor: 0.1 do not count" in words
    alone = "/**:\n  ros__parameters:\n    robot_description_planning:\n      joint_limits: {pin: {max_effort: 7}}"
    assert read(alone)["pin"] == jn.Limits(velocity=3.0, effort=7.0)
    assert read(alone.replace("/**", "/move_group"))["pin"] == jn.Limits(velocity=3.0, effort=7.0)


CONTROLLERS = """
controller_manager:
  ros__parameters: {update_rate: 100, arm_controller: {type: joint_trajectory_controller/JointTrajectoryController}}
arm_controller:
  ros__parameters:
    joints: [pin, slide]
    constraints: {pin: {trajectory: 0.1}}
    joint_limits: {pin: {has_velocity_limits: true, max_velocity: 1.5}}
"""


def test_limits_among_the_parameters_of_controllers(read, refused):
    assert read(CONTROLLERS)["pin"] == jn.Limits(velocity=1.5, effort=5.0)
    none = CONTROLLERS.replace("joint_limits", "gains")
    assert refused(none).startswith("line 2, controller_manager: these parameters hold no joint_limits; a limits file")
    twice = CONTROLLERS + "    hand: {joint_limits: {pin: {max_velocity: 2}}}"
    assert "several places: arm_controller.ros__parameters.joint_limits (line 8), arm_controller." in refused(twice)
    with pytest.warns(jn.errors.RobotWarning, match=r"joint_limits: left out: tool_limits$"):
        read(CONTROLLERS + "    tool_limits: {speed: 2}")


@pytest.mark.parametrize("deceleration", [-5.0, 5, -5])
def test_decelerations_of_pilz_are_below_zero_and_those_of_ros2_control_above(read, deceleration):
    text = f"joint_limits: {{pin: {{has_deceleration_limits: true, max_deceleration: {deceleration}}}}}"
    assert read(text)["pin"] == jn.Limits(velocity=3.0, effort=5.0, deceleration=5.0)


def test_what_does_not_count_of_limits_of_moveit_is_named(read):
    text = "cartesian_limits: {max_trans_vel: 1}\njoint_limits: {pin: {has_soft_limits: true, soft_upper_limit: 1}}"
    with pytest.warns(jn.errors.RobotWarning) as caught:
        assert read(text)["pin"] == jn.Limits(velocity=3.0, effort=5.0)
    assert "cartesian_limits are left out" in str(caught[0].message)
    assert str(caught[0].message).endswith("soft limits do not count: pin")


@pytest.mark.parametrize(
    "text, says",
    [
        (
            "joint_limits: {pni: {max_velocity: 1}}",
            "line 1, joint_limits.pni: no moving joint of crane has this name; did you mean 'pin'?",
        ),
        ("joint_limits: {pin: {max_speed: 1}}", "line 1, joint_limits.pin.max_speed: unknown key"),
        ("joint_limits: {pin: {has_velocity_limits: 1}}", "line 1, joint_limits.pin.has_velocity_limits: must be true"),
        ("joint_limits: {pin: {max_deceleration: true}}", "line 1, joint_limits.pin.max_deceleration: "),
        ("joint_limits: {pin: {max_velocity: 0}}", "line 1, joint_limits.pin.max_velocity: must be greater than zero"),
        ("joint_limits: {pin: {max_velocity: !deg 1}}", "line 1, joint_limits.pin.max_velocity: the YAML tag !deg is"),
        ("joints: {pin: {velocity: !degrees fast}}", "line 1, joints.pin.velocity: the YAML tag !degrees is not"),
    ],
)
def test_limits_of_moveit_that_are_wrong(refused, text, says):
    assert refused(text).startswith(says)
