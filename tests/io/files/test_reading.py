"""Files that are read: regular ones, of bounded size, below the folder of the file that names them."""

import os
import pathlib
import socket
import threading

import numpy as np
import pytest

import jounce as jn
from jounce.errors import JounceError, MechanismFileError, OutputError, RobotFileError
from jounce.io import load_limits, read
from jounce.io.files.reading import known_name, named_file, read_file, written_name
from jounce.io.mechanisms.user_classes import import_file

MECHANISM = """space: planar
bodies: {{slider: {{position: [0, 0]}}}}
joints: {{guide: {{type: prismatic, bodies: [ground, slider], points: [[0, 0], [0, 0]], vectors: [[1, 0], [1, 0]]}}}}
drivers:
  drive:
    type: coordinate
    bodies: [ground, slider]
    coordinate: x
    motion: {{samples: {samples}}}
"""
TABLE = "time,value\n" + "".join(f"{0.1 * k},{(0.1 * k) ** 2}\n" for k in range(11))
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
SHAPED = """<mujoco>{head}<asset><mesh name="part" file="{mesh}"/></asset>
<worldbody><body name="arm"><joint name="pin"/><geom type="mesh" mesh="part"/></body></worldbody></mujoco>"""
URDF = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><visual><geometry><mesh filename="{mesh}"/>
</geometry></visual></link>
<joint name="pin" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>"""


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    """Two folders, one beside the other; a reader that waits for a pipe fails rather than hangs."""
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "here")


def mechanism(samples, folder="."):
    path = pathlib.Path(folder, "cam.yaml")
    path.write_text(MECHANISM.format(samples=samples))
    return path


def no_files(folder):
    """Make what is at a path and is no regular file, by kind."""
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    listening = socket.socket(socket.AF_UNIX)
    listening.bind(str(folder / "socket"))
    listening.close()
    (folder / "zero").symlink_to("/dev/zero")
    (folder / "terminal").symlink_to("/dev/tty")
    (folder / "circle").symlink_to("circle")
    return ["pipe", "folder", "socket", "zero", "terminal", "circle"]


def fails_soon(call, *kinds):
    """Raise of the family within two seconds, from a thread that may be left waiting."""
    found = []

    def attempt():
        try:
            call()
        except BaseException as error:  # noqa: BLE001 - handed on
            found.append(error)

    thread = threading.Thread(target=attempt, daemon=True)
    thread.start()
    thread.join(20)
    assert found, "waits, or does not fail"
    assert isinstance(found[0], kinds or JounceError), repr(found[0])
    return found[0]


def test_whatever_is_no_regular_file_is_refused_by_every_reader():
    robot = jn.Robot("r", [jn.Link("base"), jn.Link("arm", jn.Inertia(1.0))], [jn.Joint("pin", "base", "arm")])
    readers = {
        ".yaml": (jn.load, jn.load_trajectory, lambda path: load_limits(path, robot)),
        ".csv": (jn.load_trajectory, read),
        ".urdf": (jn.load_robot,),
        ".xml": (jn.load_robot,),
        ".py": (import_file,),
        ".nc": (read,),
    }
    for name in no_files(pathlib.Path()):
        for ending, calls in readers.items():
            path = pathlib.Path(name).rename(f"{name}{ending}") if name != "circle" else pathlib.Path(name)
            for call in calls:
                error = fails_soon(lambda call=call, path=path: call(path))
                assert name in str(error)
            if name != "circle":
                path.rename(name)


def test_samples_that_are_no_regular_file_are_refused():
    for name in no_files(pathlib.Path()):
        error = fails_soon(lambda name=name: jn.load(mechanism(name)), MechanismFileError)
        assert error.line == 9
        assert name in str(error)


def test_files_named_elsewhere_are_refused_unless_their_folder_is_allowed(tmp_path):
    table = tmp_path / "there" / "lift.csv"
    table.write_text(TABLE)
    pathlib.Path("link.csv").symlink_to(table)
    pathlib.Path("folder").symlink_to(tmp_path / "there")
    for name in ("../there/lift.csv", str(table), "link.csv", "folder/lift.csv", "/dev/zero", "/proc/self/environ"):
        error = fails_soon(lambda name=name: jn.load(mechanism(name)), MechanismFileError)
        assert (error.line, error.name) == (9, "drivers.drive.motion")
        assert "outside the folder" in error.message
        assert "--allow" in error.message
    for name in ("../there/lift.csv", str(table), "link.csv", "folder/lift.csv"):
        law = jn.load(mechanism(name), allow=[tmp_path / "there"]).drivers["drive"].motion
        assert float(law.coefficients[0, 0]) == pytest.approx(0.0, abs=1e-12)
    fails_soon(lambda: jn.load(mechanism("/dev/zero"), allow=["/"]), MechanismFileError)


def test_folders_of_a_similar_name_are_others(tmp_path):
    (tmp_path / "here2").mkdir()
    (tmp_path / "here2" / "lift.csv").write_text(TABLE)
    with pytest.raises(MechanismFileError, match="outside the folder"):
        jn.load(mechanism("../here2/lift.csv"))


def test_files_below_the_folder_are_found_by_any_name(tmp_path):
    pathlib.Path("data").mkdir()
    pathlib.Path("data", "lift.csv").write_text(TABLE)
    for name in ("data/lift.csv", "data/../data/lift.csv", str(tmp_path / "here" / "data" / "lift.csv")):
        jn.load(mechanism(name))
    (tmp_path / "there" / "cam.yaml").symlink_to(mechanism("data/lift.csv").resolve())
    with pytest.raises(MechanismFileError, match=r"file of samples not found"):
        jn.load(tmp_path / "there" / "cam.yaml")  # named from the folder in which the user has it, as ever
    (tmp_path / "there" / "data").symlink_to(tmp_path / "here" / "data")
    jn.load(tmp_path / "there" / "cam.yaml")  # and in that of the file itself


def test_a_folder_to_allow_must_be_there():
    with pytest.raises(MechanismFileError, match="must be a folder that exists, got 'none'"):
        jn.load(mechanism("lift.csv"), allow=["none"])


def test_the_size_is_bounded_also_where_the_system_does_not_tell_it(tmp_path):
    path = pathlib.Path("large.yaml")
    with path.open("wb") as stream:
        stream.truncate(10_000_001)  # a hole, no data
    with pytest.raises(MechanismFileError, match="at most 10 MB"):
        jn.load(path)
    endless = pathlib.Path("/proc/kallsyms")  # tells size 0
    if not endless.exists():
        endless = pathlib.Path("/proc/self/maps")
    with pytest.raises(MechanismFileError, match="at most"):
        read_file(endless, 100)


def test_too_many_rows_of_samples_are_refused(monkeypatch):
    monkeypatch.setattr("jounce.io.files.reading.MAX_ROWS", 5)
    pathlib.Path("lift.csv").write_text(TABLE)
    with pytest.raises(MechanismFileError, match="more than 5 rows") as caught:
        jn.load(mechanism("lift.csv"))
    assert "line 6" in str(caught.value)


def test_included_files_and_meshes_of_mjcf(tmp_path):
    pathlib.Path("part.obj").write_text(TETRAHEDRON)
    (tmp_path / "there" / "part.obj").write_text(TETRAHEDRON)
    (tmp_path / "there" / "arm.xml").write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    pathlib.Path("link.obj").symlink_to(tmp_path / "there" / "part.obj")
    os.mkfifo("pipe.obj")
    path = pathlib.Path("robot.xml")

    def load(text, **options):
        path.write_text(text)
        return jn.load_robot(path, **options)

    assert load(SHAPED.format(head="", mesh="part.obj")).mass > 0
    refused = [
        SHAPED.format(head="", mesh="/dev/zero"),
        SHAPED.format(head="", mesh="pipe.obj"),
        SHAPED.format(head="", mesh="link.obj"),
        SHAPED.format(head="", mesh="../there/part.obj"),
        SHAPED.format(head='<compiler meshdir="../there"/>', mesh="part.obj"),
        "<mujoco><include file='/dev/zero'/></mujoco>",
        "<mujoco><include file='pipe.obj'/></mujoco>",
        "<mujoco><include file='../there/arm.xml'/></mujoco>",
        "<mujoco><asset><model name='a' file='../there/arm.xml'/></asset></mujoco>",
        "<mujoco><worldbody><flexcomp name='a' type='mesh' file='/dev/zero'/></worldbody></mujoco>",
    ]
    for text in refused:
        error = fails_soon(lambda text=text: load(text), RobotFileError)
        assert "MuJoCo" not in str(error)
    assert load(refused[4], allow=[tmp_path / "there"]).mass > 0
    with pytest.raises(RobotFileError, match=r"robot\.xml, line 2, include: is a directory.*, got '\.'"):
        load("<mujoco>\n<include file='.'/></mujoco>")


def test_numbers_of_included_files_are_checked_and_no_log_is_left():
    pathlib.Path("parts").mkdir()
    main = "<mujoco><include file='parts/a.xml'/></mujoco>"
    pathlib.Path("robot.xml").write_text(main)
    pathlib.Path("parts", "a.xml").write_text("<mujoco><include file='b.xml'/></mujoco>")
    arm = "<body name='arm'><joint name='pin' range='0 {}'/><geom size='1'/></body>"
    body = f"<mujoco>\n<worldbody>{arm}</worldbody></mujoco>"
    pathlib.Path("parts", "b.xml").write_text(body.format("1"))
    assert jn.load_robot("robot.xml").joint_names == ("pin",)
    pathlib.Path("parts", "b.xml").write_text(body.format("nan"))
    with pytest.raises(RobotFileError, match="must be 2 finite numbers") as caught:
        jn.load_robot("robot.xml")
    assert (pathlib.Path(caught.value.path).name, caught.value.line) == ("b.xml", 2)
    pathlib.Path("b.xml").write_text(body.format("1"))  # beside the main file goes first, as MuJoCo has it
    assert jn.load_robot("robot.xml").joint_names == ("pin",)
    assert sorted(file.name for file in pathlib.Path().iterdir()) == ["b.xml", "parts", "robot.xml"]


def test_what_mujoco_warns_of_leaves_no_log():
    joint = "<joint name='pin' actuatorfrcrange='0 1e400'/>"
    pathlib.Path("robot.xml").write_text(
        f"<mujoco><worldbody><body name='arm'>{joint}<geom size='1'/></body></worldbody></mujoco>"
    )
    with pytest.raises(RobotFileError):
        jn.load_robot("robot.xml")
    assert not pathlib.Path("MUJOCO_LOG.TXT").exists()


def test_meshes_that_are_shown(tmp_path):
    pytest.importorskip("trimesh")
    from jounce.viewer.shapes.robot_shapes import file_shapes

    path = pathlib.Path("robot.urdf").resolve()

    def shown(mesh, **options):
        path.write_text(URDF.format(mesh=mesh))
        return len(file_shapes(path, **options)["arm"])

    for folder in ("here", "there"):
        (tmp_path / folder / "part.obj").write_text(TETRAHEDRON)
    os.mkfifo("pipe.obj")
    (tmp_path / "here" / "lists.obj").write_text(f"mtllib {tmp_path}/there/pipe\nusemtl a\n{TETRAHEDRON}")
    os.mkfifo(tmp_path / "there" / "pipe")
    for mesh in ("part.obj", "package://here/part.obj", "package://there/part.obj", f"file://{tmp_path}/here/part.obj"):
        assert shown(mesh) == 1, mesh
    assert shown("../there/part.obj", allow=[tmp_path / "there"]) == 1
    installed = tmp_path / "opt" / "share"
    (installed / "parts" / "meshes").mkdir(parents=True)
    (installed / "parts" / "meshes" / "part.obj").write_text(TETRAHEDRON)
    assert [shown("package://parts/meshes/part.obj", allow=x) for x in ([], [installed])] == [0, 1]
    assert shown("none.obj") == 0
    for mesh in ("../there/part.obj", f"file://{tmp_path}/there/part.obj", "pipe.obj", "package://../../etc/passwd"):
        with pytest.warns(UserWarning, match="a mesh is not shown"):
            assert shown(mesh) == 0, mesh
    found = []
    reading = threading.Thread(target=lambda: found.append(shown("lists.obj")), daemon=True)
    reading.start()
    reading.join(20)
    assert found, "waits for the pipe that a mesh names"


def test_columns_whose_names_are_formulas(tmp_path):
    """A spreadsheet takes no name of a column for a formula, and they come back as they were."""
    import csv

    names = ['=HYPERLINK("x")', "+1", "-1", "@SUM(A1)", "'", "'=1", "psi", "a'b"]
    from xarray import Dataset

    values = {name: (("time", "derivative"), np.full((5, 1), float(k))) for k, name in enumerate(names)}
    dataset = Dataset(values, coords={"time": np.arange(5.0), "derivative": [0]})
    jn.io.write(dataset, tmp_path / "motion.csv")
    with (tmp_path / "motion.csv").open(newline="") as stream:
        header = next(csv.reader(stream))
    assert not [name for name in header if name[0] in "=+-@\t\r"]
    back = read(tmp_path / "motion.csv")
    assert [str(name) for name in back.data_vars] == names
    assert all(known_name(written_name(name)) == name for name in names)
    assert jn.load_trajectory(tmp_path / "motion.csv", degree=3).names == tuple(names)


def test_names_that_no_system_takes():
    for name in ("a\0b", "x" * 5000):
        with pytest.raises(MechanismFileError):
            read_file(named_file(name, "cam.yaml"))
    with pytest.raises(OutputError):
        read("a\0b.csv")


def test_a_name_that_no_file_can_have():
    with pytest.raises(MechanismFileError, match="given by its extension") as caught:
        jn.load("n" * 100_000)
    assert len(str(caught.value)) < 5000
