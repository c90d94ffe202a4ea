"""What is being done at the moment: which programs are compiled, and how much of a count is done.

Nothing is shown here. Whoever shows it, on a terminal or in a notebook, asks `now` from time to time.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

_lock = threading.Lock()
_compiled: dict[object, str] = {}  # programs that are compiled, the latest last
_count: Count | None = None


@dataclass(frozen=True)
class Activity:
    """What is being done: in words, with how much of it is done, of how much in all, and in which unit."""

    words: str
    done: int = 0
    total: int | None = None
    unit: str = ""


class Count:
    """A count that goes on while something is computed; of nested ones, the outermost is reported.

    Parameters
    ----------
    words : str
        What is done, such as ``solving``.
    unit : str, optional
        What is counted, where counts and a rate are of interest.
    report : callable, optional
        Is called with each count too, as `progress` of `jounce.solve`.

    Examples
    --------
    >>> with Count("solving") as count:
    ...     count(3, 10)
    ...     now()
    Activity(words='solving', done=3, total=10, unit='')
    >>> now() is None
    True
    """

    def __init__(self, words: str, unit: str = "", report: Callable[..., object] | None = None):
        self.activity = Activity(words, unit=unit)
        self._report = report

    def __enter__(self) -> Count:
        global _count
        with _lock:
            _count = self if _count is None else _count
        return self

    def __exit__(self, *_: object) -> None:
        global _count
        with _lock:
            _count = None if _count is self else _count

    def __call__(self, done: int, total: int, *more: Any) -> None:
        """Say how much is done."""
        self.activity = Activity(self.activity.words, done, total, self.activity.unit)
        if self._report is not None:
            self._report(done, total, *more)


@contextmanager
def compiling(function: Any) -> Iterator[None]:
    """Say that a program is compiled meanwhile, by the name of its function."""
    token, name = object(), getattr(function, "__name__", "a function")
    with _lock:
        _compiled[token] = name.strip("_<>").replace("_", " ")
    try:
        yield
    finally:
        with _lock:
            del _compiled[token]


def now() -> Activity | None:
    """Return what is being done; None if that is nothing known."""
    with _lock:
        counted = _count.activity if _count is not None else None
        compiled = list(_compiled.values())[-1:]
    if compiled and (counted is None or not counted.done):
        before = f"{counted.words}: " if counted else ""
        return Activity(f"{before}compiling {compiled[0]}")
    return counted
