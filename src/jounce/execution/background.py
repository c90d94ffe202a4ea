"""Programs by cache key, each compiled once, and compilation ahead of need in a background thread.

Tracing holds Python's lock, while LLVM and XLA compile without it, so a single background thread suffices. A thread
that waits for its program takes the next job from the queue meanwhile.
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
    """Programs by cache key: the first thread that requests a program makes it, and other threads wait for it."""

    def __init__(self) -> None:
        self._made: dict[Any, Future[Any]] = {}  # including programs in progress
        self._programs: dict[Any, Any] = {}
        self._lock = threading.Lock()

    def __len__(self) -> int:
        """Return the number of programs, including those in progress."""
        return len(self._made)

    def clear(self) -> None:
        """Forget all programs."""
        self._made.clear()
        self._programs.clear()

    def values(self) -> list[Any]:
        """Return the finished programs."""
        return list(self._programs.values())

    def get(self, key: Any, make: Callable[[], Any]) -> Any:
        """Return the program of a key; make it unless another thread has made it or is making it."""
        if (program := self._programs.get(key, self)) is not self:
            return program
        with self._lock:
            is_first = key not in self._made
            future = self._made.setdefault(key, Future())
        if is_first:
            try:
                self._programs[key] = result = make()
            except BaseException as error:
                del self._made[key]
                future.set_exception(error)
                raise
            future.set_result(result)
        while not future.done() and _took_up_next():
            pass
        if future.exception() is not None:  # the failure of another thread, whose job may be out of date
            return self.get(key, make)
        return future.result()


def prepare_later(job: Callable[[], Any], name: str, arguments: Any, *static: Any) -> None:
    """Run a job that compiles programs in the background thread; its errors are dropped.

    A job runs once for each name and each structure and shapes of the arguments. Nothing runs if computation is
    limited to one thread.

    Parameters
    ----------
    job : callable
        Function to call.
    name : str
        Name of the job.
    arguments : pytree of array
        Arguments whose structure and shapes determine its programs.
    *static
        Other values that determine its programs.
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
    """Return whether this thread runs a job that compiles programs ahead of need."""
    return getattr(_thread, "busy", False)


def is_compiling() -> bool:
    """Return whether the background thread is still compiling."""
    return _worker is not None and _worker.is_alive()


def _work() -> None:
    while threading.main_thread().is_alive() and _took_up_next():  # a process that ends waits for one job at most
        pass


def _took_up_next() -> bool:
    """Run the next job in the queue; return False if there is none, or if this thread already runs a job."""
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
