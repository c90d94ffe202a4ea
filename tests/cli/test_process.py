"""The command as a process: signals at any time, standard streams that are closed or full, terminals of any kind."""

import os
import pathlib
import random
import signal
import subprocess
import sys
import time

import pytest

import jounce as jn
from jounce.cli.standard_streams import FailSafeStream

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOUR_BAR = str(ROOT / "examples" / "four_bar.yaml")
COMMAND = [sys.executable, "-m", "jounce"]
ENVIRONMENT = os.environ | {"JOUNCE_CACHE_DIR": ""}
PROC = pathlib.Path("/proc/self/status").exists()


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Compiled programs, for what needs no cold start."""
    return {"JOUNCE_CACHE_DIR": str(tmp_path_factory.mktemp("cache"))}


@pytest.fixture(autouse=True)
def _interruptible(monkeypatch):
    """A process inherits that a signal is ignored, as it is in jobs in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def wait_for_handler(process):
    """Wait until a process has a handler of SIGTERM, which Python alone has not."""
    status, deadline = pathlib.Path(f"/proc/{process.pid}/status"), time.monotonic() + 60
    while PROC and time.monotonic() < deadline and process.poll() is None:
        caught = next(line for line in status.read_text().splitlines() if line.startswith("SigCgt"))
        if int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.01)
    if not PROC:
        time.sleep(1.0)


def stopped(number, after, *arguments, cwd=None):
    """Send a process a signal some seconds after it can take one: status (None: it was done before) and output."""
    process = subprocess.Popen(
        arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=cwd, env=ENVIRONMENT
    )
    wait_for_handler(process)
    time.sleep(after)
    done = process.poll() is not None
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    return None if done else process.returncode, out, err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_command_with_its_status_and_without_a_word(number, tmp_path):
    after = random.Random(int(number)).uniform(0.0, 1.0)
    status, out, err = stopped(number, after, *COMMAND, "run", FOUR_BAR, "--out", "motion.csv", cwd=tmp_path)
    assert (status, out, err) == (128 + number, "", "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "number, command, name",
    [
        (signal.SIGINT, "run", "motion.nc"),
        (signal.SIGTERM, "plot", "film.mp4"),
        (signal.SIGINT, "report", "page.html"),
    ],
)
def test_a_signal_at_any_time(number, command, name, tmp_path):
    draw = random.Random(f"{number} {command}")
    ended = 0
    for attempt in range(4):  # the last one comes in time on any machine
        arguments = [*COMMAND, command, FOUR_BAR, "--out", name]
        status, _, err = stopped(number, draw.uniform(0.0, 6.0 / 2**attempt), *arguments, cwd=tmp_path)
        assert err == ""
        if status is not None and status != 0:  # 0: it was done while the signal was on its way
            assert status == 128 + number
            ended += 1
        assert {path.name for path in tmp_path.iterdir()} <= {name}
        (tmp_path / name).unlink(missing_ok=True)
    assert ended >= 1


DEAF = {
    "native code": "hashlib.pbkdf2_hmac('sha256', b'a', b'b', 10**9)",
    "a finalizer, in which exceptions are lost": "Deaf()",
    "a handler of every exception": "\nwhile True:\n try: time.sleep(60)\n except BaseException: pass",
}


@pytest.mark.slow
@pytest.mark.parametrize("where", DEAF)
def test_a_signal_is_heard_where_an_exception_is_not(where, tmp_path):
    program = (
        "import hashlib, pathlib, time; from jounce.base.interrupts import end_on_signals, cleanup_on_signal\n"
        "class Deaf:\n def __del__(self):\n  while True: pass\n"
        "begun = pathlib.Path('begun'); begun.touch()\n"
        "with cleanup_on_signal(begun.unlink):\n end_on_signals()\n " + DEAF[where].replace("\n", "\n ")
    )
    status, out, err = stopped(signal.SIGINT, 0.3, sys.executable, "-c", program, cwd=tmp_path)
    assert (status, out, err) == (130, "", "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_after_the_work_is_done_changes_nothing(number, tmp_path):
    program = (
        "import pathlib, signal, time; from jounce.base.interrupts import end_on_signals\n"
        "class Last:\n def __del__(self, touch=pathlib.Path('ending').touch, sleep=time.sleep): touch(); sleep(1)\n"
        "last = Last(); end_on_signals()"
    )
    process = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE, cwd=tmp_path, env=ENVIRONMENT)
    deadline = time.monotonic() + 60
    while not (tmp_path / "ending").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, b"")


def test_many_signals_at_once_end_it_too():
    process = subprocess.Popen([*COMMAND, "run", FOUR_BAR], stderr=subprocess.PIPE, env=ENVIRONMENT)
    wait_for_handler(process)
    for number in [signal.SIGINT, signal.SIGTERM] * 20:
        process.send_signal(number)
    assert process.communicate(timeout=60)[1] == b""
    assert process.returncode in (130, 143)


def test_a_program_that_imports_the_package_keeps_its_own_signals():
    program = "import signal, jounce; assert signal.getsignal(signal.SIGINT) is signal.default_int_handler"
    assert subprocess.run([sys.executable, "-c", program], env=ENVIRONMENT, timeout=60, check=False).returncode == 0


def shell(script, cwd=None, **environment):
    """Run a line of bash in which jounce is the command."""
    line = f'jounce() {{ "{sys.executable}" -m jounce "$@"; }}; {script}'
    given = {"capture_output": True, "text": True, "cwd": cwd, "env": ENVIRONMENT | environment, "timeout": 120}
    return subprocess.run(["bash", "-c", line], check=False, **given)


@pytest.mark.slow
@pytest.mark.parametrize(
    "redirection, reason", [(">/dev/full", "No space left on device"), (">&-", "Bad file descriptor")]
)
@pytest.mark.parametrize("arguments", ["inspect FILE", "inspect FILE --json", "--help"])
def test_standard_output_that_cannot_be_written(redirection, reason, arguments):
    done = shell(f"jounce {arguments.replace('FILE', FOUR_BAR)} {redirection}")
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert reason in done.stderr
    assert done.stderr.startswith('{"error"' if "json" in arguments else "error: standard output")


@pytest.mark.slow
def test_a_file_is_written_though_nobody_reads_the_table(tmp_path, cache):
    done = shell(f"jounce run {FOUR_BAR} --order 0 --out a.csv | true; exit ${{PIPESTATUS[0]}}", tmp_path, **cache)
    assert (done.returncode, done.stderr) == (0, "")
    done = shell(f"jounce run {FOUR_BAR} --order 0 --out b.csv <&- >&- 2>&-", tmp_path, **cache)
    assert (done.returncode, done.stderr) == (1, "")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 202


@pytest.mark.slow
def test_bad_input_is_2_though_nobody_can_read_it():
    assert shell("jounce run none.yaml 2>/dev/full").returncode == 2
    assert shell("jounce run none.yaml 2>&-").returncode == 2


def test_a_folder_that_was_removed_meanwhile_is_no_hindrance(tmp_path):
    done = shell(f'mkdir gone; cd gone; rmdir "$PWD"; PYTHONPATH={ROOT / "src"} jounce --version', cwd=tmp_path)
    assert (done.returncode, done.stdout.strip()) == (0, jn.__version__), done.stderr


def test_text_goes_through_a_stream_that_lasts(capsys):
    stream = FailSafeStream(sys.stdout)
    stream.writelines(["a", "b"])
    stream.flush()
    assert (capsys.readouterr().out, stream.failure, stream.isatty()) == ("ab", None, False)


def on_terminal(columns, *arguments, **environment):
    """Run the command on a terminal of some columns and return what it shows."""
    import fcntl
    import pty
    import struct
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    kept = {k: v for k, v in ENVIRONMENT.items() if k not in ("COLUMNS", "LINES", "NO_COLOR")}
    process = subprocess.Popen(
        [*COMMAND, *arguments], stdin=theirs, stdout=theirs, stderr=theirs, env=kept | environment
    )
    os.close(theirs)
    shown = b""
    while True:
        try:
            piece = os.read(ours, 65536)
        except OSError:  # how Linux says that nobody is at the other end any more
            piece = b""
        if not piece:
            break
        shown += piece
    os.close(ours)
    assert process.wait(60) == 0
    return shown.decode()


@pytest.mark.slow
@pytest.mark.parametrize(
    "columns, environment", [(80, {"COLUMNS": "0"}), (40, {}), (80, {"TERM": "dumb"}), (0, {"COLUMNS": "\u00b2"})]
)
def test_a_terminal_of_any_size_shows_every_number(columns, environment, cache):
    shown = on_terminal(columns, "run", FOUR_BAR, "--order", "0", **{"TERM": "xterm"} | environment | cache)
    for number in ("2.06531", "2.64358", "-0.0463302", "0.0357081", "0.0970169", "0.178769"):
        assert number in shown
    assert "largest magnitude" in shown
    if environment.get("TERM") == "dumb":
        assert "\x1b" not in shown
        assert "2.64358*" in shown


def test_help_on_a_terminal_that_does_not_tell_its_width():
    assert "Usage" in on_terminal(80, "--help", TERM="xterm", COLUMNS="0")


@pytest.mark.slow
@pytest.mark.parametrize(
    "names, arguments",
    [
        (("numpy", "jax", "scipy", "yaml", "csv", "cyclopts", "pydantic"), ("run", FOUR_BAR, "--order", "0")),
        (
            ("numpy", "csv", "signal", "socket", "threading", "tempfile", "pickle"),
            ("sweep", FOUR_BAR, "--vary", "BC=13cm:15cm:3", "--order", "0", "--workers", "1", "--out", "a.zarr"),
        ),
    ],
)
def test_files_of_the_user_that_are_named_as_modules_are_not_run(names, arguments, tmp_path, cache):
    for name in names:
        (tmp_path / f"{name}.py").write_text(f"open('it_ran', 'a').write({name!r})\nraise RuntimeError\n")
    script = tmp_path / "bin" / "script.py"  # as the one that is installed: it searches its own folder
    script.parent.mkdir()
    script.write_text("import sys\nfrom jounce.cli import main\nif __name__ == '__main__':\n    sys.exit(main())\n")
    start = [sys.executable, str(script)]
    for command in (COMMAND, start) if arguments[0] == "run" else (start,):
        done = subprocess.run(
            [*command, *arguments], cwd=tmp_path, env=ENVIRONMENT | cache, capture_output=True, text=True, timeout=300
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert "psi" in done.stdout
    assert not (tmp_path / "it_ran").exists()
