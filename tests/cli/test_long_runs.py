"""`jounce run` on a grid of several chunks: what it says and writes is as if it were one."""

import json

import pytest
import xarray

from jounce.io import read

FILE = """
space: planar
bodies: {crank: {position: [0, 0], angle: 0.1}, rocker: {position: [0.4, 0], angle: 1.4}}
joints:
  A: {type: revolute, bodies: [ground, crank], points: [[0, 0], [0, 0]]}
  D: {type: revolute, bodies: [ground, rocker], points: [[0.4, 0], [0, 0]]}
  BC: {type: double_revolute, bodies: [crank, rocker], points: [[0.1, 0], [0.3, 0]], length: 0.35}
drivers:
  turn: {type: coordinate, bodies: [ground, crank], coordinate: angle, motion: MOTION}
outputs: {psi: {body: rocker, quantity: angle}, C: {body: rocker, point: [0.3, 0]}}
time: {start: 0, stop: 2, count: 2501}
"""
WHOLE, ENDS = "0.1 + sin(3*t)", "0.1 + sqrt(1.44 - t)"  # the second has no value from t = 1.44 on


@pytest.fixture
def file(tmp_path):
    def write(motion):
        path = tmp_path / "linkage.yaml"
        path.write_text(FILE.replace("MOTION", motion))
        return path

    return write


@pytest.mark.slow
@pytest.mark.parametrize("motion, status", [(WHOLE, 0), (ENDS, 1)])
@pytest.mark.parametrize("suffix", ["nc", "csv"])
def test_chunks_change_nothing(run, file, tmp_path, monkeypatch, motion, status, suffix):
    path, out = file(motion), tmp_path / f"motion.{suffix}"
    printed, written = [], []
    monkeypatch.setattr("jounce.kinematics.position_analysis.grid_storage.CHUNK", 1100)
    for streams in (False, True):
        monkeypatch.setattr("jounce.kinematics.needs_chunks", lambda _, streams=streams: streams)
        printed.append([run("run", path, "--order", "1", "--out", out), run("run", path, "--order", "1", "--json")])
        written.append(read(out))
        out.unlink()
    assert printed[0] == printed[1]
    assert printed[0][0][0] == status
    assert json.loads(printed[1][1][1])["time"]["count"] == 2501
    xarray.testing.assert_identical(*written)


@pytest.mark.slow
def test_an_interrupt_between_chunks_leaves_no_file(run, file, tmp_path, monkeypatch):
    monkeypatch.setattr("jounce.kinematics.position_analysis.grid_storage.CHUNK", 1100)
    path, seen = file(WHOLE), []

    def interrupt(_, done, total):
        seen.append((done, sorted(p.name.partition("-")[0] for p in tmp_path.iterdir())))
        if done > 1100:
            raise KeyboardInterrupt

    monkeypatch.setattr("jounce.reporting.terminal.Bar.__call__", interrupt)
    assert run("run", path, "--order", "1", "--out", tmp_path / "motion.nc")[0] == 130
    assert seen[-1][1] == [".jounce", "linkage.yaml"]  # it was being written beside its place
    assert [p.name for p in tmp_path.iterdir()] == ["linkage.yaml"]


@pytest.mark.slow
def test_a_result_that_cannot_be_written_is_reported(run, file, tmp_path, monkeypatch):
    monkeypatch.setattr("jounce.kinematics.position_analysis.grid_storage.CHUNK", 1100)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("jounce.io.files.netcdf_parts._reserve", full)
    path = file(WHOLE)
    status, _, err = run("run", path, "--order", "1", "--out", tmp_path / "motion.nc")
    assert (status, "No space left on device" in err) == (1, True)
    assert [p.name for p in tmp_path.iterdir()] == ["linkage.yaml"]
