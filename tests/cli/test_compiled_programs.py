"""Compiled programs kept in files: what is damaged is never used, and is replaced."""

import itertools
import os
import pathlib
import pickle
import subprocess
import sys
import zlib

import pytest

from jounce.base.private_folder import PrivateFolder
from jounce.execution.store import programs as store
from jounce.execution.store.folder import ProgramFolder
from tests.execution.store.test_folder import DAMAGES

FOUR_BAR = pathlib.Path(__file__).resolve().parents[2] / "examples" / "four_bar.yaml"


def started(cache):
    command = [sys.executable, "-m", "jounce", "run", str(FOUR_BAR), "--order", "1"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    environment["JOUNCE_CACHE_DIR"] = cache
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


MARK = "planted"


class Planted:
    """What leaves a mark where it is read by `pickle`."""

    def __reduce__(self):
        return os.mkdir, (MARK,)


def test_what_is_no_description_is_not_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(pickle.UnpicklingError, match="is no part of a program"):
        store.unpacked(zlib.compress(pickle.dumps((b"", Planted()))))
    assert not pathlib.Path(MARK).exists()


@pytest.mark.slow
@pytest.mark.parametrize("mode", [0o1777, 0o770])
def test_a_folder_that_others_may_write_is_not_used_and_said_once(tmp_path, mode):
    folder = tmp_path / "programs"
    folder.mkdir()
    folder.chmod(mode)
    process = started(str(folder))
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0
    assert "psi" in out
    assert len(err.splitlines()) == 1
    assert "compiled programs are not stored" in err
    assert "may be written by others" in err
    assert list(folder.iterdir()) == []


@pytest.mark.slow
def test_two_commands_with_a_cold_cache_and_one_with_a_damaged_one(tmp_path):
    both = [started(str(tmp_path)) for _ in range(2)]
    printed = [process.communicate(timeout=300) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert printed[0] == (printed[0][0], "") == printed[1]
    good = {file: file.read_bytes() for file in tmp_path.iterdir()}
    assert good
    for file, damage in zip(good, itertools.cycle(["empty", "cut short", "garbage", "a bit"]), strict=False):
        DAMAGES[damage](file)
    process = started(str(tmp_path))
    assert process.communicate(timeout=300) == printed[0]
    assert process.returncode == 0
    kept = {file: file.read_bytes() for file in tmp_path.iterdir()}  # but those that compile too fast to be kept
    assert kept
    assert all(ProgramFolder(PrivateFolder(tmp_path)).get(file.name.removesuffix(".program")) for file in kept)
