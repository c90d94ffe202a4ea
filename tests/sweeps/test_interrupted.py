"""Sweeps that a signal ends: nothing is left behind, nothing is said, and the same command goes on."""

import contextlib
import os
import pathlib
import signal
import subprocess
import sys
import time

import psutil
import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "killpg"), reason="there are no groups of processes on Windows"),
]
FILE = pathlib.Path("examples/four_bar.yaml").resolve()
SCRIPT = """
import sys
import jounce as jn
if __name__ == "__main__":
    jn.sweep(sys.argv[1], {"BC": "13cm:15cm:4000"}, sys.argv[2], order=1, workers=1, chunk=16)
"""


def started(command, folder):
    (folder / "tmp").mkdir(exist_ok=True)
    surroundings = os.environ | {"TMPDIR": str(folder / "tmp"), "XDG_CACHE_HOME": str(folder / "cache")}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, env=surroundings, start_new_session=True, **pipes)


def wait_until(condition, process=None):
    stop = time.monotonic() + 240
    while not condition():
        assert process is None or process.poll() is None
        assert time.monotonic() < stop
        time.sleep(0.05)


def workers_of(process):
    with contextlib.suppress(psutil.Error):
        return [child for child in psutil.Process(process.pid).children() if "spawn_main" in " ".join(child.cmdline())]


def are_left(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("interrupted")


@pytest.mark.parametrize(
    "name, send, when",
    [
        ("SIGINT", "killpg", "computing"),
        ("SIGINT", "killpg", "importing"),
        ("SIGTERM", "kill", "starting"),
        ("SIGHUP", "killpg", "computing"),
        ("SIGKILL", "kill", "starting"),
        ("SIGKILL", "killpg", "computing"),
    ],
)
def test_nothing_is_left_and_nothing_is_said(folder, name, send, when):
    out = folder / f"{name}_{when}.zarr"
    command = [sys.executable, "-m", "jounce", "sweep", str(FILE), "--order", "1", "--workers", "1", "--chunk", "16"]
    number = getattr(signal, name)
    process = started([*command, "--vary", "BC=13cm:15cm:4000", "--out", str(out)], folder)
    wait_until(lambda: any(out.glob("chunks/digest/c/[0-9]*" if when == "computing" else ".scratch-*")), process)
    if when == "importing":  # what its workers need, in which they would say where they were
        wait_until(lambda: workers_of(process), process)
    assert any(out.glob(".scratch-*"))
    getattr(os, send)(process.pid, number)
    printed, messages = process.communicate(timeout=60)
    wait_until(lambda: not are_left(process.pid))  # its workers, too
    assert process.returncode == (-number if name == "SIGKILL" else 128 + number)
    assert (printed, messages) == ("", "")
    assert not any((folder / "tmp").iterdir())
    assert any(out.glob(".scratch-*")) == (name == "SIGKILL")
    if name == "SIGKILL":  # what nobody could remove the next run does, though it is stopped, too
        done = len(list(out.glob("chunks/digest/c/[0-9]*")))
        left = {*out.glob(".scratch-*")}
        process = started([*command, "--vary", "BC=13cm:15cm:4000", "--out", str(out)], folder)
        wait_until(lambda: len(list(out.glob("chunks/digest/c/[0-9]*"))) > done, process)
        assert not left & {*out.glob(".scratch-*")}
        process.terminate()
        process.communicate(timeout=60)
        assert not any(out.glob(".scratch-*"))


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_script_that_is_interrupted_leaves_no_more_than_its_own_folder(folder, name):
    script, out = folder / "sweeping.py", folder / f"script_{name}.zarr"
    script.write_text(SCRIPT)
    process = started([sys.executable, str(script), str(FILE), str(out)], folder)
    wait_until(lambda: any(out.glob("chunks/digest/c/[0-9]*")), process)
    os.killpg(process.pid, getattr(signal, name))
    _, printed = process.communicate(timeout=60)
    wait_until(lambda: not are_left(process.pid))
    assert process.returncode == -getattr(signal, name)
    assert not any((folder / "tmp").iterdir())
    if name == "SIGTERM":
        assert printed == ""
    else:
        assert printed.endswith("KeyboardInterrupt\n")
        assert "semaphore" not in printed
    assert name == "SIGTERM" or not any(out.glob(".scratch-*"))
