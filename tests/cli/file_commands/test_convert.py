"""``jounce convert``: formats, units kept, robots that become mechanisms with the same torques."""

import functools
import json
import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.io.files.source import read_source

ROOT = pathlib.Path(__file__).resolve().parents[3]
FOUR_BAR = ROOT / "examples" / "four_bar.yaml"
ROBOTS = ROOT / "examples" / "robots"


@pytest.fixture(autouse=True)
def _here(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def call(run):
    return functools.partial(run, "convert")


def test_formats_turn_into_each_other_with_values_as_written(call):
    before = read_source(FOUR_BAR).data
    previous = FOUR_BAR
    for name in ("a.toml", "b.json", "c.yaml", "d.json", "e.toml", "f.yml"):
        status, out, err = call(previous, name)
        assert (status, out) == (0, f"Written to {name}\n")
        assert ("comments" in err) == (previous is FOUR_BAR and "#" in FOUR_BAR.read_text())
        found = read_source(name).data
        assert found == before
        assert found["parameters"]["BC"] == "14.23 cm"
        assert found["drivers"]["theta"]["motion"] == "30*deg + 60*deg*sin(2*pi*t/tau)"
        assert jn.load(name) == jn.load(FOUR_BAR)
        previous = name


def test_comments_that_are_lost_are_reported(call):
    status, _, err = call(ROOT / "examples" / "press.yaml", "press.toml")
    assert status == 0
    assert err.startswith("warning: the comments of ")


def test_text_that_looks_like_a_number_stays_text(call):
    pathlib.Path("a.json").write_text(
        '{"space": "planar", "title": "1e3", "parameters": {"a": "1e-2", "b": 0.1},'
        '"bodies": {"7": {"position": [0, "a"]}}}'
    )
    for suffix in ("yaml", "toml"):
        assert call("a.json", f"b.{suffix}")[0] == 0
        data = read_source(f"b.{suffix}").data
        assert data["title"] == "1e3"
        assert data["parameters"] == {"a": "1e-2", "b": 0.1}
        assert list(data["bodies"]) == ["7"]


def test_samples_go_with_the_file_to_another_folder(call, tmp_path):
    there = tmp_path / "there"
    there.mkdir()
    t = np.linspace(0, 1, 21)
    np.savetxt("lift.csv", np.stack([t, t**3], axis=1), delimiter=",")
    text = FOUR_BAR.read_text()
    law = text[text.index("motion: ") : text.index("}", text.index("motion: "))]
    pathlib.Path("a.yaml").write_text(text.replace(law, "motion: {samples: lift.csv, degree: 5}"))
    assert call("a.yaml", there / "b.json")[0] == 0
    assert read_source(there / "b.json").data["drivers"]["theta"]["motion"]["samples"] == "lift.csv"
    assert (there / "lift.csv").read_bytes() == pathlib.Path("lift.csv").read_bytes()
    first, second = (jn.load(path).drivers["theta"].motion for path in ("a.yaml", there / "b.json"))
    assert np.array_equal(first.coefficients, second.coefficients)


@pytest.mark.parametrize(
    "arguments, part",
    [
        ((FOUR_BAR, "a.txt"), "valid: .yaml, .yml, .toml, .json"),
        ((FOUR_BAR, "no/where/a.json"), "does not exist"),
        (("none.yaml", "a.json"), "file not found"),
        (("none.stl", "a.json"), "given by its extension"),
        ((ROOT / "examples" / "broken" / "unknown_type.yaml", "a.json"), "unknown_type.yaml, line"),
        ((FOUR_BAR, "a.json", "--hold"), "--hold: is for robots"),
        ((ROBOTS / "scara.urdf", "a.yaml", "--drive", "elbo=1"), "did you mean 'elbow'"),
        ((ROBOTS / "scara.urdf", "a.yaml", "--drive", "elbow=5 cm"), "expected an angle"),
        ((ROBOTS / "scara.urdf", "a.yaml", "--start", "elbow=t"), "--start elbow"),
        ((ROBOTS / "scara.urdf", "a.yaml", "--start", "elbow"), "JOINT=VALUE"),
        ((ROBOTS / "five_bar.xml", "a.yaml", "--hold"), "loops depend on one another"),
    ],
)
def test_bad_calls_write_nothing(call, tmp_path, arguments, part):
    status, out, err = call(*arguments)
    assert (status, out) == (2, "")
    assert part in err
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_there_is_kept_unless_forced(call):
    path = pathlib.Path("a.json")
    path.write_text("mine")
    assert call(FOUR_BAR, path)[0] == 2
    assert path.read_text() == "mine"
    assert call(FOUR_BAR, path, "--force")[0] == 0
    assert json.loads(path.read_text())["space"] == "planar"


PENDULUM = """<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/>
<mass value="2"/><inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.slow
def test_the_torque_of_a_pendulum_from_a_file_made_of_a_robot(call):
    pathlib.Path("p.urdf").write_text(PENDULUM)
    status, out, err = call("p.urdf", "p.yaml", "--drive", "pin=0.5*t**2")
    assert (status, err) == (0, "")
    assert out.splitlines()[-1] == "  jounce run p.yaml"
    motion = jn.solve(jn.load("p.yaml"), np.array([0.0, 1.0]), order=2)
    torque = (0.2 + 2 * 0.25) * 1.0 + 2 * 9.81 * 0.5 * np.sin([0.0, 0.5])
    np.testing.assert_allclose(motion.outputs["pin_torque"][:, 0], torque, rtol=1e-12)


def test_loops_of_a_file_beside_the_robot_are_closed_in_the_mechanism_too(call):
    """A second pendulum that is welded to the first."""
    second = PENDULUM[PENDULUM.index("<link", PENDULUM.index("<link") + 1) : PENDULUM.index("</robot>")]
    second = second.replace('"rod"', '"other"').replace('"pin"', '"free"')
    pathlib.Path("p.urdf").write_text(PENDULUM.replace("</robot>", second + "</robot>"))
    frames = "[{link: rod, xyz: [0, 0, 1]}, {link: other, xyz: [0, 0, 1]}]"
    pathlib.Path("weld.yaml").write_text(f"closures:\n  w: {{type: weld, frames: {frames}}}\n")
    status, _, err = call("p.urdf", "p.yaml", "--drive", "pin=0.5*t**2", "--closures", "weld.yaml")
    assert (status, err) == (0, "")
    motion = jn.solve(jn.load("p.yaml"), np.array([0.0, 1.0]), order=2)
    torque = 2 * ((0.2 + 2 * 0.25) * 1.0 + 2 * 9.81 * 0.5 * np.sin([0.0, 0.5]))
    np.testing.assert_allclose(motion.outputs["pin_torque"][:, 0], torque, rtol=1e-12)
    status, _, err = call("p.yaml", "p.json", "--closures", "weld.yaml")
    assert (status, err) == (2, "error: p.yaml, --closures: is for robots; a mechanism file keeps its drivers\n")


ROD = """<inertial><origin xyz="0.1 0.05 -0.5"/><mass value="2"/>
<inertia ixx="0.2" iyy="0.25" izz="0.1" ixy="0.01" ixz="0.02" iyz="0.03"/></inertial>"""
TREE = f"""<robot name="tree"><link name="base"/><link name="cart">{ROD}</link><link name="left">{ROD}</link>
<link name="right">{ROD}</link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="0.6 0 0.8"/>
<limit lower="-1" upper="1" effort="100" velocity="1"/></joint>
<joint name="one" type="continuous"><parent link="cart"/><child link="left"/>
<origin xyz="0.2 0.1 0.3" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/></joint>
<joint name="two" type="continuous"><parent link="cart"/><child link="right"/><origin xyz="-0.2 0 0"/>
<axis xyz="1 0 0"/></joint></robot>"""


@pytest.mark.slow
def test_a_robot_becomes_a_mechanism_with_the_torques_of_inverse_dynamics(call):
    """Slides and turns, driven and held, of a robot that branches."""
    pathlib.Path("tree.urdf").write_text(TREE)
    laws = {"slide": "0.02*sin(3*t)", "one": "0.4*sin(2*t)"}
    options = [part for name, law in laws.items() for part in ("--drive", f"{name}={law}")]
    status, out, err = call("tree.urdf", "tree.toml", *options, "--hold", "--start", "two=30 deg")
    assert (status, err) == (0, "")
    assert "jounce run tree.toml" in out
    mechanism, robot = jn.load("tree.toml"), jn.load_robot("tree.urdf")
    time = np.linspace(0.0, 1.0, 4)
    motion = jn.solve(mechanism, time, order=3)
    laws["two"] = f"{np.pi / 6!r}"
    q = jn.JointTrajectory(laws, 0.0, 1.0).derivatives(time, 3, names=robot.joint_names)
    tau = np.asarray(jn.inverse_dynamics(robot, q))
    for k, name in enumerate(robot.joint_names):
        word = "torque" if robot.joints[name].turning else "force"
        np.testing.assert_allclose(motion.outputs[name], q[..., k], rtol=0, atol=1e-11)
        found = motion.outputs[f"{name}_{word}"]
        np.testing.assert_allclose(found[:, :2], tau[..., k], rtol=1e-9, atol=1e-10)


def test_names_that_files_do_not_take_are_changed_and_reported(call):
    text = (ROBOTS / "scara.urdf").read_text().replace('"elbow"', '"elbow joint"').replace('"wrist"', '"time"')
    pathlib.Path("odd.urdf").write_text(text)
    status, out, err = call("odd.urdf", "odd.yaml")
    assert status == 0
    assert "jounce simulate odd.yaml" in out
    assert "'elbow joint' is called 'elbow_joint'" in err
    assert {"elbow_joint", "time_"} <= set(jn.load("odd.yaml").joints)


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(ROBOTS.iterdir()), ids=lambda p: p.name)
def test_every_robot_of_the_examples(call, path):
    status, _, err = call(path, "a.yaml")
    assert (status, err) == (0, "")
    mechanism, robot = jn.load("a.yaml"), jn.load_robot(path)
    made = robot.mechanism()
    assert mechanism.joints.keys() == made.joints.keys()
    assert sum(body.mass or 0 for body in mechanism.bodies.values()) == pytest.approx(
        sum(body.mass or 0 for body in made.bodies.values()), rel=1e-15
    )
