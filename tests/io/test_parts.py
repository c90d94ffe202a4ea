"""Results that come part by part: the file that is written of the whole, or none."""

import dataclasses
import os
import pathlib
import subprocess
import sys

import h5py
import numpy as np
import pytest
import xarray

import jounce as jn
from jounce.errors import OutputError
from jounce.io import read, write, write_parts
from jounce.kinematics import Status, solve_in_chunks
from jounce.mechanism import TimeGrid
from tests.problems.small import four_bar, slider_crank, spindle

ROOT = pathlib.Path(__file__).resolve().parents[2]
GRID = TimeGrid(0, 2, count=2501)
SUFFIXES = ["nc", "csv"]


@pytest.fixture(autouse=True)
def _three_chunks(monkeypatch):
    monkeypatch.setattr("jounce.kinematics.position_analysis.grid_storage.CHUNK", 1100)


def turning():
    """A body that turns three times about an inclined axis, with outputs of every shape."""
    outputs = {
        "angles": jn.outputs.EulerAnglesOutput("spindle", "zyx"),
        "attitude": jn.outputs.EulerParametersOutput("spindle"),
        "matrix": jn.outputs.RotationMatrixOutput("spindle"),
        "p": jn.outputs.PointOutput("spindle", [1, 0, 0.5]),
        "torque": jn.outputs.DriverTorqueOutput("turn"),
        "energy": jn.outputs.KineticEnergyOutput(),
    }
    body = jn.Body([0, 0, 0], mass=2.0, inertia=[0.1, 0.2, 0.25])
    return dataclasses.replace(
        spindle("9*t + 0.2*sin(pi*t)", (0.6, 0.0, 0.8)), bodies={"spindle": body}, outputs=outputs
    )


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def described(path):
    """Everything that a NetCDF file says besides its values, as HDF5 sees it."""
    found = {}

    def visit(name, item):
        kept = {key: str(value) for key, value in item.attrs.items() if key not in ("REFERENCE_LIST", "DIMENSION_LIST")}
        found[name] = kept, item.shape, item.dtype, item.chunks, item.maxshape

    with h5py.File(path) as file:
        file.visititems(visit)
        return found, {key: str(value) for key, value in file.attrs.items() if key != "_NCProperties"}


@pytest.mark.slow
@pytest.mark.parametrize("mechanism", [four_bar, turning, lambda: slider_crank("3.8 - 2*t")])
def test_the_file_is_that_of_the_whole_motion(tmp_path, mechanism):
    whole = jn.solve(mechanism(), GRID, order=2, strict=False)
    for suffix in SUFFIXES:
        write(whole.dataset, tmp_path / f"whole.{suffix}")
        motion = solve_in_chunks(mechanism(), GRID, order=2)
        count = []
        parts = (count.append(len(part.time)) or part.dataset for part in motion)
        write_parts(parts, tmp_path / f"parts.{suffix}", len(motion))
        assert count == [1100, 1100, 301]
        np.testing.assert_array_equal(motion.status, whole.status)
        assert motion.faults == whole.faults
        expected, found = (read(tmp_path / f"{name}.{suffix}") for name in ("whole", "parts"))
        xarray.testing.assert_identical(found, expected)
    assert (tmp_path / "parts.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    assert described(tmp_path / "parts.nc") == described(tmp_path / "whole.nc")


@pytest.mark.slow
def test_a_motion_that_ends_in_a_later_chunk():
    motion = solve_in_chunks(slider_crank("3.8 - 2*t"), GRID, order=0)  # beyond its range from t = 0.9 on
    assert (motion.status == Status.OK).all()
    for part in motion:
        past = part.time > 0.9
        assert (part.status[part.time < 0.899] == Status.OK).all()
        assert np.isnan(part.outputs["x"][past]).all()
    assert motion.time[int(np.argmax(motion.status != Status.OK))] == pytest.approx(0.9, abs=1e-3)


def parts_of(*sizes, fail=None):
    """Datasets of one scalar, at instants that go on from one to the next."""
    first = 0
    for size in sizes:
        coords = {"time": np.arange(first, first + size) * 0.5, "derivative": [0]}
        yield xarray.Dataset({"x": (("time", "derivative"), np.full((size, 1), 1.5))}, coords=coords)
        first += size
    if fail is not None:
        raise fail


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("sizes", [(3, 2), (4, 3)])
def test_a_number_of_instants_that_was_not_announced(tmp_path, suffix, sizes):
    with pytest.raises(OutputError, match="do not have the 6 instants"):
        write_parts(parts_of(*sizes), tmp_path / f"x.{suffix}", 6)
    assert names(tmp_path) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("failure", [ValueError("of the parts"), OSError("of the parts"), KeyboardInterrupt()])
def test_what_fails_in_the_parts_comes_through_and_nothing_is_written(tmp_path, suffix, failure):
    (tmp_path / f"x.{suffix}").write_text("precious")
    with pytest.raises(type(failure)) as caught:
        write_parts(parts_of(3, 2, fail=failure), tmp_path / f"x.{suffix}", 6)
    assert caught.value is failure
    assert names(tmp_path) == [f"x.{suffix}"]
    assert (tmp_path / f"x.{suffix}").read_text() == "precious"


def test_a_file_with_a_million_instants_is_laid_out_without_them(tmp_path):
    write_parts(parts_of(*[100_000] * 10), tmp_path / "x.nc", 1_000_000)
    found = read(tmp_path / "x.nc")
    np.testing.assert_array_equal(found["time"], 0.5 * np.arange(1_000_000))
    np.testing.assert_array_equal(found["x"], 1.5)


FULL = """
import resource
import numpy, xarray
from jounce.errors import OutputError
from jounce.io import write_parts
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
asked = []
def parts():
    for k in range(10):
        asked.append(k)
        coords = {"time": 1000.0 * k + numpy.arange(1000.0), "derivative": [0]}
        yield xarray.Dataset({"x": (("time", "derivative"), numpy.full((1000, 1), 1 / 3))}, coords=coords)
for name in ("x.nc", "x.csv"):
    asked.clear()
    try:
        write_parts(parts(), name, 10_000)
    except OutputError as error:
        print(error, len(asked))
"""


@pytest.mark.slow
def test_a_full_disk_is_reported_before_the_second_part_is_asked_for(tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run(
        [sys.executable, "-c", FULL], capture_output=True, text=True, env=environment, timeout=120, cwd=tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")
    netcdf, table = done.stdout.splitlines()
    assert netcdf == "x.nc: cannot be written: File too large 1"
    assert table.startswith("x.csv: cannot be written: File too large")  # which grows as it is written
    assert names(tmp_path) == []
