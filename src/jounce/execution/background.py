"""Programs by their cache keys, each made once, and those that will be needed made in another thread beforehand.

Tracing has Python's lock, LLVM and XLA compile without it. So one thread works for all; who waits for a program that it
makes takes up what comes next meanwhile.
"""

import contextlib
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

import jax
import numpy as np

from jounce.execution.threads import in_callers_context, thread_count

NAME = "jounce-compilation"
_queued: deque[Callable[[], Any]] = deque()
_had: set[Any] = set()
_worker: threading.Thread | None = None
_thread = threading.local()


class ByKey:
    """Programs by their cache keys: the first thread that asks for one makes it, and others wait for it."""

    def __init__(self) -> None:
        self._made: dict[Any, Future[Any]] = {}  # those under way included
        self._programs: dict[Any, Any] = {}
        self._lock = threading.Lock()

    def __len__(self) -> int:
        """How many there are, those under way included."""
        return len(self._made)

    def clear(self) -> None:
        """Forget them."""
        self._made.clear()
        self._programs.clear()

    def values(self) -> list[Any]:
        """Return those that are there."""
        return list(self._programs.values())

    def get(self, key: Any, make: Callable[[], Any]) -> Any:
        """Return the program of a key, which is made unless another thread has it or is about to."""
        if (program := self._programs.get(key, self)) is not self:
            return program
        with self._lock:
            first = key not in self._made
            future = self._made.setdefault(key, Future())
        if first:
            try:
                self._programs[key] = result = make()
            except BaseException as error:
                del self._made[key]
                future.set_exception(error)
                raise
            future.set_result(result)
        while not future.done() and _took_up_next():
            pass
        if future.exception() is not None:  # of a thread whose program may not be needed any more
            return self.get(key, make)
        return future.result()


def prepare_later(job: Callable[[], Any], name: str, arguments: Any, *static: Any) -> None:
    """Do a job in another thread, for the programs that it has made; what it raises is dropped.

    That is done the first time that a job of a name is given for arguments of such a structure and such shapes, unless
    there is one thread to compute.

    Parameters
    ----------
    job : callable
        To be called.
    name : str
        Of the job.
    arguments : pytree of array
        On the form of which its programs depend.
    *static
        On what else they do.
    """
    global _worker
    if thread_count() < 2:
        return
    leaves, structure = jax.tree.flatten(arguments)
    key = name, structure, tuple(map(np.shape, leaves)), static
    if key in _had:
        return
    _had.add(key)
    _queued.append(partial(in_callers_context(_tried), job))
    if _worker is None or not _worker.is_alive():
        _worker = threading.Thread(target=_work, name=NAME)
        _worker.start()


def is_ahead() -> bool:
    """Tell whether what this thread does is a job whose programs are made beforehand."""
    return getattr(_thread, "busy", False)


def is_compiling() -> bool:
    """Tell whether some thread still compiles what was to be there beforehand."""
    return _worker is not None and _worker.is_alive()


def _work() -> None:
    while threading.main_thread().is_alive() and _took_up_next():  # a program that ends waits for one job at most
        pass


def _took_up_next() -> bool:
    """Do the next job that is queued; tell whether there was one, and this thread is not at one already."""
    if is_ahead():
        return False
    try:
        job = _queued.popleft()
    except IndexError:
        return False
    _thread.busy = True
    try:
        job()
    finally:
        _thread.busy = False
    return True


def _tried(job: Callable[[], Any]) -> None:
    with contextlib.suppress(Exception), np.errstate(all="ignore"):
        job()
