"""Files that are written: whole, with the permissions of those they replace, and never onto what was read."""

import os
import pathlib
import signal
import stat
import subprocess
import sys

import numpy as np
import pytest
from xarray import Dataset

import jounce as jn
from jounce.errors import OutputError
from jounce.io import read, write, write_parts
from jounce.io.files.writing import replacing

ROOT = pathlib.Path(__file__).resolve().parents[3]
MECHANISM = """space: planar
bodies: {slider: {position: [0, 0]}}
joints: {guide: {type: prismatic, bodies: [ground, slider], points: [[0, 0], [0, 0]], vectors: [[1, 0], [1, 0]]}}
drivers: {drive: {type: coordinate, bodies: [ground, slider], coordinate: x, motion: {samples: lift.csv}}}
outputs: {P: {body: slider, point: [0, 0]}}
time: {stop: 1, count: 3}
"""
TABLE = "time,value\n" + "".join(f"{0.1 * k},{(0.1 * k) ** 2}\n" for k in range(11))


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pathlib.Path("cam.yaml").write_text(MECHANISM)
    pathlib.Path("lift.csv").write_text(TABLE)


def results(value=0.0, count=2):
    values = np.full((count, 1), value)
    return Dataset({"x": (("time", "derivative"), values)}, coords={"time": np.arange(float(count)), "derivative": [0]})


def names():
    return sorted(path.name for path in pathlib.Path().iterdir())


@pytest.mark.parametrize("alias", ["lift.csv", "./lift.csv", "link.csv", "hard.csv"])
def test_an_input_is_no_place_for_results(run, alias):
    pathlib.Path("link.csv").symlink_to("lift.csv")
    pathlib.Path("hard.csv").hardlink_to("lift.csv")
    before = names()
    for command in ("run", "simulate"):
        status, out, err = run(command, "cam.yaml", "--out", alias)
        assert (status, out) == (2, "")
        assert "--overwrite" in err
        assert alias.removeprefix("./") in err
    assert pathlib.Path("lift.csv").read_text() == TABLE
    assert names() == before
    jn.load("cam.yaml")
    for put in (lambda: write(results(), alias), lambda: write_parts([results()], alias, 1)):
        with pytest.raises(OutputError, match="overwrite=True"):
            put()
    assert pathlib.Path("lift.csv").read_text() == TABLE


@pytest.mark.slow
def test_an_input_is_replaced_where_that_is_asked_for(run):
    status, out, _ = run("run", "cam.yaml", "--out", "lift.csv", "--overwrite", "--order", "0")
    assert status == 0
    assert "Written to lift.csv" in out
    assert pathlib.Path("lift.csv").read_text().startswith("time,P_x")


def test_a_mechanism_is_not_written_onto_its_source_unasked():
    mechanism = jn.load("cam.yaml")
    with pytest.raises(OutputError, match="overwrite=True"):
        jn.write_mechanism(mechanism, "cam.yaml")
    pathlib.Path("other").symlink_to(".")
    with pytest.raises(OutputError, match="overwrite=True"):
        jn.write_mechanism(mechanism, "other/cam.yaml")
    assert pathlib.Path("cam.yaml").read_text() == MECHANISM
    jn.write_mechanism(mechanism, "cam.yaml", overwrite=True)
    assert jn.load("cam.yaml").title == mechanism.title
    assert pathlib.Path("lift.csv").read_text() == TABLE


def test_samples_beside_a_mechanism_are_not_replaced_unasked():
    """The name that the writer would give them is that of the samples."""
    pathlib.Path("lift.csv").rename("new_drivers_drive_motion.csv")
    pathlib.Path("cam.yaml").write_text(MECHANISM.replace("lift.csv", "new_drivers_drive_motion.csv"))
    mechanism = jn.load("cam.yaml")
    with pytest.raises(OutputError, match=r"new_drivers_drive_motion\.csv: was read"):
        jn.write_mechanism(mechanism, "new.yaml")
    assert names() == ["cam.yaml", "new_drivers_drive_motion.csv"]
    assert pathlib.Path("new_drivers_drive_motion.csv").read_text() == TABLE


def test_earlier_results_are_replaced_as_ever():
    for value in (1.0, 2.0):
        for name in ("motion.csv", "motion.nc"):
            write(results(value), name)
            assert float(read(name).x[0, 0]) == value  # read as results, not as an input
    mechanism = jn.load("cam.yaml")
    for _ in range(2):
        jn.write_mechanism(mechanism, "copy.toml")
        assert jn.load("copy.toml").space == "planar"  # what this process wrote stays a result of its own
    pathlib.Path("copy.toml").write_text(pathlib.Path("copy.toml").read_text() + "\n# changed by hand\n")
    jn.load("copy.toml")
    with pytest.raises(OutputError):
        jn.write_mechanism(mechanism, "copy.toml")


def test_a_figure_does_not_replace_an_input():
    from matplotlib.figure import Figure

    from jounce.io.files.reading import read_file
    from jounce.plot import save

    pathlib.Path("part.png").write_bytes(b"texture of a part")
    read_file("part.png")
    with pytest.raises(OutputError):
        save(Figure(), "part.png")
    save(Figure(), "part.png", overwrite=True)
    assert pathlib.Path("part.png").read_bytes().startswith(b"\x89PNG")


def test_converting_onto_the_source_is_refused_and_done_when_asked(run):
    for name in ("cam.yaml", "./cam.yaml"):
        assert run("convert", "cam.yaml", name)[0] == 2
    assert pathlib.Path("cam.yaml").read_text() == MECHANISM
    pathlib.Path("there").mkdir()
    pathlib.Path("there", "lift.csv").write_text("mine")
    status, _, err = run("convert", "cam.yaml", "there/cam.json")
    assert status == 2
    assert "lift.csv" in err
    assert [path.name for path in pathlib.Path("there").iterdir()] == ["lift.csv"]
    assert run("convert", "cam.yaml", "there/cam.json", "--overwrite")[0] == 0
    assert jn.load("there/cam.json").space == "planar"


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o755])
def test_permissions_are_kept(mode):
    path = pathlib.Path("motion.csv")
    path.write_text("old")
    path.chmod(mode)
    write(results(), path)
    assert stat.S_IMODE(path.stat().st_mode) == mode
    assert path.read_text().startswith("time")


def test_new_files_have_the_usual_permissions():
    before = os.umask(0o027)
    try:
        write(results(), "motion.nc")
    finally:
        os.umask(before)
    assert stat.S_IMODE(pathlib.Path("motion.nc").stat().st_mode) == 0o640


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away")
def test_the_owner_is_kept():
    path = pathlib.Path("motion.csv")
    path.write_text("old")
    os.chown(path, 1234, 2345)
    write(results(), path)
    assert (path.stat().st_uid, path.stat().st_gid) == (1234, 2345)


def test_the_owner_is_kept_where_files_cannot_be_given_away(monkeypatch):
    path = pathlib.Path("motion.csv")
    path.write_text("old and longer than what comes" * 10)
    path.chmod(0o664)
    number = path.stat().st_ino
    monkeypatch.setattr("jounce.io.files.writing._copy_ownership", lambda *_: False)  # what it says to others than root
    write(results(), path)
    assert path.stat().st_ino == number
    assert path.read_text() == "time,x\n0,0\n1,0\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o664
    assert names() == ["cam.yaml", "lift.csv", "motion.csv"]


def test_a_link_stays_one_and_its_target_is_replaced():
    pathlib.Path("real").mkdir()
    pathlib.Path("real", "motion.csv").write_text("old")
    pathlib.Path("motion.csv").symlink_to("real/motion.csv")
    write(results(), "motion.csv")
    assert pathlib.Path("motion.csv").is_symlink()
    assert pathlib.Path("real", "motion.csv").read_text().startswith("time")
    pathlib.Path("circle.csv").symlink_to("circle.csv")
    with pytest.raises(OutputError):
        write(results(), "circle.csv")


def test_what_is_written_is_on_the_disk_before_it_takes_its_place(monkeypatch):
    steps = []
    sync, rename = os.fsync, pathlib.Path.replace
    monkeypatch.setattr(os, "fsync", lambda number: (steps.append("sync"), sync(number))[1])
    monkeypatch.setattr(pathlib.Path, "replace", lambda self, to: (steps.append("place"), rename(self, to))[1])
    write(results(), "motion.csv")
    assert steps[:2] == ["sync", "place"]


WAITING = """
import pathlib, sys, time
from jounce.io.files.writing import replacing
with replacing("motion.csv") as scratch:
    scratch.write_text("half")
    print("ready", flush=True)
    time.sleep(60)
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_leaves_nothing_behind(number):
    pathlib.Path("motion.csv").write_text("old")
    before = names()
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    with subprocess.Popen(
        [sys.executable, "-c", WAITING], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
    ) as process:
        assert process.stdout.readline() == b"ready\n"
        assert len(names()) == len(before) + 1
        process.send_signal(number)
        assert process.wait(20) == -number
    assert names() == before
    assert pathlib.Path("motion.csv").read_text() == "old"


def test_handlers_of_signals_are_as_before():
    before = [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)]
    write(results(), "motion.csv")
    assert [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)] == before


FULL = """
import resource, sys
import numpy, xarray
from matplotlib.figure import Figure
from jounce.errors import OutputError
from jounce.io import write
from jounce.plot import save
resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))
values = numpy.random.default_rng(1).random((2000, 3))
coords = {"time": numpy.arange(2000.0), "derivative": [0, 1, 2]}
data = xarray.Dataset({"x": (("time", "derivative"), values)}, coords=coords)
for put in (lambda: write(data, "motion.nc"), lambda: write(data, "motion.csv"), lambda: save(Figure(), "motion.png")):
    try:
        put()
    except OutputError as error:
        print(error)
"""


@pytest.mark.slow
def test_a_disk_that_is_full_is_reported_in_one_line():
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "MPLBACKEND": "Agg"}
    before = names()
    done = subprocess.run([sys.executable, "-c", FULL], capture_output=True, text=True, env=environment, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        f"motion.{kind}: cannot be written: File too large" for kind in ("nc", "csv", "png")
    ]
    assert names() == before


def test_an_exception_within_leaves_what_was_there():
    pathlib.Path("motion.csv").write_text("old")
    before = names()

    def fail():
        with replacing("motion.csv") as scratch:
            scratch.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert names() == before
    assert pathlib.Path("motion.csv").read_text() == "old"
