"""Outputs of a motion and their derivatives over time: stacked panels, position on top, one column for each output."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from jounce.errors import MechanismError, did_you_mean
from jounce.io.files import check_target, replacing
from jounce.io.peaks import COMPONENTS, rate_name
from jounce.plot.labels import scale_of, symbol, unit_label

__all__ = ["check_figure", "draw", "save"]

SUFFIXES = (".png", ".svg", ".pdf")
COLOURS = ("#0072B2", "#D55E00", "#009E73")  # of Okabe and Ito, told apart by the colour-blind
GREY = "#444444"
PANEL, SINGLE_PANEL = (3.5, 1.25), (4.8, 1.25)  # inches
RESOLUTION = 200  # dots per inch
LEGEND = {"borderaxespad": 0.1, "handlelength": 1.2, "handletextpad": 0.5, "columnspacing": 1.2}

STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 9.5,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.edgecolor": GREY,
    "axes.labelcolor": "black",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "lines.linewidth": 1.3,
    "lines.solid_joinstyle": "round",
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "agg.path.chunksize": 20000,
    "pdf.fonttype": 42,
    "svg.hashsalt": "jounce",
}


def draw(motion: Any, outputs: Sequence[str] | None = None) -> Any:
    r"""Draw outputs of a motion and their derivatives over time.

    Parameters
    ----------
    motion : Motion
        Instants that were not solved are left out and shaded.
    outputs : sequence of str, optional
        Names of the outputs, one column each; all unless given.

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
    import matplotlib as mpl
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    names = _chosen(motion, outputs)
    lost = [motion.mechanism.outputs[name].lost_orders for name in names]
    first = min(lost)
    rows = max(motion.order, max(lost)) + 1 - first
    with mpl.rc_context(STYLE):
        width, height = PANEL if len(names) > 1 else SINGLE_PANEL
        size = (width * len(names) + 0.3, height * rows + 0.9)
        layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.045, hspace=0.0, wspace=0.02)
        figure = Figure(figsize=size, dpi=RESOLUTION, layout=layout)
        panels = figure.subplots(rows, len(names), sharex=True, squeeze=False)
        for column, name in zip(panels.T, names, strict=True):
            _draw_column(motion, name, column, first)
        figure.align_ylabels()
        title = motion.mechanism.title.replace("$", r"\$")
        if title:
            figure.suptitle(title, fontsize=11, fontweight="bold")
    return figure


def _chosen(motion: Any, outputs: Sequence[str] | None) -> list[str]:
    valid = motion.outputs
    for name in outputs or ():
        if name not in valid:
            raise MechanismError(f"no output has this name; {did_you_mean(name, valid)}", name="outputs", value=name)
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
                color=COLOURS[c],
                marker="o" if len(motion.time) == 1 else None,
                markersize=3,
                label=symbol(name, component=COMPONENTS[c]) if vector else None,
            )
        _shade_unsolved(axes, motion)
        _finish(axes, motion.time, scaled)
        word = rate_name(output, order)
        word = f"{word} derivative" if row + first > 4 and not output.rate_names else word
        word = "angle" if row + first == 0 and output.unit == "rad" else word
        mark = "" if vector else symbol(name, order)
        axes.set_ylabel(f"{word}\n{mark}{'  ' if mark else ''}({unit_label(output.unit, order, exponent)})")
    top = panels[max(output.lost_orders - first, 0)]  # a force starts beside the acceleration
    top.set_title(name.replace("$", r"\$"), loc="left", pad=6)
    if vector:
        lines = panels[-1].get_lines()[: values.shape[2]]
        top.legend(handles=lines, ncols=len(lines), loc="lower right", bbox_to_anchor=(1.0, 1.0), **LEGEND)
    panels[-1].set_xlabel("time  $t$  (s)")


def _finish(axes: Any, time: np.ndarray, scaled: np.ndarray) -> None:
    """Set limits, ticks and grid; a constant is drawn as one, not magnified to its rounding."""
    from matplotlib.ticker import MaxNLocator

    axes.grid(visible=True)
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
            axes.axhline(0.0, color="#999999", linewidth=0.7, zorder=1)
    if len(time) > 1:
        axes.set_xlim(time[0], time[-1])


def _shade_unsolved(axes: Any, motion: Any) -> None:
    """Shade the time that no solved instant borders."""
    failed = np.flatnonzero(motion.status != 0)
    for run in np.split(failed, np.flatnonzero(np.diff(failed) > 1) + 1) if failed.size else ():
        begin, end = max(run[0] - 1, 0), min(run[-1] + 1, len(motion.time) - 1)
        axes.axvspan(motion.time[begin], motion.time[end], color="#EEEEEE", linewidth=0, zorder=0)


def check_figure(path: str | PathLike[str]) -> None:
    """Raise OutputError unless a figure can be written to a path; meant to be asked before a long computation.

    Raises
    ------
    OutputError
        The ending is not .png, .svg or .pdf, the folder does not exist, or nothing may be written there.
    """
    check_target(path, SUFFIXES, "a figure")


def save(figure: Any, path: str | PathLike[str]) -> None:
    """Write a figure to a .png, .svg or .pdf file.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    import matplotlib as mpl

    check_figure(path)
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(Path(fspath(path)).suffix.lower())
    with replacing(path) as beside, mpl.rc_context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # names in other scripts get boxes
        figure.savefig(beside, dpi=RESOLUTION, metadata=metadata)
