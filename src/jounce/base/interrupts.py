"""Signals that stop the process, and forks of it.

A signal ends the command at once, with the conventional exit status and without unfinished files.

`KeyboardInterrupt` does not reliably end a program that computes in JAX. Raised in a callback of the tracer or the
garbage collector it is lost, and the command continues; raised while XLA's threads compile, it shuts the interpreter
down under them. The command therefore handles signals itself, from before the import of the libraries: it removes
unfinished work and exits without unwinding. None of this is active in a program that imports this package.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
PATIENCE = 0.2  # s for the main thread to leave native code before another thread ends the process
STATUS = 128  # exit status of a process ended by a signal, less the number of the signal

_undo: dict[object, Callable[[], object]] = {}
_ending = threading.Lock()
_ender = 0  # the thread that ends the process
_left_behind = False  # whether this process was forked from one with XLA threads


def is_command() -> bool:
    """Return whether this process was started as the command ``jounce`` or as ``python -m jounce``."""
    if sys.argv[:1] == ["-m"]:  # during the search for the module
        given = sys.orig_argv
        after = given[given.index("-m") + 1 :] if "-m" in given else []
        return "-mjounce" in given or after[:1] == ["jounce"]
    folder, name = os.path.split(sys.argv[0] if sys.argv else "")  # without the slow import of pathlib
    if name == "__main__.py":
        return os.path.basename(folder) == "jounce"  # noqa: PTH119
    return name.removesuffix(".exe").removesuffix("-script.py") == "jounce"


def end_on_signals() -> None:
    """End this process on Ctrl-C, SIGTERM and SIGHUP, each unless ignored, with status 128 plus the signal's number.

    Python calls handlers between bytecode instructions of the main thread, which may be in native code for long. The
    signal therefore also wakes a second thread, which ends the process if the handler has not.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is _end:
        return
    handled = [number for number in SIGNALS if signal.getsignal(number) not in (signal.SIG_IGN, None)]
    reading, writing = _pipe()
    os.set_blocking(writing, False)
    for number in handled:
        signal.signal(number, _end)
    atexit.register(_done, handled)  # the first registered function is called last
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(reading,), name="jounce-signals", daemon=True).start()


def _done(handled: list[signal.Signals]) -> None:
    """Ignore signals from now on: the work is complete, and Python drops its handlers as it ends."""
    for number in handled:
        signal.signal(number, signal.SIG_IGN)


def _pipe() -> tuple[int, int]:
    """Return a pipe, after closed standard files are opened to the null device, so that no file takes their numbers."""
    while (null_device := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(null_device)
    return os.pipe()


def _watch(reading: int) -> None:
    while number := os.read(reading, 1):
        if number[0] in SIGNALS and signal.getsignal(number[0]) is _end:
            time.sleep(PATIENCE)
            _end(number[0])


def _end(number: int, _frame: object = None) -> None:
    """Remove unfinished work and exit, without any lock that the interrupted thread might hold."""
    global _ender
    if not _ending.acquire(blocking=False):
        while _ender != threading.get_ident():  # another thread ends the process; this one must not continue
            time.sleep(1.0)
        return
    _ender = threading.get_ident()
    for undo in list(_undo.values())[::-1]:
        with suppress(Exception):
            undo()
    os._exit(STATUS + number)


@contextmanager
def cleanup_on_signal(undo: Callable[[], object]) -> Iterator[None]:
    """Return a context in which a signal that ends the process calls `undo`, such as to remove an unfinished file.

    The function may run in any thread while another is stopped anywhere, so it must not need a lock.
    """
    key = object()
    _undo[key] = undo
    try:
        yield
    finally:
        del _undo[key]


@contextmanager
def raising() -> Iterator[None]:
    """Return a context in which Ctrl-C raises KeyboardInterrupt, for a main thread that only waits."""
    if signal.getsignal(signal.SIGINT) is not _end:
        yield
        return
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, _end)


@contextmanager
def interrupts_shielded() -> Iterator[None]:
    """Return a context whose threads start processes that ignore Ctrl-C, and so end silently with the command.

    Ctrl-C goes to all processes of a terminal, and each would print a traceback. Threads and processes inherit the
    signal mask of the thread that starts them; the watching thread still receives the signal for this process.
    """
    if signal.getsignal(signal.SIGINT) is not _end or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def mark_forks() -> None:
    """Have processes that are forked from this one detect the fork."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_after_fork)


def is_forked_after_jax() -> bool:
    """Return whether this process was forked from one in which JAX had started, so that XLA's threads are missing."""
    return _left_behind


def _after_fork() -> None:
    global _left_behind
    if "jax" not in sys.modules:
        return
    from jounce.base.jax_internals import processes_started

    _left_behind = _left_behind or processes_started()
