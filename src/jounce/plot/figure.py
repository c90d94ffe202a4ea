"""Outputs of a motion and their derivatives over time: stacked panels, position on top, one column for each output."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from jounce.errors import MechanismError, check_name
from jounce.io.files.writing import check_target, replacing
from jounce.plot.labels import scale_of, symbol, unit_label
from jounce.plot.style import COLOURS, PALE_GREY, RESOLUTION, blank_figure, shown_name, style
from jounce.reporting.peaks import rate_name

__all__ = ["check_figure", "draw", "finish", "save", "shade_unsolved"]

SUFFIXES = (".png", ".svg", ".pdf")
COLUMNS = 5  # of outputs beside each other, at most
PANEL, SINGLE_PANEL = (3.5, 1.25), (4.8, 1.25)  # inches
LEGEND = {"borderaxespad": 0.1, "handlelength": 1.2, "handletextpad": 0.5, "columnspacing": 1.2}
STROKES = ("-", "--", ":")  # of more components than there are colours


def draw(motion: Any, outputs: Sequence[str] | None = None) -> Any:
    r"""Draw outputs of a motion and their derivatives over time.

    Parameters
    ----------
    motion : Motion
        Instants that were not solved are left out and shaded.
    outputs : sequence of str, optional
        Names of the outputs, one column each, in blocks of five below each other; all unless given.

    Returns
    -------
    matplotlib.figure.Figure
        Rows are position, velocity, ... as far as the order of the motion; an angular velocity starts in the second, a
        force in the third, beside the acceleration.

    Raises
    ------
    MechanismError
        No output has one of the names, or there is none.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw
    >>> figure = draw(jn.solve(jn.load("examples/four_bar.yaml"), order=2), ["psi"])
    >>> [axes.get_ylabel() for axes in figure.axes][2]
    'acceleration\n$\\ddot{\\psi}$  (rad/s$^2$)'
    """
    names = _chosen(motion, outputs)
    lost = [motion.mechanism.outputs[name].lost_orders for name in names]
    first = min(lost)
    rows = max(motion.order, max(lost)) + 1 - first
    with style():
        width, height = PANEL if len(names) > 1 else SINGLE_PANEL
        blocks = -(-len(names) // COLUMNS)
        columns = -(-len(names) // blocks)
        tall = height * rows * blocks + 0.9 + 0.45 * (blocks - 1)
        figure = blank_figure(width * columns + 0.3, tall, motion.mechanism.title)
        panels = figure.subplots(rows * blocks, columns, sharex=True, squeeze=False)
        for place in range(blocks * columns):
            block, column = divmod(place, columns)
            chosen = panels[block * rows : (block + 1) * rows, column]
            if place < len(names):
                _draw_column(motion, names[place], chosen, first)
                continue
            for axes in chosen:
                axes.set_axis_off()
        figure.align_ylabels()
    return figure


def _chosen(motion: Any, outputs: Sequence[str] | None) -> list[str]:
    valid = motion.outputs
    for name in outputs or ():
        check_name("output", name, valid, MechanismError, name="outputs")
    names = list(dict.fromkeys(outputs or valid))
    if not names:
        raise MechanismError("there is nothing to draw; name some outputs", name="outputs")
    return names


def _draw_column(motion: Any, name: str, panels: Any, first: int) -> None:
    """Draw one output: panel by panel its derivatives, with its components over each other."""
    output, values = motion.mechanism.outputs[name], motion.outputs[name]
    values = values[:, :, None] if values.ndim == 2 else values
    vector = values.shape[2] > 1
    for row, axes in enumerate(panels):
        order = row + first - output.lost_orders
        if not 0 <= order < values.shape[1]:
            axes.set_axis_off()
            continue
        exponent = scale_of(values[:, order])
        scaled = values[:, order] * 10.0**-exponent
        for c in range(values.shape[2]):
            axes.plot(
                motion.time,
                scaled[:, c],
                color=COLOURS[c % len(COLOURS)],
                linestyle=STROKES[c // len(COLOURS)],
                marker="o" if len(motion.time) == 1 else None,
                markersize=3,
                label=symbol(name, component=output.labels[c]) if vector else None,
            )
        shade_unsolved(axes, motion)
        finish(axes, motion.time, scaled)
        word = rate_name(output, order)
        word = f"{word} derivative" if row + first > 4 and not output.rate_names else word
        word = "angle" if row + first == 0 and output.unit == "rad" else word
        mark = "" if vector else symbol(name, order)
        axes.set_ylabel(f"{word}\n{mark}{'  ' if mark else ''}({unit_label(output.unit, order, exponent)})")
    top = panels[max(output.lost_orders - first, 0)]  # a force starts beside the acceleration
    top.set_title(shown_name(name), loc="left", pad=6)
    if vector:
        lines = panels[-1].get_lines()[: values.shape[2]]
        beside = len(lines) > len(COLOURS)  # too many for a line above
        place = {
            "loc": "upper left" if beside else "lower right",
            "ncols": -(-len(lines) // 4) if beside else len(lines),
        }
        top.legend(handles=lines, bbox_to_anchor=(1.0, 1.0), **place, **LEGEND)
    panels[-1].set_xlabel("time  $t$  (s)")
    panels[-1].tick_params(labelbottom=True)


def finish(axes: Any, time: np.ndarray, scaled: np.ndarray) -> None:
    """Set limits, ticks and grid; a constant is drawn as one, not magnified to its rounding."""
    from matplotlib.ticker import MaxNLocator

    axes.margins(x=0, y=0.08)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10], min_n_ticks=3))
    axes.ticklabel_format(axis="y", useOffset=False, style="plain")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
    axes.ticklabel_format(axis="x", useOffset=False)
    finite = scaled[np.isfinite(scaled)]
    if finite.size:
        low, high = float(finite.min()), float(finite.max())
        size = max(abs(low), abs(high))
        if high - low <= 1e-9 * size or size == 0:
            half = 0.1 * size or 1.0
            axes.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)
        elif low < 0 < high:
            axes.axhline(0.0, color=PALE_GREY, linewidth=0.7, zorder=1)
    if len(time) > 1:
        axes.set_xlim(time[0], time[-1])


def shade_unsolved(axes: Any, motion: Any) -> None:
    """Shade the time that no solved instant borders."""
    failed = np.flatnonzero(motion.status != 0)
    for run in np.split(failed, np.flatnonzero(np.diff(failed) > 1) + 1) if failed.size else ():
        begin, end = max(run[0] - 1, 0), min(run[-1] + 1, len(motion.time) - 1)
        axes.axvspan(motion.time[begin], motion.time[end], color="#EEEEEE", linewidth=0, zorder=0)


def check_figure(path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Raise OutputError unless a figure can be written to a path; meant to be asked before a long computation.

    Raises
    ------
    OutputError
        The ending is not .png, .svg or .pdf, the folder does not exist, or nothing may be written there.
    """
    check_target(path, SUFFIXES, "a figure", overwrite=overwrite)


def save(figure: Any, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write a figure to a .png, .svg or .pdf file.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    check_figure(path, overwrite=overwrite)
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(Path(fspath(path)).suffix.lower())
    with replacing(path, overwrite=overwrite) as beside, style():
        figure.savefig(beside, dpi=RESOLUTION, metadata=metadata)
