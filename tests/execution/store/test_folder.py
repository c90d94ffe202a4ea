"""Compiled programs kept in files: what is damaged is never used, and a folder that fails costs time only."""

import errno
import io
import os
import subprocess
import sys
import threading
import warnings

import numpy as np
import pytest

import jounce as jn
from jounce.base import private_folder
from jounce.base.private_folder import PrivateFolder
from jounce.execution.store import folder as program_folder, programs as store
from jounce.execution.store.folder import ProgramFolder

PROGRAM = bytes(range(256)) * 40

DAMAGES = {
    "empty": lambda file: file.write_bytes(b""),
    "cut short": lambda file: file.write_bytes(file.read_bytes()[:-7]),
    "garbage": lambda file: file.write_bytes(b"no program at all"),
    "a bit": lambda file: file.write_bytes(bytes([*file.read_bytes()[:99], 1, *file.read_bytes()[100:]])),
    "unreadable": lambda file: file.chmod(0),
    "removed": lambda file: file.unlink(),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_absent_and_then_replaced(tmp_path, damage):
    entries = ProgramFolder(PrivateFolder(tmp_path))
    assert entries.get("key") is None
    entries.put("key", PROGRAM)
    assert entries.get("key") == PROGRAM
    (file,) = tmp_path.iterdir()
    DAMAGES[damage](file)
    if damage != "unreadable" or os.getuid():  # nothing is unreadable to root
        assert entries.get("key") is None
    entries.put("key", PROGRAM)
    assert entries.get("key") == PROGRAM
    assert list(tmp_path.iterdir()) == [file]


def test_an_entry_that_cannot_be_replaced_is_compiled_each_time(tmp_path):
    entries = ProgramFolder(PrivateFolder(tmp_path))
    (tmp_path / "key.program").mkdir()
    entries.put("key", PROGRAM)
    assert entries.get("key") is None
    gone = tmp_path / "gone"
    entries = ProgramFolder(PrivateFolder(gone))
    gone.rmdir()
    entries.put("key", PROGRAM)
    assert entries.get("key") is None


def test_a_tilde_is_the_home_folder_where_no_shell_has_read_it(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("JOUNCE_CACHE_DIR", "~/programs")
    assert program_folder.chosen_folder() == tmp_path / "programs"


def test_those_that_were_not_used_for_longest_go_first(tmp_path, monkeypatch):
    monkeypatch.setattr(program_folder, "LARGEST", 3 * (len(PROGRAM) + 32))
    for key in "abcde":
        ProgramFolder(PrivateFolder(tmp_path)).put(key, PROGRAM)
        for file in tmp_path.iterdir():
            used = 1e9 + "abcde".index(file.stem)
            os.utime(file, (used, used))
    assert sorted(file.stem for file in tmp_path.iterdir()) == ["c", "d", "e"]
    assert ProgramFolder(PrivateFolder(tmp_path)).get("c") == PROGRAM
    ProgramFolder(PrivateFolder(tmp_path)).put("f", PROGRAM)
    assert sorted(file.stem for file in tmp_path.iterdir()) == ["c", "e", "f"]


def test_what_a_killed_process_was_writing_goes_after_an_hour(tmp_path):
    for name, age in (("old", 4000), ("new", 0)):
        file = tmp_path / f".{name}.part"
        file.write_bytes(PROGRAM)
        os.utime(file, (file.stat().st_mtime - age,) * 2)
    ProgramFolder(PrivateFolder(tmp_path)).put("key", PROGRAM)
    assert sorted(file.name for file in tmp_path.iterdir()) == [".new.part", "key.program"]


def test_how_much_there_is_is_looked_at_again(tmp_path, monkeypatch):
    monkeypatch.setattr(program_folder, "LARGEST", 3 * (len(PROGRAM) + 32))
    monkeypatch.setattr(program_folder, "LOOKED_AT", 2 * len(PROGRAM))
    entries = ProgramFolder(PrivateFolder(tmp_path))
    for key in range(20):
        entries.put(str(key), PROGRAM)
        assert len(list(tmp_path.iterdir())) <= 5


def test_a_full_disk_keeps_nothing_and_leaves_nothing_behind(tmp_path, monkeypatch):
    class Full(io.FileIO):
        def write(self, content):
            super().write(content[:100])
            raise OSError(errno.ENOSPC, "No space left on device")

    entries = ProgramFolder(PrivateFolder(tmp_path))
    with monkeypatch.context() as patch:
        patch.setattr(private_folder, "open", Full, raising=False)
        entries.put("key", PROGRAM)
    assert list(tmp_path.iterdir()) == []
    assert entries.get("key") is None


def test_several_at_once_find_all_of_a_program_or_nothing(tmp_path):
    found, values = [], [bytes([k]) * 300_000 for k in range(4)]

    def work(value):
        entries = ProgramFolder(PrivateFolder(tmp_path))
        for _ in range(30):
            entries.put("key", value)
            found.append(entries.get("key"))

    threads = [threading.Thread(target=work, args=(value,)) for value in values]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 120
    assert set(found) <= {*values, None}
    assert [file.name for file in tmp_path.iterdir()] == ["key.program"]


# -- the folder that nobody had to choose -----------------------------------------------------------------------------


@pytest.fixture
def undecided(monkeypatch):
    """As in a process that has not looked for the folder yet."""
    monkeypatch.setattr(store, "_store", store._undecided)
    monkeypatch.delenv("JOUNCE_CACHE_DIR", raising=False)


def path_of(found):
    return found._folder.path


def test_it_is_among_the_caches_of_the_user_or_where_the_environment_says(undecided, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert path_of(store.current_store()) == tmp_path / "jounce"
    assert store.current_store() is store.current_store()
    for folder in (tmp_path / "chosen", ""):
        monkeypatch.setattr(store, "_store", store._undecided)
        monkeypatch.setenv("JOUNCE_CACHE_DIR", str(folder))
        found = store.current_store()
        assert (found and path_of(found)) == (folder or None)


def test_without_a_home_that_can_be_written_nothing_is_kept_without_a_word(undecided, monkeypatch, tmp_path):
    (tmp_path / "file").write_bytes(b"")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr(sys, "platform", "linux")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert store.current_store() is None


def test_a_folder_that_was_chosen_and_cannot_be_used_is_reported_once(undecided, monkeypatch, tmp_path):
    tmp_path.chmod(0o777)
    monkeypatch.setenv("JOUNCE_CACHE_DIR", str(tmp_path))
    with pytest.warns(jn.errors.ProgramFolderWarning, match="may be written by others"):
        assert store.current_store() is None
    assert store.current_store() is None
    with pytest.raises(jn.errors.OutputError, match="may be written by others"):
        jn.keep_programs(tmp_path)


def test_a_folder_that_may_not_be_written_is_reported(undecided, monkeypatch, tmp_path):
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(jn.errors.OutputError, match="may not be written"):
        jn.keep_programs(tmp_path)


# -- processes of Python ----------------------------------------------------------------------------------------------

SOLVED = """
import jax, sys
count, make = 0, jax.make_jaxpr
def counted(*given, **named):
    global count
    count += 1
    return make(*given, **named)
jax.make_jaxpr = counted
import jounce as jn
exec(sys.argv[1])
motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.01, 0.02], order=2)
print(motion.outputs["psi"].tobytes().hex(), count)
"""


def started(folder, before=""):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    environment["JOUNCE_CACHE_DIR"] = str(folder)
    command = [sys.executable, "-c", SOLVED, before]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def result(process):
    """Return the numbers, and how many programs were traced to be machine code."""
    out, err = process.communicate(timeout=300)
    assert (process.returncode, err) == (0, "")
    numbers, traced = out.split()
    return np.frombuffer(bytes.fromhex(numbers)), int(traced)


@pytest.mark.slow
def test_a_second_process_traces_and_compiles_nothing(tmp_path):
    folder = tmp_path / "programs"
    both = [result(process) for process in [started(folder), started(folder)]]  # at once
    names = {file.name for file in folder.iterdir()}
    again = result(started(folder))
    assert all(name.endswith(".program") for name in names)
    assert {file.name for file in folder.iterdir()} == names
    assert again[1] == 0 < min(traced for _, traced in both)
    damaged = dict(zip(folder.iterdir(), ["cut short", "a bit", "garbage"], strict=False))
    for file, damage in damaged.items():
        DAMAGES[damage](file)
    mended = result(started(folder))
    assert mended[1] == len(damaged)
    assert {file.name for file in folder.iterdir()} == names
    for numbers, _ in (both[1], again, mended):
        np.testing.assert_array_equal(numbers, both[0][0])


@pytest.mark.slow
@pytest.mark.parametrize(
    "before",
    [
        "jn.keep_programs(None)",
        "from jounce.kinematics.continuation import step_control as s; s.GROWTH = 2.0",
        "jn.planar.Revolute.residual = lambda self, *given: 1 / 0",
    ],
)
def test_nothing_is_kept_where_it_is_not_to_be_or_the_package_is_another(tmp_path, before):
    folder = tmp_path / "programs"
    process = started(folder, before)
    process.communicate(timeout=300)
    assert not folder.exists() or list(folder.iterdir()) == []
