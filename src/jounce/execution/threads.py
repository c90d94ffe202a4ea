"""Computation of several batches at once in threads: compiled programs release Python's lock while they run."""

import numbers
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, TypeVar

import jax

from jounce.base.shapes import Refused
from jounce.errors import MechanismError
from jounce.execution.llvm.machine import core_count
from jounce.settings import own_settings

Item = TypeVar("Item")
Result = TypeVar("Result")
VARIABLE = "JOUNCE_THREADS"
AHEAD = 2  # results for each thread that may wait to be fetched


def thread_count(given: int | Refused | None = None) -> int:
    """Return the number of threads: as given, as set by the environment, or the cores of this process.

    Raises
    ------
    MechanismError
        If it is not a whole number above zero.
    """
    setting = os.environ.get(VARIABLE, "") if given is None else ""
    if given is None and not setting:
        return core_count()
    count: Any = int(setting) if setting.isdecimal() else setting or given
    if not isinstance(count, numbers.Integral) or isinstance(count, bool) or count < 1:
        name = VARIABLE if setting else "threads"
        raise MechanismError("the number of threads must be a whole number above zero", name=name, value=count)
    return int(count)


def callers_context() -> Callable[[], AbstractContextManager[Any]]:
    """Return a factory of this thread's context for other threads, since contexts of JAX hold for one thread only."""
    device: Any = getattr(jax.config, "jax_default_device", None)

    @contextmanager
    def context() -> Iterator[None]:
        with own_settings(), nullcontext() if device is None else jax.default_device(device):
            yield

    return context


def in_callers_context(function: Callable[[Item], Result]) -> Callable[[Item], Result]:
    """Return a function that another thread calls in the context of this one."""
    context = callers_context()

    def called(item: Item) -> Result:
        with context():
            return function(item)

    return called


class Threads:
    """A pool of threads that compute one batch each while the caller waits; to be used as a context manager.

    Parameters
    ----------
    count : int
        Number of threads; a single one is that of the caller.
    compiled : bool, default False
        Whether the function is compiled already, so that the first item need not go before the others.
    """

    def __init__(self, count: int, *, compiled: bool = False):
        self.count = count
        self._pool: ThreadPoolExecutor | None = None
        self._compiled = compiled

    def __enter__(self) -> "Threads":
        return self

    def __exit__(self, *error: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Yield the results of a function for each item, in order; a few may be computed ahead.

        A pool must map only one function, or functions with one compiled program.
        """
        items = deque(items)
        if items and not self._compiled:  # the first item compiles the program for the others
            self._compiled = True
            yield function(items.popleft())
        if self.count == 1 or len(items) < 2:
            yield from map(function, items)
            return
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.count, thread_name_prefix="jounce")
        pending, worker = deque[Future[Result]](), in_callers_context(function)
        for item in items:
            pending.append(self._pool.submit(worker, item))
            if len(pending) > AHEAD * self.count:
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()
