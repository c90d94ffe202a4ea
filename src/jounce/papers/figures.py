"""Common elements of the figures of papers: panels with a title, a note and a legend below. Imports matplotlib."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jounce.plot.style import GRAY, blank_figure

NOTE_SIZE = 7.5  # points


def panels(
    rows: int, columns: int, size: tuple[float, float], title: str, note: str = "", **shared: Any
) -> tuple[Figure, np.ndarray]:
    """Return a figure, in inches, with a note below it, and its panels, (rows, columns)."""
    figure = blank_figure(*size, title)
    if note:
        figure.supxlabel(note, fontsize=NOTE_SIZE, color=GRAY)
    return figure, figure.subplots(rows, columns, squeeze=False, **shared)


def legend_below(figure: Figure, panel: Axes, columns: int, note: str = "") -> None:
    """Put the legend of a panel below all of them, with a note above it."""
    labels = panel.get_legend_handles_labels()
    figure.legend(*labels, loc="outside lower center", ncols=columns, title=note or None, title_fontsize=NOTE_SIZE)
