"""Every way a robot file can be wrong ends in one message with file, line, name and value, never in a traceback."""

import pathlib
import warnings

import pytest
from ruamel.yaml import YAML

import jounce as jn
from jounce.errors import JounceError, RobotError, RobotFileError
from jounce.io.robots.loader import load_robot

URDF = """\
<?xml version="1.0"?>
<robot name="bad">
  <link name="base"/>
  <!-- one that turns -->
  <link name="arm">
    <inertial>
      <origin xyz="0.3 0 0" rpy="0 0 0"/>
      <mass value="2.5"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.15"/>
    </inertial>
  </link>
  <link name="hand">
    <inertial>
      <mass value="0.5"/>
      <inertia
        ixx="0.01" ixy="0" ixz="0"
        iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
  </link>
  <link name="tool"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.4" rpy="0 0 0.1"/>
    <parent link="base"/> <child link="arm"/>
    <axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="40" velocity="1.5"/>
    <dynamics damping="0.2" friction="0.1"/>
  </joint>
  <joint name="grip" type="prismatic">
    <parent link="arm"/> <child link="hand"/>
    <mimic joint="shoulder" multiplier="0.5"/>
  </joint>
  <joint name="flange" type="fixed"><parent link="hand"/><child link="tool"/></joint>
</robot>
"""
MJCF = """\
<mujoco model="bad">
  <option/>
  <asset><mesh name="hull" file="hull.stl"/></asset>
  <worldbody>
    <body name="one">
      <inertial pos="0.1 0 0" mass="2" diaginertia="0.01 0.02 0.025"/>
      <joint name="hinge" axis="0 1 0" range="-1 1" limited="true"/>
      <!-- its own
           mass from its shape -->
      <body name="two" pos="0.2 0 0">
        <joint name="slide" type="slide" armature="0.1"/>
        <geom size="0.1"/>
      </body>
    </body>
    <body name="spare"/>
  </worldbody>
  <actuator>
    <motor joint="hinge"/>
  </actuator>
  <!-- what closes loops -->
  <equality/>
</mujoco>
"""
FILES = {"urdf": (URDF, ".urdf"), "mjcf": (MJCF, ".xml")}
CASES = YAML(typ="safe").load(pathlib.Path(__file__).with_name("bad_robots.yaml"))


@pytest.mark.parametrize(
    "kind, what", [pytest.param(kind, what, id=f"{kind}-{what}") for kind in CASES for what in CASES[kind]]
)
def test_file_with_one_mistake(tmp_path, kind, what):
    case, (text, ending) = CASES[kind][what], FILES[kind]
    assert case["instead_of"] in text
    path = tmp_path / f"file{ending}"
    path.write_text(text.replace(case["instead_of"], case["text"], 1).replace(*case.get("also", ("", ""))))
    with pytest.raises(RobotFileError) as caught:
        load_robot(path, strict=True)
    place = [
        str(path),
        *([f"line {case['line']}"] if "line" in case else []),
        *([case["name"]] if "name" in case else []),
    ]
    message = str(caught.value)
    assert message.startswith(
        f"{', '.join(place)}: {case['says']}" if "MuJoCo" not in message else ", ".join(place) + ": "
    )
    assert case["says"] in message
    assert message.isprintable()


@pytest.mark.parametrize("kind", FILES)
def test_the_files_without_mistakes_are_read(tmp_path, kind):
    text, ending = FILES[kind]
    path = tmp_path / f"good{ending}"
    path.write_text(text)
    assert load_robot(path).joint_names


@pytest.mark.parametrize(
    "content, says",
    [
        (b"", ": the file is empty"),
        (b" \n\t", ": the file is empty"),
        (b"hello", ", line 1: is not well-formed XML: syntax error at column 1"),
        (b"\x89PNG\r\n\x1a\n", ", line 1: is not well-formed XML: not well-formed (invalid token) at column 1"),
        (
            b"<robot>\n\x00\x00\x00</robot>",
            ", line 2: is not a text file: robots are read from URDF, MJCF and SDF, all XML",
        ),
        (b"<robot>\n<link name='\xff'/></robot>", ", line 2: is not well-formed XML: not well-formed (invalid token)"),
        (b"<?xml version='1.0' encoding='klingon'?><robot/>", ": is in no encoding that can be read: unknown encoding"),
        (
            b"<world/>",
            ", line 1: is not a robot file, got '<world>'; the root element of a URDF is <robot>, of an MJCF file",
        ),
        (b"<robot/>", ", line 1: a robot needs at least one <link>"),
        (b"<a>" * 3000, ", line 1: nested more than 2000 deep"),
        (b"<mujoco/>", ": MuJoCo reads MJCF only from files whose names end in .xml; rename it"),
        (
            "<robot>\n<link name='a\u200b'/>\n<link name='b\u200b'/></robot>".encode(),
            ", line 3, links: exactly one link",
        ),
    ],
)
def test_content_that_is_no_robot(tmp_path, content, says):
    path = tmp_path / "file.urdf"
    path.write_bytes(content)
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    assert str(caught.value).startswith(f"{path}{says}")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "name, says",
    [
        ("missing.urdf", "file not found"),
        ("folder.urdf", "is a directory, a file is needed"),
        (
            "robot.urdf.xacro",
            "is a xacro file, which must first be expanded to a URDF; run: xacro FILE.urdf.xacro > FILE",
        ),
        ("robot.yaml", "the kind of a robot file is given by its extension; valid: .urdf, .xml"),
        ("robot", "the kind of a robot file is given by its extension; valid: .urdf, .xml"),
        ("a\0b.urdf", "cannot be read: "),
    ],
)
def test_name_of_no_robot_file(tmp_path, name, says):
    (tmp_path / "folder.urdf").mkdir()
    with pytest.raises(RobotFileError) as caught:
        load_robot(f"{tmp_path}/{name}")
    shown = name.replace("\0", "\\x00")  # no terminal is given a control character
    assert str(caught.value).startswith(f"{tmp_path}/{shown}: {says}")


def test_a_name_nearly_right(tmp_path):
    (tmp_path / "panda.urdf").write_text(URDF)
    with pytest.raises(RobotFileError, match=r"file not found; did you mean 'panda.urdf'\?"):
        load_robot(tmp_path / "pandas.urdf")


def test_bodies_nested_deeper_than_mujoco_takes(tmp_path):
    path = tmp_path / "chain.xml"
    path.write_text("<mujoco><worldbody>" + "<body>" * 1500 + "</body>" * 1500 + "</worldbody></mujoco>")
    with pytest.raises(RobotFileError, match=r"line 1: MuJoCo .*nesting is too deep") as caught:
        load_robot(path)
    assert str(caught.value).isprintable()


def test_no_name():
    with pytest.raises(RobotFileError, match="the name of a file is needed, got ''"):
        load_robot("")


def test_a_sequence_of_turns_that_is_none(tmp_path):
    path = tmp_path / "file.urdf"
    path.write_text(URDF)
    with pytest.raises(RobotError, match=r"sequence: .*neighbors differ, got 'XXY'"):
        load_robot(path, floating_base="XXY")


def test_names_that_an_expanded_joint_needs(tmp_path):
    path = tmp_path / "file.urdf"
    text = URDF.replace('type="fixed"', 'type="planar"').replace(
        '<link name="tool"/>', '<link name="tool"/><link name="x"/>'
    )
    path.write_text(text.replace('"x"', '"flange_frame_1"'))
    with pytest.raises(RobotFileError, match=r"line 2, links: .*name, got 'flange_frame_1'"):
        load_robot(path)


@pytest.mark.parametrize("kind", FILES)
def test_a_file_cut_short_anywhere_is_refused_or_read(tmp_path, kind):
    text, ending = FILES[kind]
    path = tmp_path / f"file{ending}"
    for length in range(0, len(text) - 1, 37):
        path.write_text(text[:length])
        with pytest.raises(JounceError):
            load_robot(path)


def message_of(path):
    """Return what is wrong with a file, None where nothing is."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jn.errors.RobotWarning)
            load_robot(path)
    except JounceError as error:
        return str(error)
    return None


@pytest.mark.parametrize("kind", FILES)
@pytest.mark.parametrize("value", ["", " ", "nan", "1e400", "-1", "0", "x y z", "base", "\u00e9", "1 2 3 4"])
def test_any_attribute_replaced_by_another_value_ends_in_a_message_or_a_robot(tmp_path, kind, value):
    text, ending = FILES[kind]
    path = tmp_path / f"file{ending}"
    at = 0
    while (at := text.find('="', at + 2)) >= 0:
        end = text.index('"', at + 2)
        path.write_text(text[: at + 2] + value + text[end:])
        said = message_of(path)
        assert said is None or said.startswith(str(path))
