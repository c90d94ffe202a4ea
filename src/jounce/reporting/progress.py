"""A progress line for computations that take longer than two seconds, on a terminal or in a notebook."""

from __future__ import annotations

import html
import os
import sys
import threading
import time
from contextlib import ExitStack
from typing import Any

from jounce.base.activity import Activity, now
from jounce.base.interrupts import cleanup_on_signal

PATIENCE = 2.0  # s before the line appears
PACE = 0.2  # s between updates
SHOW_CURSOR = b"\r\x1b[2K\x1b[?25h"  # clears the line and shows the cursor, which the progress line hides

_shown: Display | None = None


def in_notebook() -> bool:
    """Return whether this process is the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and hasattr(shell, "kernel")


def pause() -> None:
    """Remove the line while other output is written; it returns if the work takes as long again."""
    if _shown is not None:
        _shown.pause()


class Display:
    """A line with a bar, a count and the remaining time, shown by a thread during work.

    Parameters
    ----------
    task : str, optional
        Text for work without an activity of its own; without it, such work shows no line.
    """

    def __init__(self, task: str = ""):
        self._task = task
        self._lock, self._end = threading.Lock(), threading.Event()
        self._since: float | None = time.monotonic() if task else None
        self._line: Any = None
        self._thread = threading.Thread(target=self._watch, name="jounce progress", daemon=True)

    def __enter__(self) -> Display:
        global _shown
        _shown = self
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        global _shown
        _shown = None
        self._end.set()
        self._thread.join()

    def pause(self) -> None:
        """Remove the line."""
        with self._lock:
            self._since = time.monotonic()
            self._close()

    def _watch(self) -> None:
        while not self._end.wait(PACE):
            with self._lock:
                self._look()
        with self._lock:
            self._close()

    def _look(self) -> None:
        activity = now() or (Activity(self._task) if self._task else None)
        if activity is None:
            self._since = None
            self._close()
            return
        self._since = time.monotonic() if self._since is None else self._since
        if self._line is None and time.monotonic() - self._since >= PATIENCE:
            self._line = _NotebookLine() if in_notebook() else _TerminalLine()
        if self._line is not None:
            self._line.show(activity)

    def _close(self) -> None:
        if self._line is not None:
            self._line.close()
            self._line = None


class _TerminalLine:
    """A progress line of rich on standard error."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[counts]}"),
            TimeElapsedColumn(),
        )
        quiet: Any = {"auto_refresh": False, "transient": True, "redirect_stdout": False, "redirect_stderr": False}
        self._bar = Progress(*columns, console=Console(stderr=True), **quiet)
        self._shown = ExitStack()
        self._shown.enter_context(cleanup_on_signal(lambda: os.write(2, SHOW_CURSOR)))
        self._shown.enter_context(self._bar)
        self._started = time.monotonic()
        self._id = self._bar.add_task("", total=None, counts="")

    def show(self, activity: Activity) -> None:
        self._bar.update(self._id, description=activity.words, total=activity.total, completed=activity.done)
        self._bar.update(self._id, counts=_counts(activity), refresh=True)

    def close(self) -> None:
        self._shown.close()


class _NotebookLine:
    """A progress line below the running cell of a notebook."""

    def __init__(self) -> None:
        from IPython.core.display import HTML
        from IPython.display import display

        self._html, self._started = HTML, time.monotonic()
        self._handle: Any = display(HTML(""), display_id=True)

    def show(self, activity: Activity) -> None:
        bar = "" if activity.total is None else f'<progress value="{activity.done}" max="{activity.total}"></progress> '
        phrase = f"{html.escape(activity.words)} {_counts(activity)} {time.monotonic() - self._started:.0f} s"
        self._handle.update(self._html(f"{bar}{phrase}"))

    def close(self) -> None:
        self._handle.update(self._html(""))


def _counts(activity: Activity) -> str:
    """Return the finished part of an activity as text.

    Examples
    --------
    >>> _counts(Activity("solving", 30, 120)), _counts(Activity("sweeping", 30, 120, "designs"))
    ('25 %', '30 of 120 designs')
    """
    if not activity.total:
        return ""
    if activity.unit:
        return f"{activity.done} of {activity.total} {activity.unit}"
    return f"{100 * activity.done // activity.total} %"
