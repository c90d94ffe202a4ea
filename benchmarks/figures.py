"""Figures of the table: cost against order and bodies, time against error, what jerk is worth."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jounce.plot.style import GREY, LINE_COLOURS, RESOLUTION, blank_figure, style

Rows = Sequence[Mapping[str, Any]]
Lines = dict[str, list[tuple[float, float]]]
MARKERS = "osDv^Pp"


def draw(rows: Rows, folder: Path) -> None:
    """Write every figure that the rows have points for, as PNG and SVG."""
    for name, make in FIGURES.items():
        figure = make([row for row in rows if row["at"] and not row["left out"]])
        if figure is not None:
            for suffix in ("png", "svg"):
                figure.savefig(folder / f"{name}.{suffix}", dpi=RESOLUTION)


def _lines(rows: Rows, benchmark: str, key: str, value: Callable[[Any], float], title: str = "") -> Lines:
    """Return the points of each contestant, in order, whose case begins with a title."""
    found: Lines = {}
    for row in rows:
        if row["benchmark"] == benchmark and row["case"].startswith(title):
            found.setdefault(row["contestant"], []).append((row["at"][key], value(row)))
    return {name: sorted(points) for name, points in found.items()}


def _plot(axes: Any, lines: Lines, scale: str) -> None:
    for (name, points), marker, colour in zip(lines.items(), MARKERS, LINE_COLOURS, strict=False):
        axes.plot(*zip(*points, strict=True), marker=marker, color=colour, label=name)
    axes.set_xscale(scale)
    axes.set_yscale("log")


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
        figure = blank_figure(9.0, 3.4)
        for axes, (label, lines) in zip(figure.subplots(1, len(drawn)), drawn.items(), strict=True):
            _plot(axes, lines, "linear")
            axes.set_xlabel("highest derivative")
            axes.set_title(label)
        figure.axes[0].legend()
        return figure


def bodies(rows: Rows) -> Any:
    """Return the cost of an instant of a chain, and of a simulated second, against the number of bodies."""
    chains, pendulums = (
        _lines(rows, name, "bodies", _cost(unit)) for name, unit in (("bodies", 1e-6), ("pendulums", 1e-3))
    )
    if not chains and not pendulums:
        return None
    with style():
        figure = blank_figure(8.0, 3.6)
        left, right = figure.subplots(1, 2)
        for axes, lines, label in (
            (left, chains, "four-bars, an instant  (us)"),
            (right, pendulums, "pendulums, simulated  (ms)"),
        ):
            _plot(axes, lines, "log")
            axes.set_xlabel("bodies")
            axes.set_title(f"Chain of {label}")
            if lines:
                axes.legend()
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
            below.lines[0].set_visible(False)
            above.set_title(f"Free {title} under gravity")
            below.axhline(10, color=GREY, linewidth=0.8, linestyle="--")
            below.text(jerk[0][0], 10, "ten, as claimed", color=GREY, va="bottom")
            below.set_xlabel("step  (ms)")
            below.set_xticks([step for step, _ in jerk], [f"{step:.3g}" for step, _ in jerk])
            below.minorticks_off()
        panels[0, 0].set_ylabel("largest error of an angle in 1 s  (rad)")
        panels[1, 0].set_ylabel("times the error with jerk")
        panels[0, 0].legend()
        return figure


def _over(points: list[tuple[float, float]], base: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(x, y / z) for (x, y), (_, z) in zip(points, base, strict=True)]


FIGURES: dict[str, Callable[[Rows], Any]] = {
    "orders": orders,
    "bodies": bodies,
    "work_precision": work_precision,
    "obreshkov": obreshkov,
}
