"""The command line: what it prints and writes, how it ends, and that it never shows a traceback."""

import csv
import os
import pathlib
import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import jounce as jn
from jounce.cli import COMMANDS, main

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOUR_BAR = str(ROOT / "examples" / "four_bar.yaml")
RSUR = str(ROOT / "examples" / "rsur.yaml")
BROKEN = sorted((ROOT / "examples" / "broken").glob("*.yaml"))


@pytest.fixture(scope="module")
def four_bar():
    return jn.solve(jn.load(FOUR_BAR))


def process(*arguments, cwd=None, **environment):
    command = [sys.executable, "-m", "jounce", *map(str, arguments)]
    variables = os.environ | {"JOUNCE_CACHE_DIR": ""} | environment
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=variables, timeout=300, check=False)


def table_rows(text):
    """Read the rows of a printed table: (output, derivative) to unit, minimum, its time, maximum, its time."""
    rows = {}
    for line in text.splitlines():
        cells = line.split()
        if len(cells) == 7 and re.match(r"m|rad", cells[2]):
            rows[cells[0], cells[1]] = (cells[2], *(float(cell.rstrip("*")) for cell in cells[3:]))
    return rows


@pytest.mark.slow
def test_run_tabulates_the_extremes_of_every_output_and_derivative(run, four_bar):
    status, out, err = run("run", FOUR_BAR)
    assert (status, err) == (0, "")
    rows = table_rows(out)
    names = ["position", "velocity", "acceleration", "jerk", "jounce"]
    assert [name for output, name in rows if output == "psi"] == names
    assert {output for output, _ in rows} == {"psi", "C_x", "C_y"}
    psi, c = four_bar.outputs["psi"], four_bar.outputs["C"]
    for column, values in {"psi": psi, "C_x": c[..., 0], "C_y": c[..., 1]}.items():
        for k, name in enumerate(names):
            unit, low, low_at, high, high_at = rows[column, name]
            base = "rad" if column == "psi" else "m"
            assert unit == base + ("", "/s", "/s^2", "/s^3", "/s^4")[k]
            for sign, at, extreme in ((-1, low_at, low), (1, high_at, high)):  # of the motion, not of its instants
                grid = (sign * values[:, k]).max()
                assert grid - 1e-5 * abs(grid) <= sign * extreme <= grid + 1e-2 * abs(grid)
                around = np.unique([0.0, *np.linspace(max(at - 1e-3, 0), at + 1e-3, 21)])
                fine = jn.solve(jn.load(FOUR_BAR), around).outputs
                fine = fine["psi"] if column == "psi" else fine["C"][..., "xy".index(column[-1])]
                assert extreme == pytest.approx(sign * (sign * fine[:, k]).max(), rel=1e-5)


def test_run_says_what_was_solved_in_lines_of_at_most_80_plain_characters(run):
    _, out, _ = run("run", FOUR_BAR)
    assert out.splitlines()[:4] == [
        "Planar four-bar",
        "planar: 2 moving bodies (6 coordinates), 3 joints (5 equations)",
        "1 degree of freedom, driven by theta",
        "201 instants from t = 0 s to 2 s, derivatives to order 4",
    ]
    assert out.isascii()
    assert max(map(len, out.splitlines())) <= 80
    assert "\x1b" not in out


def test_the_star_marks_the_largest_magnitude(run, four_bar):
    _, out, _ = run("run", FOUR_BAR)
    jounce_row = next(line for line in out.splitlines() if line.startswith("psi     jounce")).split()
    values = four_bar.outputs["psi"][:, 4]
    assert jounce_row[5 if values.max() > -values.min() else 3].endswith("*")
    assert sum(cell.endswith("*") for cell in jounce_row) == 1


@pytest.mark.slow
def test_vectors_and_angular_velocities_of_a_spatial_mechanism(run):
    _, out, _ = run("run", RSUR)
    rows = table_rows(out)
    assert [name for output, name in rows if output == "coupler_spin_x"][::4] == ["velocity", "5th"]
    assert rows["coupler_spin_x", "5th"][0] == "rad/s^5"
    assert max(map(len, out.splitlines())) <= 80
    assert not re.search(r"e-\d{2,}", out), "components that vanish are shown as 0"


def test_csv_has_the_columns_of_the_design_and_every_digit(run, four_bar, tmp_path):
    path = tmp_path / "motion.csv"
    status, out, _ = run("run", FOUR_BAR, "--order", "4", "--out", path)
    assert status == 0
    assert out.rstrip().endswith(f"Written to {path}")
    with path.open(newline="") as stream:
        header, *rows = csv.reader(stream)
    stems = ["psi", "C_x", "C_y"]
    assert header == ["time", *(s + d for s in stems for d in ("", "_d1", "_d2", "_d3", "_d4"))]
    table = np.array(rows, float)
    np.testing.assert_array_equal(table[:, 0], four_bar.time)
    np.testing.assert_array_equal(table[:, 1:6], four_bar.outputs["psi"])
    np.testing.assert_array_equal(table[:, 6:], np.moveaxis(four_bar.outputs["C"], 2, 1).reshape(201, 10))


def test_netcdf_opens_with_xarray(run, tmp_path):
    xarray = pytest.importorskip("xarray")
    path = tmp_path / "motion.nc"
    assert run("run", FOUR_BAR, "--order", "2", "--out", path)[0] == 0
    with xarray.open_dataset(path, engine="h5netcdf") as dataset:
        assert dataset["psi"].shape == (201, 3)
        assert dataset["C"].attrs["units"] == "m"


def test_order_zero(run):
    status, out, _ = run("run", FOUR_BAR, "--order", "0")
    assert status == 0
    assert {derivative for _, derivative in table_rows(out)} == {"position"}


def test_set_takes_units_and_changes_the_motion(run):
    status, out, _ = run("run", FOUR_BAR, "--order", "0", "--set", "BC=15 cm", "--set", "tau = 4")
    assert status == 0
    expected = jn.solve(jn.load(FOUR_BAR).with_parameters(BC=0.15, tau=4.0), order=0).outputs["psi"]
    assert table_rows(out)["psi", "position"][1] == pytest.approx(expected.min(), rel=1e-5)


def test_other_instants_than_those_of_the_file(run, tmp_path):
    path = tmp_path / "few.csv"
    status, _, err = run("run", FOUR_BAR, "--order", "0", "--times", "500 ms:tau/2:3", "--set", "tau=4", "--out", path)
    assert (status, err) == (0, "")
    table = np.genfromtxt(path, delimiter=",", names=True)
    np.testing.assert_array_equal(table["time"], [0.5, 1.25, 2.0])
    motion = jn.solve(jn.load(FOUR_BAR).with_parameters(tau=4.0), [0.5, 1.25, 2.0], order=0)
    np.testing.assert_allclose(table["psi"], motion.outputs["psi"][:, 0], rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    "times, says",
    [
        ("0:2s", "must be START:STOP:COUNT, such as 0:2s:201, got '0:2s'"),
        ("0:2:1.5", "count must be a whole number of instants, at least 2 unless"),
        ("2:0:3", "stop must not come before start (2 s), got '2:0:3'"),
        ("0:5 mm:3", "expected a time, such as 2 s, but the unit of '5 mm' is a length"),
        ("0:AB:3", "expected a time, such as 2 s, but the parameter 'AB' is a length"),
        ("0:T:3", "unknown name 'T'"),
    ],
)
def test_instants_that_are_none_are_refused(run, times, says):
    status, out, err = run("run", FOUR_BAR, "--times", times)
    assert (status, out) == (2, "")
    assert err.startswith(f"error: --times: {says}")


@pytest.mark.parametrize("command", ["inspect", "view", "simulate", "equations", "modes"])
def test_instants_are_for_mechanism_files(run, command):
    robot = ROOT / "examples" / "robots" / "scara.urdf"
    status, _, err = run(command, robot, "--times", "0:1:3")
    assert status == 2
    assert "--times: is for mechanism files" in err


@pytest.mark.parametrize(
    "assignment, part",
    [
        ("BC", "NAME=VALUE"),
        ("BD=1", "no parameter has this name"),
        ("BC=30 deg", "an angle"),
        ("BC=1 parrot", "unknown unit 'parrot'"),
        ("BC=nan", "finite"),
        ("BC=t.__class__", "BC"),
        ("BC=-1", "greater than zero"),
    ],
)
def test_bad_set_is_reported(run, assignment, part):
    status, out, err = run("run", FOUR_BAR, "--set", assignment)
    assert (status, out) == (2, "")
    assert part in err


OWN_JOINT = '''
import jounce as jn
from jounce.constraints.base import MotionLaw

class Pull(jn.joints.AbstractConstraint, type="test_cli_pull", space="planar", role="driver"):
    """A point of body j at a height over a point of body i."""
    point_i: jn.joints.Vector
    point_j: jn.joints.Vector
    motion: MotionLaw

    def residual(self, body_i, body_j, time):
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return d[1] - self.motion(time)
'''
OWN_FILE = """
space: planar
bodies: {{bar: {{position: [0, 0], angle: 0.3}}}}
joints: {{O: {{type: revolute, bodies: [ground, bar], points: [[0, 0], [0, 0]]}}}}
drivers: {{pull: {{type: {type}, bodies: [ground, bar], points: [[0, 0], [1, 0]], motion: 0.3 + 0.1*t}}}}
outputs: {{angle: {{body: bar, quantity: angle}}}}
time: {{start: 0, stop: 1, count: 3}}
"""


def test_import_brings_in_own_joints(run, tmp_path):
    own, file = tmp_path / "own.py", tmp_path / "own.yaml"
    own.write_text(OWN_JOINT)
    file.write_text(OWN_FILE.format(type="test_cli_pull"))
    status, out, err = run("run", file, "--import", own)
    assert (status, err) == (0, "")
    assert table_rows(out)["angle", "position"][3] == pytest.approx(np.arcsin(0.4), rel=1e-5)


@pytest.mark.parametrize(
    "text, part",
    [
        ("1/0\n", "line 1: running it fails with ZeroDivisionError"),
        ("x = (\n", "SyntaxError"),
        ("exit(3)", "SystemExit"),
    ],
)
def test_import_of_a_file_that_fails_is_reported(run, tmp_path, text, part):
    own = tmp_path / "own.py"
    own.write_text(text)
    status, out, err = run("run", FOUR_BAR, "--import", own)
    assert (status, out) == (2, "")
    assert part in err


def test_import_needs_a_python_file_that_exists(run, tmp_path):
    assert "file not found" in run("run", FOUR_BAR, "--import", tmp_path / "none.py")[2]
    assert run("run", FOUR_BAR, "--import", FOUR_BAR)[0] == 2


@pytest.mark.slow
def test_a_solve_that_fails_on_the_way_keeps_the_good_instants(run, tmp_path):
    path = tmp_path / "motion.csv"
    status, out, err = run("run", FOUR_BAR, "--set", "AB=8 cm", "--out", path)
    assert status == 1
    assert re.search(r"t = 1\.\d+ s, body rocker: .*instants were solved", err)
    assert re.search(r"^1\d\d of 201 instants", out, re.MULTILINE)
    table = np.genfromtxt(path, delimiter=",", names=True)
    good = np.isfinite(table["psi"])
    assert 100 < good.sum() < 150
    assert good[:100].all()
    assert not good[150:].any()
    low = table_rows(out)["psi", "position"][1]
    assert low == pytest.approx(np.nanmin(table["psi"]), rel=1e-4)  # a little less between the instants
    assert low < np.nanmin(table["psi"])


@pytest.mark.parametrize("path", BROKEN, ids=[path.stem for path in BROKEN])
def test_broken_files_end_with_status_2_and_one_line(run, path):
    status, out, err = run("run", path)
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1


def test_there_are_broken_files():
    assert len(BROKEN) >= 10


@pytest.mark.parametrize(
    "arguments, part",
    [
        (["run", FOUR_BAR, "--order", "-1"], "--order"),
        (["run", FOUR_BAR, "--order", "many"], "--order"),
        (["run", FOUR_BAR, "--order", "31"], "from 0 to 30"),
        (["run", FOUR_BAR, "--tolerance", "0"], "tolerance"),
        (["run", FOUR_BAR, "--oder", "3"], "Did you mean --order? (see jounce run --help)"),
        (["run", FOUR_BAR, "-o", "x.csv"], "Did you mean --order or --out or --overwrite?"),
        (["run", FOUR_BAR, "more.yaml", "2"], "more words than the command takes: more.yaml 2"),
        (["run", FOUR_BAR, "--out", "motion.xls"], ".csv, .nc"),
        (["run", FOUR_BAR, "--out", "no/such/folder/motion.csv"], "does not exist"),
        (["run", FOUR_BAR, "--out", "/dev/null/motion.csv"], "motion.csv"),
        (["run", "none.yaml"], "none.yaml: file not found"),
        (["run", str(ROOT / "examples")], "examples"),
        (["run"], "FILE"),
        (["runn", FOUR_BAR], "run"),
        (["plot", FOUR_BAR, "--out", "figure.bmp"], ".png, .svg, .pdf"),
        (["plot", FOUR_BAR, "--out", "no/such/folder/figure.png"], "does not exist"),
        (["plot", FOUR_BAR, "--output", "phi"], "did you mean 'psi'"),
        (["plot", "none.yaml", "--out", "figure.png"], "file not found"),
        (["reproduce", "negrean", "--out", "x"], "did you mean 'negrean-2025'"),
        (["reproduce", "sommer", "--out", "x"], "sommer-2024"),
        (["reproduce", "sommer-2024"], "--out"),
    ],
)
def test_bad_calls_end_with_status_2_and_a_message(run, tmp_path, monkeypatch, arguments, part):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(*arguments)
    assert (status, out) == (2, "")
    assert part in err
    assert not list(tmp_path.iterdir())


def test_binary_garbage_is_refused(run, tmp_path):
    path = tmp_path / "garbage.yaml"
    path.write_bytes(bytes(range(256)) * 100)
    status, out, err = run("run", path)
    assert (status, out) == (2, "")
    assert "garbage.yaml" in err


def test_a_title_cannot_steer_the_terminal(run, tmp_path):
    path = tmp_path / "title.yaml"
    text = pathlib.Path(FOUR_BAR).read_text().replace("title: Planar four-bar", 'title: "\\x1b[31mred"')
    path.write_text(text)
    status, out, err = run("run", path, "--order", "0")
    assert "\x1b" not in out + err
    assert status in (0, 2)


def test_both_papers_are_known_by_name(run):
    status, _, err = run("reproduce", "negrean-2026", "--out", "never")
    assert status == 2
    assert "did you mean 'negrean-2025'? valid: negrean-2025, sommer-2024" in err


def test_an_unforeseen_error_is_one_line_unless_debugging(run, monkeypatch):
    def broken(*_, **__):
        raise KeyError("deep down")

    monkeypatch.setattr("jounce.kinematics.solve", broken)
    status, _, err = run("run", FOUR_BAR)
    assert status == 1
    assert "unexpected KeyError: 'deep down' (test_cli.py, line" in err
    monkeypatch.setenv("JOUNCE_DEBUG", "1")
    with pytest.raises(KeyError):
        main(["run", FOUR_BAR])


def test_an_interrupt_ends_quietly_with_130(run, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("jounce.kinematics.solve", interrupted)
    assert run("run", FOUR_BAR) == (130, "", "")


def test_a_result_that_cannot_be_written_after_all_ends_with_1(run, monkeypatch, tmp_path):
    def full(*_, **_options):
        raise jn.errors.OutputError("cannot be written: No space left on device", path="motion.csv")

    monkeypatch.setattr("jounce.io.write", full)
    status, out, err = run("run", FOUR_BAR, "--order", "0", "--out", tmp_path / "motion.csv")
    assert status == 1
    assert "psi" in out
    assert "No space left" in err


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_plot_writes_a_figure(run, tmp_path, suffix):
    path = tmp_path / f"figure.{suffix}"
    assert run("plot", FOUR_BAR, "--order", "2", "--out", path) == (0, f"Written to {path}\n", "")
    start = path.read_bytes()[:5]
    assert start.startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF-"}[suffix])


def test_plot_names_the_figure_after_the_file(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("plot", FOUR_BAR, "--order", "1", "--output", "psi")[:2] == (0, "Written to four_bar.png\n")
    assert [path.name for path in tmp_path.iterdir()] == ["four_bar.png"]


def test_schema_prints_a_json_schema(run):
    import json

    status, out, _ = run("schema")
    assert status == 0
    assert json.loads(out)["$schema"].startswith("https://json-schema.org/")


def test_version_and_help(run):
    assert run("--version")[1].strip() == jn.__version__
    for arguments in (
        [],
        ["--help"],
        ["run", "--help"],
        ["plot", "--help"],
        ["reproduce", "--help"],
        ["schema", "--help"],
    ):
        status, out, err = run(*arguments)
        assert (status, err) == (0, "")
        assert "Usage: jounce" in out
        assert "Examples:" in out


def test_help_of_every_command_names_what_an_option_is(run):
    for command in COMMANDS:
        status, out, err = run(command.__name__, "--help")
        assert (status, err) == (0, "")
        explained = re.findall(r"^  -[^:]*: (.+)", out, re.MULTILINE)
        assert len(explained) >= (command.__name__ != "schema")
        assert [words for words in explained if re.match(r"(Of|From|Those|Whose|Which|What|Where)\b", words)] == []
        assert not re.search(r"\S {3,}--", out)  # a command that goes on in the next line


@pytest.mark.slow
def test_a_process_of_its_own_imports_no_more_than_it_needs():
    program = (
        "import sys; from jounce.cli import main; status = main(['run', sys.argv[1]]);"
        "heavy = {'matplotlib', 'pandas', 'xarray', 'h5py', 'pint', 'rich'} & set(sys.modules);"
        "print(sorted(heavy)); sys.exit(status)"
    )
    environment = os.environ | {"JOUNCE_CACHE_DIR": ""}
    command = [sys.executable, "-c", program, FOUR_BAR]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300, check=False)
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.slow
def test_python_m_jounce_keeps_compiled_programs_for_the_next_call(tmp_path):
    cache = tmp_path / "cache"
    first = process("run", FOUR_BAR, "--order", "1", JOUNCE_CACHE_DIR=str(cache))
    assert (first.returncode, first.stderr) == (0, "")
    kept = {path.name for path in cache.iterdir()}
    assert kept
    second = process("run", FOUR_BAR, "--order", "1", "--set", "BC=15 cm", JOUNCE_CACHE_DIR=str(cache))
    assert (second.returncode, second.stderr) == (0, "")
    # what compiles within 0.05 s is not kept, and a busy machine may take longer for it the second time
    assert {path.name for path in cache.iterdir() if path.name.startswith("jit_advance")} <= kept


@pytest.mark.slow
def test_a_cache_that_cannot_be_made_does_no_harm(tmp_path):
    (tmp_path / "file").write_text("")
    folder = tmp_path / "file" / "cache"
    done = process("run", "none.yaml", cwd=tmp_path, JOUNCE_CACHE_DIR=str(folder))
    assert done.returncode == 2
    warning, error = done.stderr.splitlines()
    assert warning == f"compiled programs are not stored: {folder}: cannot be used: Not a directory"
    assert error == "error: none.yaml: file not found"


@pytest.mark.parametrize("compiling", [False, True])
def test_a_command_that_fails_waits_for_no_program_that_is_compiled_beside(monkeypatch, compiling):
    ended = []
    monkeypatch.setattr("sys.argv", ["jounce", "run", "examples/no_such_file.yaml"])
    monkeypatch.setattr("jounce.execution.background.is_compiling", lambda: compiling)
    monkeypatch.setattr("jounce.cli.end_on_signals", lambda: None)
    monkeypatch.setattr("jounce.cli.gc", SimpleNamespace(freeze=lambda: None, set_threshold=lambda _: None))
    monkeypatch.setattr("jounce.cli.os._exit", ended.append)
    assert main() == 2
    assert ended == [2] * compiling
