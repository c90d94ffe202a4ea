"""Several batches at once, in threads: compiled programs release Python's lock while they run."""

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
    """Return how many threads compute: those given, or set by the environment, or the cores that this process has.

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
    """Return what makes the context of another thread: what `with` sets in JAX holds for one thread only."""
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
    """Threads that compute one batch each, while the one that asks waits, started when there are several; to be closed.

    Parameters
    ----------
    count : int
        Of threads; of one, it is that which asks.
    compiled : bool, default False
        Whether what they are to compute is compiled already, so that none has to go before the others.
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
        """Yield what a function returns for each item, in their order; it may compute a few of them beforehand.

        It is one function, or one compiled program, for all items that these threads map.
        """
        items = deque(items)
        if items and not self._compiled:  # what the first one compiles, the others find
            self._compiled = True
            yield function(items.popleft())
        if self.count == 1 or len(items) < 2:
            yield from map(function, items)
            return
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.count, thread_name_prefix="jounce")
        waiting, called = deque[Future[Result]](), in_callers_context(function)
        for item in items:
            waiting.append(self._pool.submit(called, item))
            if len(waiting) > AHEAD * self.count:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
