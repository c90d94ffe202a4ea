"""Signals that stop the process, and forks of it.

A signal to stop ends the command at once, with a status that says so, and nothing half written.

`KeyboardInterrupt` is no way to end a program that computes in JAX: raised in a callback of the tracer or the collector
it is lost, and the command goes on; raised while XLA's threads compile, the interpreter is taken down under them. So
the command handles signals itself, from before the libraries are imported: it undoes what it has begun and leaves the
process without unwinding anything. Nothing of it is active in a program that imports this package.
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
PATIENCE = 0.2  # s that the main thread has to come out of native code before another one ends the process
STATUS = 128  # of a process ended by a signal, plus its number

_undo: dict[object, Callable[[], object]] = {}
_ending = threading.Lock()
_ender = 0  # the thread that ends the process
_left_behind = False  # whether the threads of XLA stayed in the process that this one was forked from


def is_command() -> bool:
    """Tell whether this process was started as the command ``jounce`` or as ``python -m jounce``."""
    if sys.argv[:1] == ["-m"]:  # while the module is being looked for
        given = sys.orig_argv
        after = given[given.index("-m") + 1 :] if "-m" in given else []
        return "-mjounce" in given or after[:1] == ["jounce"]
    folder, name = os.path.split(sys.argv[0] if sys.argv else "")  # pathlib takes a while to import
    if name == "__main__.py":
        return os.path.basename(folder) == "jounce"  # noqa: PTH119
    return name.removesuffix(".exe").removesuffix("-script.py") == "jounce"


def end_on_signals() -> None:
    """End this process on Ctrl-C, SIGTERM and SIGHUP, each unless ignored, with status 128 plus the signal's number.

    Python calls handlers between two of its own instructions in the main thread, which may be in native code for long,
    or for ever: a second thread is woken by the signal itself, and ends the process if the handler has not.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is _end:
        return
    handled = [number for number in SIGNALS if signal.getsignal(number) not in (signal.SIG_IGN, None)]
    reading, writing = _pipe()
    os.set_blocking(writing, False)
    for number in handled:
        signal.signal(number, _end)
    atexit.register(_done, handled)  # the first to be registered is the last to be called
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(reading,), name="jounce-signals", daemon=True).start()


def _done(handled: list[signal.Signals]) -> None:
    """Ignore signals from here on: Python gives handlers up as it ends, and the status shall say that all was done."""
    for number in handled:
        signal.signal(number, signal.SIG_IGN)


def _pipe() -> tuple[int, int]:
    """Return a pipe; standard files that are closed go nowhere first, or it, or a result, would take their places."""
    while (nowhere := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(nowhere)
    return os.pipe()


def _watch(reading: int) -> None:
    while number := os.read(reading, 1):
        if number[0] in SIGNALS and signal.getsignal(number[0]) is _end:
            time.sleep(PATIENCE)
            _end(number[0])


def _end(number: int, _frame: object = None) -> None:
    """Undo what was begun and leave; no lock is needed for it that the interrupted thread might hold."""
    global _ender
    if not _ending.acquire(blocking=False):
        while _ender != threading.get_ident():  # another thread is at it; nothing new may be begun meanwhile
            time.sleep(1.0)
        return
    _ender = threading.get_ident()
    for undo in list(_undo.values())[::-1]:
        with suppress(Exception):
            undo()
    os._exit(STATUS + number)


@contextmanager
def cleanup_on_signal(undo: Callable[[], object]) -> Iterator[None]:
    """Call a function if a signal ends the process meanwhile, such as one that removes an unfinished file.

    It may run in any thread while another stands still anywhere, so it must need no lock.
    """
    key = object()
    _undo[key] = undo
    try:
        yield
    finally:
        del _undo[key]


@contextmanager
def raising() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt meanwhile, where the main thread only waits."""
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
    """Keep Ctrl-C from the processes that threads started meanwhile will start: they end with the command, silently.

    It goes to all processes of a terminal, and each would print where it was. The mask of a thread goes over to the
    threads and processes that it starts; this process hears of the signal by the thread that watches for it.
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
    """Have the processes that are forked from this one know it."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_after_fork)


def is_forked_after_jax() -> bool:
    """Tell whether this process was forked from one in which JAX had started: XLA's threads are not in it."""
    return _left_behind


def _after_fork() -> None:
    global _left_behind
    if "jax" not in sys.modules:
        return
    from jounce.base.jax_internals import processes_started

    _left_behind = _left_behind or processes_started()
