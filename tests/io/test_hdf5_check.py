import zlib

import numpy as np
import pytest
import xarray

from jounce import io
from jounce.errors import OutputError
from jounce.io import hdf5_check


@pytest.fixture
def content(tmp_path):
    """Return the bytes of a small file of results."""
    time = np.linspace(0.0, 1.0, 5)
    values = ("time", "derivative"), np.stack([time, np.ones(5)], axis=1)
    io.write(xarray.Dataset({"psi": values}, {"time": time, "derivative": [0, 1]}), tmp_path / "good.nc")
    return (tmp_path / "good.nc").read_bytes()


@pytest.mark.parametrize("damage", [lambda x: x[: len(x) // 2], lambda x: x[:64] + bytes(512) + x[576:]])
def test_a_damaged_file_is_an_error_with_its_name(tmp_path, content, damage, capfd):
    path = tmp_path / "damaged.nc"
    path.write_bytes(damage(content))
    with pytest.raises(OutputError, match=r"damaged\.nc.*is damaged"):
        io.read(path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    "program, words",
    [("while True: pass", "did not finish reading"), ("import os; os.abort()", "crashes")],
)
def test_a_library_that_hangs_or_ends_its_process(monkeypatch, content, program, words):
    monkeypatch.setattr(hdf5_check, "_PROGRAM", program)
    monkeypatch.setattr(hdf5_check, "SECONDS", 2.0)
    with pytest.raises(OutputError, match=words):
        hdf5_check.check_readable(content, "result.nc")


def test_the_messages_of_a_library_are_bounded(monkeypatch, content):
    program = "import sys; print('x' * int(sys.argv[2])); sys.exit(3)"
    monkeypatch.setattr(hdf5_check, "_PROGRAM", program)
    with pytest.raises(OutputError) as raised:
        hdf5_check.check_readable(content, "result.nc")
    assert len(str(raised.value)) < 2 * hdf5_check.LONGEST


def test_a_file_that_is_whole_is_read_to_the_bit(tmp_path, content):
    path = tmp_path / "good.nc"
    read = io.read(path)
    np.testing.assert_array_equal(read["psi"][:, 0], np.linspace(0.0, 1.0, 5))
    assert zlib.crc32(path.read_bytes()) == zlib.crc32(content)


def test_no_other_program_is_started_for_it(tmp_path, monkeypatch, content):
    """Where Python is within an application, that would be the application."""
    marked = tmp_path / "application"
    marked.write_text(f"#!/bin/sh\ntouch {tmp_path}/mark\n")
    marked.chmod(0o700)
    monkeypatch.setattr("sys.executable", str(marked))
    with pytest.raises(OutputError, match=r"no process can be started .* is no interpreter of Python"):
        hdf5_check.check_readable(content, "result.nc")
    assert not (tmp_path / "mark").exists()
