"""What MuJoCo's dynamics has and a robot has not is told of just where it changes what MuJoCo computes."""

import warnings

import mujoco
import numpy as np
import pytest

import jounce as jn
from jounce.errors import RobotFileError
from jounce.io.robots.loader import load_robot
from tests.problems.robots import FILES

FLAG = '<flag {}="disable"/>'
TENDON = '<tendon><fixed name="cord" {}><joint joint="knee" coef="1"/></fixed></tendon>'
DRIVE = TENDON.format("") + '<actuator><general {} armature="{}" damping="{}"/></actuator>'
CARRYING = '<default><joint actuatorgravcomp="true"/></default>'
CASES = {  # what the option, the lower body, its joint and the end of the file hold; what is said
    "a spring": ("", "", 'stiffness="3"', "", None),
    "a spring away from zero": ("", "", 'stiffness="3" springref="20" ref="5"', "", None),
    "a progressive spring": (
        "",
        "",
        'stiffness="0 0 3" springref="20"',
        "",
        r"springs of joints: knee \(line 5\); make",
    ),
    "a tuned spring": ("", "", 'springdamper="0.1 1"', "", None),
    "carried weight": ("", 'gravcomp="1"', "", "", None),
    "weight carried in part": ("", 'gravcomp="0.3"', "", "", None),
    "water": ('density="1000"', "", "", "", r"forces of the fluid around: density 1000 kg/m\^3 \(line 2\); make"),
    "air": (
        'density="1.2" viscosity="2e-05" wind="1 0 0"',
        *("", "", ""),
        r"density 1.2 kg/m\^3 and viscosity 2e-05 Pa s \(line 2\); make",
    ),
    "a cord": ("", "", "", TENDON.format('stiffness="4"'), None),
    "a cord of a length": ("", "", "", TENDON.format('stiffness="4" springlength="0.3"'), None),
    "a cord with slack": (
        *("", "", ""),
        TENDON.format('stiffness="4" springlength="0.1 0.3"'),
        r"springs of tendons: cord \(line 7\); make",
    ),
    "a damped cord": ("", "", "", TENDON.format('damping="4"'), None),
    "a cord that rubs": ("", "", "", TENDON.format('frictionloss="4"'), None),
    "a heavy cord": ("", "", "", TENDON.format('armature="4"'), None),
    "a winch": (
        *("", "", ""),
        DRIVE.format('name="winch" tendon="cord"', 2, 0),
        r"armature of actuators on tendons: winch \(line 7\); make",
    ),
    "a winch that rubs": (
        *("", "", ""),
        DRIVE.format('tendon="cord"', 0, 2),
        r"damping of actuators on tendons: actuator_0 \(line 7\); make",
    ),
    "no spring": ("", "", 'stiffness="0" springref="20"', "", None),
    "a spring switched off": (FLAG.format("spring"), "", 'stiffness="3"', "", None),
    "a damped cord switched off": (FLAG.format("damper"), "", "", TENDON.format('damping="4"'), None),
    "a cord that rubs switched off": (FLAG.format("frictionloss"), "", "", TENDON.format('frictionloss="4"'), None),
    "no weight to carry": (FLAG.format("gravity"), 'gravcomp="1"', "", "", None),
    "no gravity": ('gravity="0 0 0"', 'gravcomp="1"', "", "", None),
    "a weight that all drives carry": ("", 'gravcomp="1"', "", CARRYING, None),
    "a weight that one drive carries": ("", 'gravcomp="1"', 'actuatorgravcomp="true"', "", "bodies: shank "),
    "all that is passive switched off": (
        '<flag spring="disable" damper="disable"/>',
        *('gravcomp="1"', 'stiffness="3"', TENDON.format('stiffness="2" damping="3"'), None),
    ),
    "wind without air": ('wind="3 0 0"', "", "", "", None),
    "a drive of a joint": ("", "", "", '<actuator><motor joint="knee" armature="2" damping="3"/></actuator>', None),
    "a drive without rotor": ("", "", "", DRIVE.format('tendon="cord"', 0, 0), None),
}


def written(tmp_path, option, body, joint, after):
    """Write a leg: the hip has damping, which is read."""
    attributes, flags = ("", option) if option.startswith("<") else (option, "")
    text = f"""<mujoco><compiler angle="degree"/>
<option {attributes}>{flags}</option><worldbody><site name="mark"/>
<body name="thigh"><joint name="hip" axis="0 1 0" damping="0.3"/><geom size="0.1" pos="0 0 -0.2"/>
<body name="shank" pos="0.1 0 -0.4" {body}>
<joint name="knee" axis="0 1 0" {joint}/>
<geom size="0.08" pos="0.2 0 -0.2"/><site name="nozzle" pos="0.1 0 -0.4"/></body></body></worldbody>
{after}</mujoco>"""
    path = tmp_path / "leg.xml"
    path.write_text(text)
    return path


def forces(model):
    """Return what MuJoCo needs for a motion without contact: its torques, and friction at this velocity."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = [0.3, -0.5], [1.2, -0.7]
    mujoco.mj_forward(model, data)
    mass = np.zeros((2, 2))
    mujoco.mj_fullM(model, data, mass)
    torque = mass @ [0.4, 0.9] + data.qfrc_bias - data.qfrc_passive
    works = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
    for name in range(model.ntendon if works else 0):
        torque += model.tendon_frictionloss[name] * np.array([0, np.sign(data.ten_velocity[name])])
    return torque


@pytest.mark.parametrize("case", CASES)
def test_it_is_reported_where_mujoco_computes_other_forces(tmp_path, case):
    """Without a warning the torques are those of MuJoCo; with one they are not."""
    *parts, says = CASES[case]
    path = written(tmp_path, *parts)
    if says is None:
        robot = load_robot(path, strict=True)
    else:
        with pytest.warns(jn.errors.RobotWarning, match=says) as caught:
            robot = load_robot(path)
        assert len(caught) == 1
        assert str(caught[0].message).startswith(f"{path}: what follows is left out, and motions and forces are")
    ours = jn.inverse_dynamics(robot, [[0.3, -0.5], [1.2, -0.7], [0.4, 0.9]], drives=True)[0]
    theirs = forces(mujoco.MjModel.from_xml_path(str(path)))
    same = np.allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())
    assert same == (says is None)


@pytest.mark.parametrize(
    "case, says",
    {
        "a progressive spring": r"leg\.xml, line 5, joints\.knee\.stiffness: .* without springs of joints, got \[",
        "a weight that one drive carries": r"line 4, links\.shank\.gravcomp: .* of bodies, got 1\.0;",
        "water": r"line 2, option\.density: .* without forces of the fluid around, got 1000\.0;",
        "a winch": r"line 7, actuators\.winch\.armature: .* without armature of actuators .*, got 2\.0;",
    }.items(),
)
def test_strict_makes_an_error_of_it(tmp_path, case, says):
    path = written(tmp_path, *CASES[case][:-1])
    with pytest.raises(RobotFileError, match=says):
        load_robot(path, strict=True)


def test_a_spring_of_a_joint_that_an_equality_holds_moves_nothing(tmp_path):
    held = '<equality><joint joint1="knee"/></equality>'
    assert load_robot(written(tmp_path, "", "", 'stiffness="3"', held)).joint_names == ("hip",)


def test_one_warning_names_the_first_six_of_each_kind_and_the_faults(tmp_path):
    joints = "".join(
        f'<body name="b{k}" gravcomp="{k % 2}"><joint name="j{k}" stiffness="0 2" '
        f'actuatorgravcomp="{"false" if k else "true"}"/><geom size="0.1"/>'
        for k in range(8)
    )
    rotor = '<body name="rotor"><inertial pos="0 0 0" mass="0" diaginertia="0.2 0.3 0.4"/></body>'
    path = tmp_path / "chain.xml"
    path.write_text(f"<mujoco><worldbody>{joints}{rotor}{'</body>' * 8}</worldbody></mujoco>")
    with pytest.warns(jn.errors.RobotWarning) as caught:
        load_robot(path)
    (warning,) = caught
    springs = ", ".join(f"j{k} (line 1)" for k in range(6))
    carried = ", ".join(f"b{k} (line 1)" for k in range(1, 8, 2))
    assert str(warning.message) == (
        f"{path}: values that no real robot has are used as they are in the file; "
        "moments of inertia have no mass beside them: rotor (line 1); "
        "what follows is left out, and motions and forces are computed without it; "
        f"springs of joints: {springs}, and 2 more; gravity compensation of bodies: {carried}; "
        "correct the file, or make this an error with strict=True (--strict)"
    )


@pytest.mark.parametrize("name", ["five_bar", "human_arm", "planar_arm"])
def test_of_the_examples_nothing_is_left_out(name):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = load_robot(FILES / f"{name}.xml")
    assert caught == []
    assert load_robot(FILES / f"{name}.xml", strict=True).joint_names == found.joint_names != ()


def test_a_weld_of_bodies_that_are_fixed_already_is_left_out(tmp_path):
    path = tmp_path / "robot.xml"
    geom = '<geom size="0.1"/>'
    path.write_text(
        f'<mujoco><worldbody><body name="a"><joint/>{geom}<body name="b">{geom}</body></body></worldbody>'
        '<equality><weld name="w" body1="a" body2="b"/></equality></mujoco>'
    )
    with pytest.warns(jn.errors.RobotWarning, match="closures of links that are fixed to one another: w"):
        assert not jn.load_robot(path).closures
    with pytest.raises(jn.errors.RobotFileError, match="a and b are fixed to one another, and need no closure"):
        jn.load_robot(path, strict=True)


@pytest.mark.parametrize("ends", ['body1="hand"', 'body1="hand" body2="other"'])
def test_a_weld_of_bodies_that_only_a_user_moves_is_left_out(tmp_path, ends):
    path = tmp_path / "robot.xml"
    geom = '<geom size="0.1"/>'
    mocap = "".join(f'<body name="{name}" mocap="true">{geom}</body>' for name in ("hand", "other"))
    path.write_text(
        f"<mujoco><worldbody>{mocap}<body><joint/>{geom}</body></worldbody>"
        f'<equality><weld name="w" {ends}/></equality></mujoco>'
    )
    with pytest.warns(jn.errors.RobotWarning, match="closures of links that are fixed to one another: w"):
        robot = jn.load_robot(path)
    assert not robot.closures
    assert robot.joint_names == ("joint_0",)


def test_a_mocap_body_that_holds_another_stands_still_and_is_told_of(tmp_path):
    """Where MuJoCo lets it stand, too, the arm hangs on it: the closure stays, and only its motion is left out."""
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><worldbody><body name="hand" mocap="true" pos="1 0 0"><geom size="0.1"/></body>'
        '<body name="arm"><joint axis="0 1 0"/><geom size="0.1" pos="1 0 0"/></body></worldbody>'
        '<equality><connect name="grip" body1="arm" body2="hand" anchor="1 0 0"/></equality></mujoco>'
    )
    says = r"motion of mocap bodies, which stand still, with what closures hold to them: hand \(line 1\)"
    with pytest.warns(jn.errors.RobotWarning, match=says):
        robot = jn.load_robot(path)
    assert list(robot.closures) == ["grip"]
    with pytest.raises(jn.errors.RobotFileError, match="computed without motion of mocap bodies"):
        jn.load_robot(path, strict=True)


def stepped(tmp_path, joint="", after=""):
    """Return how far a weightless knee is bent ten seconds after it was let go at half a radian."""
    path = written(tmp_path, 'gravity="0 0 0"', "", f'damping="0.5" {joint}', after)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[1] = 0.5
    for _ in range(5000):
        mujoco.mj_step(model, data)
    return data.qpos[1]


@pytest.mark.parametrize(
    "joint, after, part",
    [
        ('stiffness="9" springyield="10"', "", 'springyield="10"'),
        ("", TENDON.format('stiffness="9" springyield="0.2"'), 'springyield="0.2"'),
    ],
)
def test_springs_that_yield_are_reported(tmp_path, joint, after, part):
    """MuJoCo brings the knee back to where the spring has yielded to, and to zero without yielding."""
    assert stepped(tmp_path, joint, after) > 0.2
    assert abs(stepped(tmp_path, joint.replace(part, ""), after.replace(part, ""))) < 0.01
    path = written(tmp_path, "", "", joint, after)
    with pytest.warns(jn.errors.RobotWarning, match=r"yielding of springs: (knee \(line 5\)|cord \(line 7\)); make"):
        load_robot(path)


@pytest.mark.parametrize("flag, acts", [("", True), (FLAG.format("actuation"), False)])
def test_actuators_without_an_input_are_reported(tmp_path, flag, acts):
    """A motor whose terminals are shorted brakes; it has no control that could be left out."""
    after = '<actuator><dcmotor name="brake" joint="knee" input="none" motorconst="0.3" resistance="2"/></actuator>'
    path = written(tmp_path, flag, "", "", after)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qvel[1] = 2.0
    mujoco.mj_forward(model, data)
    assert data.qfrc_actuator[1] == pytest.approx(-2.0 * 0.3**2 / 2 if acts else 0.0)
    if acts:
        with pytest.warns(jn.errors.RobotWarning, match=r"actuators without an input: brake \(line 7\); make"):
            load_robot(path)
    else:
        load_robot(path, strict=True)


@pytest.mark.parametrize(
    "joint, after, says",
    [
        ('type="ball" range="0 40"', "", r"ranges of balls: knee \(line 5\); make"),
        ("", TENDON.format('range="-0.1 0.2"'), r"ranges of tendons: cord \(line 7\); make"),
        ('type="ball" range="0 40" limited="false"', "", None),
        ("", TENDON.format('range="-0.1 0.2" limited="false"'), None),
    ],
)
@pytest.mark.parametrize("flag", ["", FLAG.format("limit")])
def test_ranges_that_are_not_limits_of_a_joint_are_reported(tmp_path, joint, after, says, flag):
    path = written(tmp_path, flag, "", joint, after)
    if says is None or flag:
        load_robot(path, strict=True)
    else:
        with pytest.warns(jn.errors.RobotWarning, match=says):
            load_robot(path)


def surface_moments(a, b, c, mass):
    """Return the moments of inertia of a surface by quadrature over the cosine of the polar angle and around."""
    z, weights = np.polynomial.legendre.leggauss(200)
    turn = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)
    x, y = (np.sqrt(1 - z**2)[:, None] * part for part in (np.cos(turn), np.sin(turn)))
    z = np.broadcast_to(z[:, None], x.shape)
    area = weights[:, None] * np.sqrt((b * c * x) ** 2 + (a * c * y) ** 2 + (a * b * z) ** 2)
    squares = np.array([(area * (length * part) ** 2).sum() for length, part in ((a, x), (b, y), (c, z))]) / area.sum()
    return mass * (squares.sum() - squares)


SHELL = '<geom {} type="ellipsoid" size="{} {} {}" mass="3"/>'


@pytest.mark.parametrize(
    "size, told", [((0.1, 0.1, 1.0), True), ((1.0, 1.0, 0.1), True), ((0.1, 0.1, 0.1), False), (None, False)]
)
def test_shells_of_ellipsoids_are_as_mujoco_has_them_and_named(tmp_path, size, told):
    """The values are those that MuJoCo simulates; they differ from those of the surface where the warning says so."""
    shape = SHELL.format('shellinertia="true"', *size) if size else SHELL.format("", 0.1, 0.2, 0.3)
    path = tmp_path / "shell.xml"
    path.write_text(f'<mujoco><worldbody>\n<body name="egg"><joint/>\n{shape}</body></worldbody></mujoco>')
    if told:
        with pytest.warns(
            jn.errors.RobotWarning,
            match=r"ellipsoids are those of MuJoCo, which are up to 13 percent wrong: egg \(line 3\); corr",
        ):
            robot = load_robot(path)
        with pytest.raises(RobotFileError, match=r"line 3, links\.egg\.shellinertia: .* give the body an <inertial>"):
            load_robot(path, strict=True)
    else:
        robot = load_robot(path, strict=True)
    moments = np.sort(np.linalg.eigvalsh(robot.links["egg"].inertia.tensor))
    model = mujoco.MjModel.from_xml_path(str(path))
    np.testing.assert_allclose(moments, np.sort(model.body_inertia[1]), rtol=1e-9)
    if size:
        off = np.abs(moments / np.sort(surface_moments(*size, 3.0)) - 1).max()
        assert 0.08 < off < 0.135 if told else off < 2e-5
