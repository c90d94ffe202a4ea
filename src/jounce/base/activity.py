"""The current activity of the package: programs that are being compiled, and the progress of counts.

Nothing is displayed by this module. A display, on a terminal or in a notebook, polls `now`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

_lock = threading.Lock()
_compiled: dict[object, str] = {}  # programs that are being compiled, the latest last
_count: Count | None = None


@dataclass(frozen=True)
class Activity:
    """The current activity: its description, the amount done, the total, and the unit of both."""

    words: str
    done: int = 0
    total: int | None = None
    unit: str = ""


class Count:
    """The progress of a computation; of nested counts, the outermost is reported.

    Parameters
    ----------
    words : str
        Description of the computation, such as ``solving``.
    unit : str, optional
        Counted items, if counts and a rate are of interest.
    report : callable, optional
        Function that is called with each count, too, as `progress` of `jounce.solve`.

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
        """Report the amount done and the total."""
        self.activity = Activity(self.activity.words, done, total, self.activity.unit)
        if self._report is not None:
            self._report(done, total, *more)


@contextmanager
def compiling(function: Any) -> Iterator[None]:
    """Report a function by name as being compiled within the context."""
    token, name = object(), getattr(function, "__name__", "a function")
    with _lock:
        _compiled[token] = name.strip("_<>").replace("_", " ")
    try:
        yield
    finally:
        with _lock:
            del _compiled[token]


def now() -> Activity | None:
    """Return the current activity; None if there is none."""
    with _lock:
        activity = _count.activity if _count is not None else None
        compiled = list(_compiled.values())[-1:]
    if compiled and (activity is None or not activity.done):
        before = f"{activity.words}: " if activity else ""
        return Activity(f"{before}compiling {compiled[0]}")
    return activity
