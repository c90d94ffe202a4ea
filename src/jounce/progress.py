"""Progress of long computations, on a terminal or in a notebook: ``from jounce import progress; progress.show()``."""

from __future__ import annotations

from jounce.reporting.progress import Display

__all__ = ["hide", "show"]

_display: Display | None = None


def show() -> None:
    """Show from here on what is being computed, wherever that takes longer than two seconds.

    A line says what is solved, simulated or optimized, how much of it is done, and which program is compiled. In a
    notebook it is shown below the cell that runs, elsewhere it goes to standard error; it disappears with the work.

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
    """Show it no longer."""
    global _display
    if _display is not None:
        _display.__exit__()
        _display = None
