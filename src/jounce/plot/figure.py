"""Outputs of a motion and their derivatives over time: stacked panels, position on top, a column for each output."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.dynamics.motion_values import check_motion
from jounce.errors import MechanismError, check_name
from jounce.io.files.writing import check_target, replacing
from jounce.kinematics import Motion
from jounce.mechanism.outputs.base import AbstractQuantity
from jounce.plot.instants import unsolved_runs
from jounce.plot.labels import axis_range, quantity_word, scale_of, symbol, unit_label
from jounce.plot.style import COLORS, PALE_GRAY, RESOLUTION, blank_figure, set_ticks, shown_name, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Column = tuple[AbstractQuantity, Float[np.ndarray, "time derivative *component"]]
"""An output with its values."""


SUFFIXES = (".png", ".svg", ".pdf")
COLUMNS = 5  # largest number of columns
COST_OF_ROW = 0.03  # relative to the fraction of empty places
PANEL, SINGLE_PANEL = (3.5, 1.25), (4.8, 1.25)  # inches
LEGEND = {"borderaxespad": 0.1, "handlelength": 1.2, "handletextpad": 0.5, "columnspacing": 1.2}
STROKES = ("-", "--", ":")  # for more components than colors


def draw(motion: Motion, outputs: str | Sequence[str] | None = None) -> Figure:
    r"""Draw outputs of a motion and their derivatives over time.

    Parameters
    ----------
    motion : Motion
        The motion; unsolved instants are omitted and shaded.
    outputs : str or sequence of str, optional
        Names of the outputs; all by default.

    Returns
    -------
    matplotlib.figure.Figure
        Each output has a column of panels: position, velocity, ... to the order of the motion. Forces, which have two
        derivatives fewer, share columns if that leaves fewer places empty.

    Raises
    ------
    MechanismError
        If a name does not exist, or the mechanism has no outputs.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw
    >>> figure = draw(jn.solve(jn.load("examples/four_bar.yaml"), order=2), ["psi"])
    >>> [axes.get_ylabel() for axes in figure.axes][2]
    'acceleration\n$\\ddot{\\psi}$  (rad/s$^2$)'
    """
    check_motion(motion)
    chosen = (outputs,) if isinstance(outputs, str) else outputs or ()
    for name in chosen:
        check_name("output", name, motion.outputs, MechanismError, name="outputs")
    names = dict.fromkeys(chosen or motion.outputs)
    if not names:
        raise MechanismError("there is nothing to draw; name some outputs", name="outputs")
    return draw_columns(motion, {name: (motion.mechanism.outputs[name], motion.outputs[name]) for name in names})


def draw_columns(motion: Motion, columns: Mapping[str, Column]) -> Figure:
    """Draw outputs of a motion, each as a column of its derivatives, arranged to leave few places empty."""
    rows = {name: motion.order + 1 - output.lost_orders for name, (output, _) in columns.items()}
    heights = {name: max(count, 1) for name, count in rows.items()}
    columns_and_rows = stacked(heights)
    wide = 1 + max(column for column, _ in columns_and_rows.values())
    tall = max(columns_and_rows[name][1] + heights[name] for name in columns)
    with style():
        width, height = PANEL if len(columns) > 1 else SINGLE_PANEL
        levels = len({row for _, row in columns_and_rows.values()})
        figure = blank_figure(width * wide + 0.3, height * tall + 0.9 + 0.45 * (levels - 1), motion.mechanism.title)
        grid = figure.subplots(tall, wide, sharex=True, squeeze=False)
        for axes in grid.flat:
            axes.set_axis_off()
        for name, (column, row) in columns_and_rows.items():
            panels = grid[row : row + heights[name], column]
            for axes in panels:
                axes.set_axis_on()
            _draw_column(motion, name, columns[name], panels)
        figure.align_ylabels()
    return figure


def stacked(heights: Mapping[str, int]) -> dict[str, tuple[int, int]]:
    """Return the column and first row of outputs with given numbers of rows, for a full figure of moderate height.

    Outputs are placed by decreasing height, each in the column that is shortest so far.

    Examples
    --------
    >>> stacked({"psi": 4, "force": 2, "yank": 2})
    {'psi': (0, 0), 'force': (1, 0), 'yank': (1, 2)}
    """
    ordered, total, arrangements = sorted(heights, key=lambda name: -heights[name]), sum(heights.values()), []
    for count in range(1, min(COLUMNS, len(heights)) + 1):
        filled, arrangement = [0] * count, {}
        for name in ordered:
            column = filled.index(min(filled))
            arrangement[name] = (column, filled[column])
            filled[column] += heights[name]
        empty = (count * max(filled) - total) / total
        arrangements.append((empty + COST_OF_ROW * max(filled), arrangement))
    return min(arrangements, key=lambda each: each[0])[1]


def _draw_column(motion: Motion, name: str, column: Column, panels: Any) -> None:
    """Draw the derivatives of an output, one panel each, with all components in the same panel."""
    output, values = column
    unit, factor = motion.mechanism.shown_units.of(output.unit, name)
    values = (values[:, :, None] if values.ndim == 2 else values) * factor
    vector = values.shape[2] > 1
    for order, axes in enumerate(panels[: values.shape[1]]):
        exponent = scale_of(values[:, order])
        scaled = values[:, order] * 10.0**-exponent
        for c in range(values.shape[2]):
            axes.plot(
                motion.time,
                scaled[:, c],
                color=COLORS[c % len(COLORS)],
                linestyle=STROKES[c // len(COLORS)],
                marker="o" if len(motion.time) == 1 else None,
                markersize=3,
                label=symbol(name, component=output.labels[c]) if vector else None,
            )
        finish(axes, motion, scaled)
        word = quantity_word(output, order)
        word = f"{word} derivative" if order + output.lost_orders > 4 and not output.rate_names else word
        mark = "" if vector else symbol(name, order)
        axes.set_ylabel(f"{word}\n{mark}{'  ' if mark else ''}({unit_label(unit, order, exponent)})")
    top = panels[0]
    top.set_title(shown_name(name), loc="left", pad=6)
    if vector:
        lines = panels[-1].get_lines()[: values.shape[2]]
        at_side = len(lines) > len(COLORS)  # too many for a legend above
        count = -(-len(lines) // 4) if at_side else len(lines)
        legend_position = {"loc": "upper left" if at_side else "lower right", "ncols": count}
        top.legend(handles=lines, bbox_to_anchor=(1.0, 1.0), **legend_position, **LEGEND)
    panels[-1].set_xlabel("time  $t$  (s)")
    panels[-1].tick_params(labelbottom=True)


def finish(axes: Any, motion: Motion, scaled: Float[np.ndarray, "time *lines"]) -> None:
    """Set limits, ticks and grid, and shade the intervals of unsolved instants."""
    set_ticks(axes.yaxis, 4, least=3)
    axes.ticklabel_format(axis="y", useOffset=False, style="plain")
    set_ticks(axes.xaxis, 6)
    axes.ticklabel_format(axis="x", useOffset=False)
    low, high = axis_range(scaled, 0.08)
    axes.set_ylim(low, high)
    if np.nanmin(scaled, initial=0.0) < 0 < np.nanmax(scaled, initial=0.0):
        axes.axhline(0.0, color=PALE_GRAY, linewidth=0.7, zorder=1)
    time = motion.time
    if len(time) > 1:
        axes.set_xlim(time[0], time[-1])
    for run in unsolved_runs(motion):
        start, end = max(run[0] - 1, 0), min(run[-1] + 1, len(time) - 1)
        axes.axvspan(time[start], time[end], color="#EEEEEE", linewidth=0, zorder=0)


def check_figure(path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Raise OutputError unless a figure can be written to a path; to be called before a long computation.

    Raises
    ------
    OutputError
        If the suffix is not .png, .svg or .pdf, the folder does not exist, or it is not writable.
    """
    check_target(path, SUFFIXES, "a figure", overwrite=overwrite)


def save(figure: Any, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write a figure to a .png, .svg or .pdf file.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    check_figure(path, overwrite=overwrite)
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(Path(fspath(path)).suffix.lower())
    with replacing(path, overwrite=overwrite) as temporary, style():
        figure.savefig(temporary, dpi=RESOLUTION, metadata=metadata)
