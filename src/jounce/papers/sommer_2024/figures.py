"""Figures 2-7 and 10-13 of Sommer 2024, drawn from measured results.

This module imports matplotlib, and is imported only when figures are drawn. Figures are objects of their own with the
Agg canvas; the state of `matplotlib.pyplot` is not touched.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from jounce.papers.sommer_2024.simulations import QUANTITIES, SIMULATIONS, STEPS, TOLERANCES, Results
from jounce.plot.style import BLUE, GREEN, GREY, PURPLE, VERMILION, blank_figure, style as style

LOOKS = {
    "velocity": {"color": BLUE, "marker": "o", "linestyle": "-"},
    "acceleration": {"color": VERMILION, "marker": "s", "linestyle": "--"},
    "jerk": {"color": GREEN, "marker": "^", "linestyle": "-."},
    "jounce": {"color": PURPLE, "marker": "D", "linestyle": ":"},
    "second order": {"color": VERMILION, "marker": "s", "linestyle": "--"},
    "fourth order": {"color": GREEN, "marker": "^", "linestyle": "-."},
    "simulation": {"color": BLUE, "marker": "o", "linestyle": "-"},
}
METHODS = {
    "second order": "central differences of acceleration, order 2",
    "fourth order": "central differences of acceleration, order 4",
    "simulation": "jounce",
}
RATE_UNITS = {"jerk": r"rad/s$^3$", "jounce": r"rad/s$^4$"}


def _figure(rows: int, columns: int, size: tuple[float, float], title: str, **shared: Any) -> tuple[Figure, np.ndarray]:
    figure = blank_figure(*size, title)
    return figure, figure.subplots(rows, columns, squeeze=False, **shared)


def time_history(results: Mapping[str, Results], *, name: str, quantity: str, number: int) -> Figure:
    """Draw a derivative of the output over one cycle, and below it the error of its simulation (figures 2 and 3)."""
    cycle, unit = results[name].cycle, RATE_UNITS[quantity]
    derivative = 1 + QUANTITIES.index(quantity)
    found, right = cycle.simulated[:, derivative], cycle.explicit[:, derivative]
    title = f"{SIMULATIONS[name].title}: {quantity} of the output angle (figure {number} of Sommer 2024)"
    figure, axes = _figure(2, 1, (6.0, 4.8), title, sharex=True)
    above, below = axes[:, 0]
    above.plot(cycle.time, found, color=BLUE)
    above.set_ylabel(f"{quantity} / ({unit})")
    below.plot(cycle.time, found - right, color=VERMILION, linewidth=0.9)
    index = derivative - 1
    below.set_ylabel(f"error / ({unit})")
    below.set_title(
        f"simulation minus explicit solution, RMSE {cycle.rmse[index]:.2g} {unit}"
        f" ({cycle.normalised_rmse[index]:.1g} of the largest value)",
    )
    below.set_xlabel("time / s")
    below.set_xlim(cycle.time[0], cycle.time[-1])
    figure.align_ylabels()
    return figure


def tolerance_sweep(results: Mapping[str, Results], *, names: Sequence[str], number: int) -> Figure:
    """Draw the errors against the assembly tolerance, one panel per simulation (figures 4, 6, 10 and 12)."""
    title = f"Error against assembly tolerance (figure {number} of Sommer 2024)"
    wide = 1.0 + 3.6 * len(names) + (0.8 if len(names) == 1 else 0)
    figure, axes = _figure(1, len(names), (wide, 3.9), title, sharex=True, sharey=True)
    for panel, name in zip(axes[0], names, strict=True):
        for k, quantity in enumerate(QUANTITIES):
            panel.loglog(TOLERANCES, results[name].by_tolerance[:, k], label=quantity, **LOOKS[quantity])
        panel.loglog(TOLERANCES, TOLERANCES, color=GREY, linewidth=0.8, zorder=1, label="the tolerance itself")
        panel.set_title(SIMULATIONS[name].title)
        panel.set_xlabel("assembly tolerance (rad, or mechanism sizes)")
        _decades(panel.xaxis, 2)
        _decades(panel.yaxis, 2)
    axes[0, 0].set_ylabel("normalised RMSE")
    axes[0, 0].legend(loc="upper left")
    return figure


def step_sweep(results: Mapping[str, Results], *, names: Sequence[str], number: int) -> Figure:
    """Draw the errors of jerk (top) and jounce (bottom) against the time step (figures 5, 7, 11 and 13)."""
    title = f"Error against time step (figure {number} of Sommer 2024)"
    wide = 1.0 + 3.6 * len(names) + (1.4 if len(names) == 1 else 0)
    figure, axes = _figure(2, len(names), (wide, 6.2), title, sharex=True, sharey=True)
    for column, name in enumerate(names):
        for row, quantity in enumerate(("jerk", "jounce")):
            panel: Axes = axes[row, column]
            for method, label in METHODS.items():
                panel.loglog(STEPS, results[name].by_step[method][:, row], label=label, **LOOKS[method])
            panel.set_title(f"{SIMULATIONS[name].title}: {quantity}")
            _decades(panel.yaxis, 2)
    for panel in axes[-1]:
        panel.set_xlabel("time step h / s")
    for panel in axes[:, 0]:
        panel.set_ylabel("normalised RMSE")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=min(len(names) + 1, 3))
    return figure


def _decades(axis: Any, every: int) -> None:
    """Mark every few decades, without marks between them."""
    axis.set_major_locator(LogLocator(base=10.0**every, numticks=20))
    axis.set_minor_locator(LogLocator(base=10.0, numticks=40))
    axis.set_minor_formatter(NullFormatter())


_CRANKS = ("inverted_slider_crank_slide", "inverted_slider_crank_distance")
FIGURES = {
    2: partial(time_history, name="four_bar", quantity="jerk", number=2),
    3: partial(time_history, name="four_bar", quantity="jounce", number=3),
    4: partial(tolerance_sweep, names=("four_bar",), number=4),
    5: partial(step_sweep, names=("four_bar",), number=5),
    6: partial(tolerance_sweep, names=_CRANKS, number=6),
    7: partial(step_sweep, names=_CRANKS, number=7),
    10: partial(tolerance_sweep, names=("rsur", "rssr"), number=10),
    11: partial(step_sweep, names=("rsur", "rssr"), number=11),
    12: partial(tolerance_sweep, names=("rspu_distance", "rspu_slide"), number=12),
    13: partial(step_sweep, names=("rspu_distance", "rspu_slide"), number=13),
}
