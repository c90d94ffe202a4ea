"""What Drake adds to SDF files: joints that follow others and rotors are read, constraints and bushings are told of."""

import mujoco
import numpy as np
import pytest

import jounce as jn
from jounce.errors import RobotFileError

BODY = "<inertial><mass>2</mass><inertia><ixx>.1</ixx><iyy>.2</iyy><izz>.25</izz></inertia></inertial>"
AXIS = "<axis><xyz>0 1 0</xyz></axis>"


def joint(name, parent, child, kind="revolute", inside=AXIS):
    return f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>{inside}</joint>\n'


def read(tmp_path, second=AXIS, more="", first=AXIS, kind="revolute", **settings):
    """Read a chain of two joints; what is added to the model stands in line 4."""
    links = "".join(f'<link name="{name}">{BODY}</link>' for name in "ab")
    joints = joint("j", "world", "a", inside=first) + joint("k", "a", "b", kind, second)
    path = tmp_path / "robot.sdf"
    path.write_text(f'<sdf version="1.9"><model name="m">{links}\n{joints}{more}</model></sdf>')
    return jn.load_robot(path, **settings)


def test_joints_that_follow(tmp_path):
    robot = read(tmp_path, AXIS + '<drake:mimic joint="j" multiplier="2" offset="0.1"/>', strict=True)
    mimic = robot.joints["k"].mimic
    assert (robot.joint_names, mimic.joint, mimic.multiplier, mimic.offset) == (("j",), "j", 2.0, 0.1)
    plain = read(tmp_path, AXIS + '<drake:mimic joint="j"/>', strict=True).joints["k"].mimic
    assert (plain.multiplier, plain.offset) == (1.0, 0.0)


def test_rotors_are_armature_at_the_joint(tmp_path):
    rotor = "<drake:rotor_inertia>2e-4</drake:rotor_inertia>"
    robot = read(tmp_path, f"{AXIS}{rotor}<drake:gear_ratio>50</drake:gear_ratio>", first=AXIS + rotor, strict=True)
    assert robot.joints["k"].armature == pytest.approx(2e-4 * 50**2, rel=1e-15)
    assert robot.joints["j"].armature == pytest.approx(2e-4, rel=1e-15)


@pytest.mark.parametrize(
    "settings, says",
    [
        ({"more": "<drake:linear_bushing_rpy/>"}, r"<drake:linear_bushing_rpy> between links: .* \(line 4\)"),
        (
            {"second": "<drake:rotor_inertia>2</drake:rotor_inertia>", "kind": "ball"},
            r"inertia of the rotors of drives: k \(line 3\)",
        ),
        (
            {"more": joint("loop", "world", "b", inside=AXIS + "<drake:rotor_inertia>2</drake:rotor_inertia>")},
            r"inertia of the rotors of drives: loop \(line 4\)",
        ),
        (
            {"more": "<plugin><mimicJoint>k</mimicJoint></plugin>"},
            r"joints that follow others by a plugin: k \(line 4\)",
        ),
        ({"more": '<plugin name="gz::sim::LiftDrag"/>'}, r"air and water by plugins: gz::sim::LiftDrag \(line 4\)"),
    ],
)
def test_what_is_not_read_is_reported(tmp_path, settings, says):
    with pytest.warns(jn.errors.RobotWarning, match=says) as caught:
        read(tmp_path, **settings)
    assert len(caught) == 1
    with pytest.raises(RobotFileError):
        read(tmp_path, **settings, strict=True)


@pytest.mark.parametrize(
    "settings, name, says",
    [
        ({"second": AXIS + '<drake:mimic joint="l"/>'}, "joints.k.mimic", "must follow a moving joint"),
        ({"second": '<drake:mimic joint="j"/>', "kind": "ball"}, "joints.k.drake:mimic", "for a joint of one axis"),
        (
            {"second": '<axis><mimic joint="j"/></axis><drake:mimic joint="j"/>'},
            "joints.k.drake:mimic",
            "follows no other already",
        ),
        ({"second": AXIS + "<drake:mimic/>"}, "joints.k.drake:mimic", "has no attribute joint"),
        (
            {"second": AXIS + "<drake:rotor_inertia>-1</drake:rotor_inertia>"},
            "joints.k.drake:rotor_inertia",
            "zero or greater",
        ),
        (
            {"more": joint("loop", "world", "b", inside=AXIS + '<drake:mimic joint="j"/>')},
            "joints.loop.mimic",
            "closes a loop",
        ),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, settings, name, says):
    with pytest.raises(RobotFileError, match=says) as caught:
        read(tmp_path, **settings)
    assert caught.value.name == name
    assert caught.value.line in (3, 4)


CHAIN = (  # type, place, axis, damping, stiffness, reference, inertia of the rotor, gear ratio
    ("revolute", "0.1 0 0.2", "0 0.6 0.8", 0.3, 5.0, 0.2, 2e-5, 120.0),
    ("prismatic", "0.3 -0.1 0", "1 0 0", 1.5, 40.0, -0.1, 1e-4, 60.0),
    ("revolute", "0 0.2 0.1", "-0.8 0 0.6", 0.7, 0.0, 0.0, 4e-5, 80.0),
)


def drake_words(k, kind, place, axis, damping, stiffness, reference, rotor, ratio):
    """Return a link and its joint as Drake reads them."""
    spring = f"<spring_stiffness>{stiffness}</spring_stiffness><spring_reference>{reference}</spring_reference>"
    end, pose = ("world", "__model__") if k == 0 else (f"l{k - 1}", f"l{k - 1}")
    body = BODY.replace("<mass>", "<pose>.1 .02 -.05 0 0 0</pose><mass>")
    return f"""<link name="l{k}"><pose relative_to="j{k}"/>{body}</link>
<joint name="j{k}" type="{kind}"><pose relative_to="{pose}">{place} 0 0 0</pose><parent>{end}</parent>
<child>l{k}</child><axis><xyz>{axis}</xyz><dynamics><damping>{damping}</damping>{spring}</dynamics></axis>
<drake:rotor_inertia>{rotor}</drake:rotor_inertia><drake:gear_ratio>{ratio}</drake:gear_ratio></joint>"""


def mujoco_words(k, kind, place, axis, damping, stiffness, reference, rotor, ratio):
    """Return the same as MuJoCo reads it, without the end of the body."""
    named = {"revolute": "hinge", "prismatic": "slide"}[kind]
    spring = f'stiffness="{stiffness}" springref="{reference}" armature="{rotor * ratio**2!r}"'
    return f"""<body name="l{k}" pos="{place}"><joint name="j{k}" type="{named}" axis="{axis}" damping="{damping}"
{spring}/><inertial pos=".1 .02 -.05" mass="2" diaginertia=".1 .2 .25"/>"""


def test_springs_and_rotors_need_the_torques_of_mujoco(tmp_path):
    path = tmp_path / "robot.sdf"
    path.write_text(
        '<sdf version="1.9" xmlns:drake="d"><model name="m">'
        + "".join(drake_words(k, *values) for k, values in enumerate(CHAIN))
        + "</model></sdf>"
    )
    robot = jn.load_robot(path, strict=True)
    bodies = "".join(mujoco_words(k, *values) for k, values in enumerate(CHAIN))
    compiler = '<compiler angle="radian"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{compiler}<worldbody>{bodies}{'</body>' * len(CHAIN)}</worldbody></mujoco>"
    )
    data, expected = mujoco.MjData(model), []
    states = np.random.default_rng(4).uniform(-1, 1, (9, 3, len(CHAIN)))
    for state in states:
        data.qpos[:], data.qvel[:], data.qacc[:] = state
        mujoco.mj_inverse(model, data)
        expected.append(data.qfrc_inverse.copy())
    assert robot.joint_names == ("j0", "j1", "j2")
    torques = np.asarray(jn.inverse_dynamics(robot, states))[:, 0]
    np.testing.assert_allclose(torques, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
