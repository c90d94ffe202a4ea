"""Figures 2-7 and 10-13 of Sommer 2024, and a figure for its section 7, drawn from measured results.

This module imports matplotlib; import it only for drawing figures. Figures are objects of their own with the Agg
canvas; the state of `matplotlib.pyplot` stays as it is.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from jounce.papers.figures import legend_below, panels
from jounce.papers.sommer_2024 import cases, drawings
from jounce.papers.sommer_2024.comparison import STANDS_IN
from jounce.papers.sommer_2024.measurement import Results
from jounce.plot.style import BLUE, GRAY, GREEN, PURPLE, VERMILION

LINE_STYLES = {
    "velocity": {"color": BLUE, "marker": "o", "linestyle": "-"},
    "acceleration": {"color": VERMILION, "marker": "s", "linestyle": "--"},
    "jerk": {"color": GREEN, "marker": "^", "linestyle": "-."},
    "jounce": {"color": PURPLE, "marker": "D", "linestyle": ":"},
}
LINE_STYLES |= {
    "simulation": LINE_STYLES["velocity"],
    "second order": LINE_STYLES["acceleration"],
    "fourth order": LINE_STYLES["jerk"],
}
METHODS = {
    "second order": "central differences of acceleration, order 2",
    "fourth order": "central differences of acceleration, order 4",
    "simulation": "jounce",
}
RATE_UNITS = {"jerk": r"rad/s$^3$", "jounce": r"rad/s$^4$"}


def _note(names: Sequence[str]) -> str:
    """Return the note on stand-in data in a figure."""
    chosen = sorted({STANDS_IN[name] for name in names} - {""})
    return f"stand-in data: {', '.join(chosen)} chosen, lengths as printed" if chosen else ""


def time_history(results: Mapping[str, Results], *, name: str, quantity: str, number: int) -> Figure:
    """Draw a derivative of the output over one cycle, and below it the error of its simulation (figures 2 and 3)."""
    cycle, unit = results[name].cycle, RATE_UNITS[quantity]
    derivative = 1 + cases.QUANTITIES.index(quantity)
    computed, expected = cycle.simulated[:, derivative], cycle.explicit[:, derivative]
    title = f"{cases.VALIDATION_CASES[name].title}: {quantity} of the output angle (figure {number} of Sommer 2024)"
    figure, axes = panels(2, 1, (6.0, 4.8), title, sharex=True)
    upper, lower = axes[:, 0]
    upper.plot(cycle.time, computed, color=BLUE)
    upper.set_ylabel(f"{quantity} / ({unit})")
    lower.plot(cycle.time, computed - expected, color=VERMILION, linewidth=0.9)
    index = derivative - 1
    lower.set_ylabel(f"error / ({unit})")
    lower.set_title(
        f"simulation minus explicit solution, RMSE {cycle.rmse[index]:.2g} {unit}"
        f" ({cycle.normalized_rmse[index]:.1g} of the largest value)",
    )
    lower.set_xlabel("time / s")
    lower.set_xlim(cycle.time[0], cycle.time[-1])
    figure.align_ylabels()
    return figure


TOLERANCE_OF = {
    "correction": "assembly tolerance (rad, or mechanism sizes)",
    "residual": "assembly tolerance (largest residual, in cm)",
}


def tolerance_sweep(results: Mapping[str, Results], *, names: Sequence[str], number: int) -> Figure:
    """Draw the errors against the assembly tolerance, one panel per simulation (figures 4, 6, 10 and 12)."""
    title = f"Error against assembly tolerance (figure {number} of Sommer 2024)"
    width = 1.0 + 3.6 * len(names) + (0.8 if len(names) == 1 else 0)
    figure, axes = panels(1, len(names), (width, 3.9), title, _note(names), sharex=True, sharey=True)
    for panel, name in zip(axes[0], names, strict=True):
        for k, quantity in enumerate(cases.QUANTITIES):
            panel.loglog(cases.TOLERANCES, results[name].by_tolerance[:, k], label=quantity, **LINE_STYLES[quantity])
        panel.loglog(
            cases.TOLERANCES, cases.TOLERANCES, color=GRAY, linewidth=0.8, zorder=1, label="the tolerance itself"
        )
        panel.set_title(cases.VALIDATION_CASES[name].title)
        panel.set_xlabel(TOLERANCE_OF[results[name].stop])
        _decades(panel.xaxis, 2)
        _decades(panel.yaxis, 2)
    axes[0, 0].set_ylabel("normalized RMSE")
    axes[0, 0].legend(loc="upper left")
    return figure


def step_sweep(results: Mapping[str, Results], *, names: Sequence[str], number: int) -> Figure:
    """Draw the errors of jerk (top) and jounce (bottom) against the time step (figures 5, 7, 11 and 13)."""
    title = f"Error against time step (figure {number} of Sommer 2024)"
    width = 1.0 + 3.6 * len(names) + (1.4 if len(names) == 1 else 0)
    figure, axes = panels(2, len(names), (width, 6.2), title, sharex=True, sharey=True)
    for column, name in enumerate(names):
        for row, quantity in enumerate(("jerk", "jounce")):
            panel: Axes = axes[row, column]
            for method, label in METHODS.items():
                panel.loglog(cases.STEPS, results[name].by_step[method][:, row], label=label, **LINE_STYLES[method])
            panel.set_title(f"{cases.VALIDATION_CASES[name].title}: {quantity}")
            _decades(panel.yaxis, 2)
    for panel in axes[-1]:
        panel.set_xlabel("time step h / s")
    for panel in axes[:, 0]:
        panel.set_ylabel("normalized RMSE")
    legend_below(figure, axes[0, 0], min(len(names) + 1, 3), _note(names))
    return figure


def phase_lag(results: Mapping[str, Results], *, name: str, step: float) -> Figure:
    """Draw jerk and jounce by backward differences beside the simulation and the explicit solution (section 7)."""
    title = (
        f"{cases.VALIDATION_CASES[name].title}: lag of backward differences, h = {step:g} s (section 7 of Sommer 2024)"
    )
    figure, axes = panels(2, 1, (6.0, 5.0), title, sharex=True)
    chosen = [lag for lag in results[name].lags if lag.step == step]
    for panel, lag in zip(axes[:, 0], chosen, strict=True):
        panel.plot(lag.time, lag.explicit, color=GRAY, linewidth=1.0, label="explicit solution")
        panel.plot(lag.time, lag.simulated, **LINE_STYLES["simulation"] | {"linestyle": ""}, label="jounce")
        panel.plot(
            lag.time, lag.difference, **LINE_STYLES["second order"], label="backward differences of acceleration"
        )
        panel.set_ylabel(f"{lag.quantity} / ({RATE_UNITS[lag.quantity]})")
        panel.set_title(
            f"{lag.quantity}: late by {1e3 * lag.late(lag.difference):.4g} ms,"
            f" in closed form {1e3 * lag.expected:.4g} ms; RMSE {100 * lag.measured_error(lag.difference):.2g} %"
        )
    axes[-1, 0].set_xlabel("time / s")
    axes[-1, 0].set_xlim(0.0, chosen[0].time[-1])
    legend_below(figure, axes[0, 0], 3)
    figure.align_ylabels()
    return figure


def _decades(axis: Any, interval: int) -> None:
    """Mark every few decades, without minor ticks."""
    axis.set_major_locator(LogLocator(base=10.0**interval, numticks=20))
    axis.set_minor_locator(LogLocator(base=10.0, numticks=40))
    axis.set_minor_formatter(NullFormatter())


FIGURES: dict[str, Any] = dict(drawings.FIGURES)  # by the names of their files
for _number, _quantity in cases.HISTORIES.items():
    FIGURES[f"figure_{_number:02d}"] = partial(time_history, name="four_bar", quantity=_quantity, number=_number)
for _draw, _sweeps in ((tolerance_sweep, cases.TOLERANCE_SWEEPS), (step_sweep, cases.STEP_SWEEPS)):
    FIGURES |= {f"figure_{number:02d}": partial(_draw, names=names, number=number) for number, names in _sweeps.items()}
FIGURES = dict(sorted(FIGURES.items())) | {"phase_lag": partial(phase_lag, name="four_bar", step=0.05)}
