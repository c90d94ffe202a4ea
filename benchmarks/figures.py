"""Figures of the table: cost against order and bodies, time against error, what jerk is worth."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jounce.io.files.writing import replacing
from jounce.plot.style import GRAY, LINE_COLORS, RESOLUTION, blank_figure, style

Rows = Sequence[Mapping[str, Any]]
Lines = dict[str, list[tuple[float, float]]]
MARKERS = "osDv^Pp"


def draw(rows: Rows, folder: Path) -> None:
    """Write every figure that the rows have points for, as PNG and SVG; others stay as they are."""
    for name, make in FIGURES.items():
        figure = make([row for row in rows if row["at"] and not row["left out"]])
        if figure is not None:
            for suffix in ("png", "svg"):
                with replacing(folder / f"{name}.{suffix}") as scratch:
                    figure.savefig(scratch, dpi=RESOLUTION)


def _lines(rows: Rows, benchmark: str, key: str, value: Callable[[Any], float], title: str = "") -> Lines:
    """Return the points of each contestant, in order, whose case begins with a title."""
    found: Lines = {}
    for row in rows:
        if row["benchmark"] == benchmark and row["case"].startswith(title):
            found.setdefault(row["contestant"], []).append((row["at"][key], value(row)))
    return {name: sorted(points) for name, points in found.items()}


def _plot(axes: Any, lines: Lines, scale: str, *, ticks: bool = True) -> None:
    """Draw lines against a logarithmic axis; ticks of the other are where the points are, or as the scale has them."""
    from matplotlib.ticker import LogFormatter, NullLocator

    for (name, points), marker, color in zip(lines.items(), MARKERS, LINE_COLORS, strict=False):
        axes.plot(*zip(*points, strict=True), marker=marker, color=color, label=name)
    axes.set_xscale(scale)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(LogFormatter())
    axes.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1, 0.4)))
    if ticks:
        places = sorted({x for points in lines.values() for x, _ in points})
        axes.set_xticks(places, [f"{x:.4g}" for x in places])
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        axes.xaxis.set_major_formatter(LogFormatter())


def _cost(unit: float) -> Callable[[Any], float]:
    return lambda row: row["cost"][1] / unit


def orders(rows: Rows) -> Any:
    """Return the cost of the first call and of an instant against the highest derivative."""
    panels = {
        "four-bar, first call  (s)": (1.0, "four-bar", True),
        "four-bar, an instant  (us)": (1e-6, "four-bar", False),
        "RSUR, an instant  (us)": (1e-6, "RSUR", False),
    }
    drawn = {}
    for label, (unit, title, first) in panels.items():
        chosen = [row for row in rows if row["case"].endswith("first call") == first]
        drawn[label] = _lines(chosen, "orders", "order", _cost(unit), title)
    if not all(drawn.values()):
        return None
    with style():
        figure = blank_figure(9.0, 3.8)
        for axes, (label, lines) in zip(figure.subplots(1, len(drawn)), drawn.items(), strict=True):
            _plot(axes, lines, "linear")
            axes.set_xlabel("highest derivative")
            axes.set_title(label)
        figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        return figure


def bodies(rows: Rows) -> Any:
    """Return the cost of an instant of a chain, and of a simulation, against the number of bodies."""
    drawn = {
        "Chain of four-bars, an instant  (us)": _lines(rows, "bodies", "bodies", _cost(1e-6)),
        "Chain of pendulums, simulated  (ms)": _lines(rows, "pendulums", "bodies", _cost(1e-3)),
    }
    drawn = {label: lines for label, lines in drawn.items() if lines}
    if not drawn:
        return None
    with style():
        figure = blank_figure(4.5 * len(drawn), 4.2)
        for axes, (label, lines) in zip(figure.subplots(1, len(drawn), squeeze=False)[0], drawn.items(), strict=True):
            _plot(axes, lines, "log")
            axes.set_xlabel("bodies")
            axes.set_title(label)
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15))
        return figure


def work_precision(rows: Rows) -> Any:
    """Return error against time of the double pendulum."""
    times = _lines(rows, "pendulum", "tolerance", _cost(1e-3))
    errors = _lines(rows, "pendulum", "tolerance", lambda row: row["error"])
    if not times:
        return None
    with style():
        figure = blank_figure(7.5, 3.8)
        axes = figure.subplots()
        _plot(
            axes,
            {name: [(t, e) for (_, t), (_, e) in zip(times[name], errors[name], strict=True)] for name in times},
            "log",
            ticks=False,
        )
        axes.set_title("Double pendulum from horizontal rest")
        axes.set_xlabel("time for 10 s of motion, one core  (ms)")
        axes.set_ylabel("error of the angles at 10 s  (rad)")
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
        return figure


def obreshkov(rows: Rows) -> Any:
    """Return errors, and how many times smaller they are with jerk, against the step."""
    found = {
        title: _lines(rows, "jerk", "step", lambda row: row["error"], title) for title in ("four-bar", "slider-crank")
    }
    if not all(found.values()):
        return None
    with style():
        figure = blank_figure(8.0, 6.0)
        panels = figure.subplots(2, 2, sharex=True, sharey="row")
        for (above, below), (title, lines) in zip(panels.T, found.items(), strict=True):
            lines = {name: [(1e3 * step, error) for step, error in points] for name, points in lines.items()}
            jerk = next(iter(lines.values()))
            _plot(above, lines, "log")
            _plot(below, {name: _over(points, jerk) for name, points in lines.items()}, "log")
            below.lines[0].set_visible(False)  # ones
            above.set_title(f"Free {title} under gravity")
            below.axhline(10, color=GRAY, linewidth=0.8, linestyle="--")
            below.text(jerk[0][0], 10, "ten, as claimed", color=GRAY, va="bottom")
            below.set_xlabel("step  (ms)")
        panels[0, 0].set_ylabel("largest error of an angle in 1 s  (rad)")
        panels[1, 0].set_ylabel("times the error with jerk")
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        return figure


def _over(points: list[tuple[float, float]], base: list[tuple[float, float]]) -> list[tuple[float, float]]:
    below = dict(base)  # a contestant may have been left out at some step
    return [(x, y / below[x]) for x, y in points if x in below]


FIGURES: dict[str, Callable[[Rows], Any]] = {
    "orders": orders,
    "bodies": bodies,
    "work_precision": work_precision,
    "obreshkov": obreshkov,
}
