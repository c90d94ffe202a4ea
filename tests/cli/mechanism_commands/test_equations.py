"""The command ``equations``: what it writes, prints and refuses."""

import functools
import json

import numpy as np
import pytest
import xarray

import jounce as jn
from tests.problems.mechanisms import EXAMPLES, example
from tests.problems.written import run as defined

FOUR_BAR = example("four_bar")


@pytest.fixture
def run(run):
    return functools.partial(run, "equations")


@pytest.mark.slow
def test_code_is_written_with_the_values_of_options(run, tmp_path):
    out = tmp_path / "2-bars.py"
    assert run(FOUR_BAR, "--out", out, "--set", "BC=11 cm", "--joint", "BC", "--order", "2")[0] == 0
    code = defined(out.read_text())
    assert (code["ORDER"], code["ROWS"]) == (2, ("BC.1",))
    q = np.zeros(6)  # the rod from 4 cm to 20.31 cm on one line
    np.testing.assert_allclose(code["residual"](0.0, q), [(0.2031 - 0.04) ** 2 - 0.11**2], rtol=1e-14)
    assert run(FOUR_BAR, "--format", "c", "--out", tmp_path / "2-bars.c")[0] == 0
    assert "void mechanism_residual(" in (tmp_path / "2-bars.c").read_text()


def test_code_is_printed(run):
    status, output, _ = run(FOUR_BAR)
    assert status == 0
    assert output == jn.equations(jn.load(FOUR_BAR))


@pytest.mark.parametrize(
    "options, words",
    [
        (("--joint", "XY"), "four_bar.yaml, joint: no joint or driver has this name, got 'XY'"),
        (("--order", "40"), "--order: must be a whole number from 1 to 12, got 40"),
        (("--out", "x.txt"), "x.txt: the kind of code is given by its extension; valid: .py"),
        (("--format", "c", "--out", "x.py"), "x.py: the kind of code is given by its extension; valid: .c"),
    ],
)
def test_bad_input(run, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    status, _, message = run(FOUR_BAR, *options)
    assert status == 2
    assert words in " ".join(message.split())
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_values_along_the_motion_are_tables(run, tmp_path):
    expected = jn.constraint_equations(jn.solve(jn.load(FOUR_BAR), [0.0, 0.5], order=2))
    short = ("--format", "table", "--order", "2", "--joint", "BC")
    file = tmp_path / "short.yaml"
    grid = "{start: 0, stop: 2, step: 0.01}"
    file.write_text(FOUR_BAR.read_text().replace(grid, "{start: 0, stop: 0.5, count: 2}"))
    for ending in ("csv", "nc", "json"):
        assert run(file, *short, "--out", tmp_path / f"values.{ending}")[0] == 0
    table = np.genfromtxt(tmp_path / "values.csv", delimiter=",", names=True, deletechars="")
    right = expected.right_side.sel(row="BC.1", derivative=2).values
    np.testing.assert_array_equal(table["right_side_2.BC.1"], right)
    np.testing.assert_array_equal(
        table["jacobian.BC.1.crank.angle"], expected.jacobian.sel(row="BC.1", column="crank.angle")
    )
    values = json.loads((tmp_path / "values.json").read_text())
    assert values["row"] == ["BC.1"]
    assert values["right_side"]["dimensions"] == ["time", "derivative", "row"]
    second = values["derivative"].index(2)
    assert [levels[second][0] for levels in values["right_side"]["values"]] == right.tolist()
    with xarray.open_dataset(tmp_path / "values.nc") as stored:
        np.testing.assert_array_equal(stored.jacobian.sel(row="BC.1"), expected.jacobian.sel(row="BC.1"))
    status, _, message = run(file, "--format", "table")
    assert status == 2
    assert "a table goes to a file" in message


def test_robots_and_quantities(run, tmp_path):
    robot = EXAMPLES / "robots" / "scara.urdf"
    assert run(robot, "--order", "2", "--no-drives", "--out", tmp_path / "scara.py")[0] == 0
    code = defined((tmp_path / "scara.py").read_text())
    q = np.zeros((3, len(code["JOINTS"])))
    np.testing.assert_allclose(
        code["torque"](q), jn.inverse_dynamics(jn.load_robot(robot), q, drives=False), atol=1e-13
    )
    pendulum = example("double_pendulum")
    parts = ("--quantity", "constraints", "--quantity", "forces", "--order", "2")
    assert run(pendulum, *parts, "--format", "sympy", "--out", tmp_path / "p.py")[0] == 0
    assert "def mass_matrix(t=t, q=q)" in (tmp_path / "p.py").read_text()
    for options, words in (
        ((robot, "--set", "a=1"), "--set: is for mechanism files"),
        ((robot, "--format", "table"), "--format: is for mechanisms"),
        ((pendulum, "--no-drives"), "--no-drives: is for robots"),
        ((pendulum, "--format", "table", "--quantity", "forces"), "--quantity: is for code"),
    ):
        status, _, message = run(*options)
        assert status == 2
        assert words in " ".join(message.split())


@pytest.mark.slow
def test_tables_have_masses_and_multipliers(run, tmp_path):
    """Phi, Phi_q, right sides, multipliers and M of each format, of a motion that is simulated."""
    text = example("double_pendulum").read_text()
    file = tmp_path / "short.yaml"
    file.write_text(text[: text.index("time:")] + "time: {start: 0, stop: 0.1, count: 3}\n")
    motion = jn.simulate(jn.load(file))
    expected = jn.constraint_equations(motion)
    for ending in ("csv", "nc", "json"):
        assert run(file, "--format", "table", "--out", tmp_path / f"values.{ending}")[0] == 0
    table = np.genfromtxt(tmp_path / "values.csv", delimiter=",", names=True, deletechars="")
    for name, values in {
        "residual.A.1": expected.residual.sel(row="A.1"),
        "jacobian.B.1.upper.angle": expected.jacobian.sel(row="B.1", column="upper.angle"),
        "right_side_3.B.1": expected.right_side.sel(row="B.1", derivative=3),
        "multipliers_1.B.2": expected.multipliers.sel(row="B.2", derivative=1),
        "mass_matrix.upper.x.upper.angle": expected.mass_matrix.sel(column="upper.x", other_column="upper.angle"),
    }.items():
        np.testing.assert_array_equal(table[name], values.values)
    stored = json.loads((tmp_path / "values.json").read_text())
    assert set(stored) >= {"residual", "jacobian", "right_side", "multipliers", "mass_matrix", "velocities"}
    with xarray.open_dataset(tmp_path / "values.nc") as found:
        np.testing.assert_array_equal(found.multipliers, expected.multipliers)
