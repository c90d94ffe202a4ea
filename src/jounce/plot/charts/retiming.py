"""Active limits of a retimed trajectory over time: a bar for each limit, and the rate along the path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from jounce.jet import Jet
from jounce.plot.style import GRAY, LINE_COLORS, blank_figure, set_ticks, shown_name, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jounce.planning import RetimedTrajectory

WIDTH, BAR, RATE = 7.0, 0.24, 1.7  # inches
MOST = 24  # bars, those of the highest prices


def draw_retiming(retimed: RetimedTrajectory, title: str = "") -> Figure:
    """Draw the active limits of a trajectory over time, with their prices, above the rate along its path.

    Parameters
    ----------
    retimed : RetimedTrajectory
        Result of `retime`.
    title : str, optional
        Title of the figure, by default the name of the robot.

    Returns
    -------
    matplotlib.figure.Figure
        One row for each limit, with bars where it binds, and on the right the decrease of the duration, ms, if the
        limit were one percent higher.

        If no limit binds, as for a motion with a longer duration, the rate only.
    """
    active = retimed.active
    binds, price = active["binds"].values, active["price"].values.sum(axis=0)
    bound = np.flatnonzero(binds.any(axis=0))
    if not bound.size:
        return _rate_figure(retimed, title or retimed.report.robot)
    chosen = sorted(bound[np.argsort(-price[bound])][:MOST].tolist())
    names = [str(x) for x in active["limit"].values]
    quantities = list(dict.fromkeys(_quantity(name) for name in names))
    times = active["time"].values * retimed.stop / active["time"].values[-1]
    edges = np.concatenate([times[:1], (times[1:] + times[:-1]) / 2, times[-1:]])
    with style():
        figure = blank_figure(WIDTH, RATE + BAR * len(chosen) + 1.0, title or retimed.report.robot, h_pad=0.06)
        rate, bars = figure.subplots(2, 1, sharex=True, height_ratios=[RATE, BAR * len(chosen) + 0.3])
        _draw_rate(retimed, rate)
        for row, k in enumerate(chosen):
            color = LINE_COLORS[quantities.index(_quantity(names[k])) % len(LINE_COLORS)]
            for first, last in _runs(binds[:, k]):
                duration = max(edges[last + 1] - edges[first], 0.002 * retimed.stop)
                bars.broken_barh([(edges[first], duration)], (row - 0.36, 0.72), facecolors=color)
            price_text = f"{10 * price[k]:.2g} ms" if price[k] > 0 else "0"
            bars.text(1.01, row, price_text, transform=bars.get_yaxis_transform(), va="center", fontsize=7, color=GRAY)
        bars.set_yticks(range(len(chosen)), [shown_name(names[k]) for k in chosen], fontsize=7)
        bars.set_ylim(len(chosen) - 0.4, -0.6)
        bars.set_xlabel("time  $t$  (s)")
        bars.set_title("limits that bind; right: saved if 1 % higher", loc="left", fontsize=7.5, color=GRAY, pad=4)
        set_ticks(bars.xaxis, 6)
        bars.set_xlim(0, retimed.stop)
    return figure


def _rate_figure(retimed: RetimedTrajectory, title: str) -> Figure:
    with style():
        figure = blank_figure(WIDTH, RATE + 1.0, title, h_pad=0.06)
        axes = figure.subplots(1, 1)
        _draw_rate(retimed, axes)
        axes.set_xlabel("time  $t$  (s)")
        axes.set_title("no limit binds", loc="left", fontsize=7.5, color=GRAY, pad=4)
        axes.set_xlim(0, retimed.stop)
    return figure


def _draw_rate(retimed: RetimedTrajectory, axes: Any) -> None:
    times = np.linspace(0.0, retimed.stop, 1001)
    s = np.asarray(retimed.progress(Jet.variable(jnp.asarray(times), 1)).derivatives())
    length = retimed.path.stop - retimed.path.start
    axes.plot(times, s[1] / length, color=LINE_COLORS[0])
    axes.set_ylabel("rate along the path\n(1/s)")
    axes.set_ylim(0, None)
    set_ticks(axes.yaxis, 4, least=3)


def _quantity(name: str) -> str:
    """Return the quantity in the name of a limit, after the name of its joint."""
    return name.partition(" ")[2]


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and the last index of each run of true values."""
    steps = np.diff(np.concatenate([[0], flags.astype(int), [0]]))
    return list(zip(np.flatnonzero(steps == 1).tolist(), (np.flatnonzero(steps == -1) - 1).tolist(), strict=True))
