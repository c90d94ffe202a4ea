"""Progress of long computations, on a terminal or in a notebook: ``from jounce import progress; progress.show()``."""

from __future__ import annotations

from jounce.reporting.progress import Display

__all__ = ["hide", "show"]

_display: Display | None = None


def show() -> None:
    """Show the progress of all further computations that take longer than two seconds.

    A line tells what is solved, simulated or optimized, how much is done, and which program is being compiled. It
    appears below the running cell of a notebook, or on standard error, and disappears at the end.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce import progress
    >>> progress.show()
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"))
    >>> progress.hide()
    """
    global _display
    if _display is None:
        _display = Display().__enter__()


def hide() -> None:
    """Stop showing progress."""
    global _display
    if _display is not None:
        _display.__exit__()
        _display = None
