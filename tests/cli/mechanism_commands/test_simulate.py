"""The command ``jounce simulate``: what it prints and writes, and how it ends."""

import functools
import pathlib
import re

import numpy as np
import pytest

import jounce as jn

ROOT = pathlib.Path(__file__).resolve().parents[3]
PENDULUM = """\
space: planar
gravity: [0, -9.81]
parameters: {l: 1 m, speed: 1 rad/s}
bodies:
  bob: {position: [0, 0], angle: 0.3 rad, mass: 2 kg, center_of_mass: [l, 0]}
joints:
  pivot: {type: revolute, bodies: [ground, bob], points: [[0, 0], [0, 0]]}
initial:
  start: {type: coordinate, bodies: [ground, bob], coordinate: angle, motion: 0.3 + speed*t}
outputs:
  angle: {body: bob, quantity: angle}
time: {start: 0, stop: 1, step: 0.25}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "pendulum.yaml"
    path.write_text(PENDULUM)
    return path


@pytest.fixture
def simulate(run):
    return functools.partial(run, "simulate")


@pytest.mark.slow
def test_summary_table_and_file(simulate, file, tmp_path):
    path = tmp_path / "out.csv"
    status, out, err = simulate(file, "--out", path)
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[:3] == ["pendulum.yaml", "planar: 1 moving body, 1 joint, 0 forces", lines[2]]
    assert lines[2].startswith("1 degree of freedom: bob")
    assert re.match(r"5 instants from t = 0 s to 1 s in \d+ steps, derivatives to order 4", lines[3])
    energy = float(re.search(r"energy: (\S+) J at the start", out)[1])
    assert energy == pytest.approx(2 * (0.5 + 9.81 * np.sin(0.3)), rel=1e-8)
    assert float(re.search(r"it changes by (\S+) J", out)[1]) < 1e-12
    assert float(re.search(r"constraint drift: (\S+)", out)[1]) < 1e-13
    assert all(len(line) <= 80 for line in lines if not line.startswith("Written to"))
    table = np.genfromtxt(path, delimiter=",", names=True)
    motion = jn.simulate(jn.load(file))
    assert np.array_equal(table["angle"], motion.outputs["angle"][:, 0])
    found = re.search(r"jounce\s+rad/s\^4\s+(\S+)", out)
    fine = jn.simulate(jn.load(file), np.linspace(0.0, 1.0, 1001))  # peaks are those of the motion
    assert float(found[1].rstrip("*")) == pytest.approx(fine.outputs["angle"][:, 4].min(), rel=1e-5)
    assert fine.outputs["angle"][:, 4].min() < motion.outputs["angle"][:, 4].min()


@pytest.mark.slow
def test_set_step_and_netcdf(simulate, file, tmp_path):
    import xarray

    path = tmp_path / "out.nc"
    status, out, _ = simulate(file, "--order", 1, "--step", 0.1, "--set", "speed=-2 rad/s", "--out", path)
    assert status == 0
    assert "in 10 steps, derivatives to order 1" in out
    with xarray.open_dataset(path) as data:
        assert data["angle"].values[0].tolist() == pytest.approx([0.3, -2.0])


@pytest.mark.slow
def test_a_longest_step_bounds_all_steps(simulate, file):
    status, out, _ = simulate(file, "--order", 1, "--longest-step", 0.01)
    assert status == 0
    assert "in 100 steps, derivatives to order 1" in out


@pytest.mark.slow
@pytest.mark.parametrize("method", ["obreshkov-4", "obreshkov-6", "obreshkov-8"])
def test_methods(simulate, file, method, tmp_path):
    path = tmp_path / "out.csv"
    status, _, err = simulate(file, "--order", 1, "--method", method, "--tolerance", "1e-10", "--out", path)
    assert (status, err) == (0, "")
    found = np.genfromtxt(path, delimiter=",", names=True)["angle"]
    assert np.allclose(found, jn.simulate(jn.load(file), order=1).outputs["angle"][:, 0], rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("--method", "euler"), "--method: no method has this name, got 'euler'"),
        (("--method", "obreshkov-5"), "did you mean 'obreshkov-"),
        (("--step", "0"), "--step: the length of steps must be a positive number"),
        (("--step", "nan"), "--step"),
        (("--longest-step", "0"), "--longest-step: must be greater than zero"),
        (("--longest-step", "nan"), "--longest-step"),
        (("--step", "short"), "--step"),
        (("--tolerance", "1e-20"), "--tolerance: the tolerance must be a number from 1e-17"),
        (("--order", "31"), "--order"),
        (("--set", "sped=1"), "speed"),
        (("--out", "motion.xls"), ".csv, .nc"),
    ],
)
def test_bad_options(simulate, file, arguments, words):
    status, out, err = simulate(file, *arguments)
    assert (status, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("mass: 2 kg, ", "", "no body has a mass"),
        (", center_of_mass: [l, 0]", "", "bodies.bob.inertia: the body can move but has no inertia"),
        ("time: {start: 0, stop: 1, step: 0.25}\n", "", "no time grid is given"),
        ("type: coordinate", "type: revolute", "initial.start"),
        ("motion: 0.3 + speed*t", "motion: log(t)", "initial.start"),
    ],
)
def test_bad_files(simulate, file, old, new, words):
    file.write_text(PENDULUM.replace(old, new))
    status, out, err = simulate(file)
    assert (status, out) == (2, "")
    assert "pendulum.yaml" in err
    assert words in err


def test_a_file_that_does_not_exist(simulate):
    status, out, err = simulate("none.yaml")
    assert (status, out) == (2, "")
    assert "none.yaml: file not found" in err


@pytest.mark.slow
def test_a_collapse_on_the_way_keeps_and_writes_what_was_computed(simulate, tmp_path):
    path, results = tmp_path / "block.yaml", tmp_path / "out.csv"
    path.write_text("""\
space: planar
bodies: {block: {position: [1, 0], mass: 1 kg}}
joints: {guide: {type: prismatic, bodies: [ground, block], points: [[0, 0], [0, 0]], vectors: [[1, 0], [1, 0]]}}
forces:
  pull: {type: slide_force, bodies: [ground, block], points: [[0, 0], [0, 0]], vector: [1, 0], law: -x**-3}
outputs: {x: {body: block, point: [0, 0]}}
time: {start: 0, stop: 2, step: 0.2}
""")
    status, out, err = simulate(path, "--order", 1, "--out", results)
    assert status == 1
    assert "forces.pull" in err  # which grows beyond all bounds there
    assert re.search(r"^[56] of 11 instants", out, re.MULTILINE)
    found = np.genfromtxt(results, delimiter=",", names=True)["x_x"]
    time = 0.2 * np.arange(5)
    assert np.allclose(found[:5], np.sqrt(1 - time**2), rtol=0, atol=1e-12)
    assert np.isnan(found[6:]).all()
