"""Figures 4, 5 and 7-9 of the paper, and one of the acceleration energies, drawn from computed histories.

This module imports matplotlib; import it only for drawing figures. Figures are objects of their own with the Agg
canvas; the state of `matplotlib.pyplot` stays as it is.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jounce.papers.figures import legend_below, panels
from jounce.papers.negrean_2025.case import STAND_IN, Case
from jounce.papers.negrean_2025.motion_history import STEPS, History
from jounce.plot.style import BLUE, GRAY, GREEN, PALE_GRAY, VERMILION

TORQUES = (
    ("torque", "Driving torque", "N m"),
    ("torque rate", "First rate of the driving torque", "N m/s"),
    ("second rate", "Second rate of the driving torque", r"N m/s$^2$"),
)
ENERGY_COLORS = (BLUE, VERMILION, GREEN)


def note_on_substitutes(case: Case) -> str:
    """Return a note on the stand-ins for data of the paper: samples, masses and lengths, unless files give them."""
    nouns = [] if case.measured else ["samples"]
    nouns += ["masses", "lengths"] if case.link is STAND_IN else []
    if not nouns:
        return ""
    *others, last = nouns
    first = f"{', '.join(others)} and " if others else ""
    return f"stand-in data: {first}{last} are not those of the paper"


def _any_case(histories: Mapping[str, History]) -> Case:
    return next(iter(histories.values())).case


def _panels(
    rows: int, columns: int, size: tuple[float, float], title: str, note: str = ""
) -> tuple[Figure, np.ndarray]:
    figure, grid = panels(rows, columns, size, title, note, sharex=True)
    for panel in grid.flat:
        panel.axhline(0.0, color=PALE_GRAY, linewidth=0.7, zorder=1)
        panel.margins(x=0.0)
    for panel in grid[-1]:
        panel.set_xlabel("time / s")
    return figure, grid


def accelerations(histories: Mapping[str, History], *, tangential: bool, number: int) -> Figure:
    """Draw the samples and the law through them, one panel for each motion (figures 4 and 5)."""
    title = "Tangential acceleration" if tangential else "Generalized angular acceleration"
    unit = r"m/s$^2$" if tangential else r"rad/s$^2$"
    note = note_on_substitutes(_any_case(histories))
    figure, grid = _panels(len(histories), 1, (6.0, 4.8), f"{title} (figure {number} of Negrean 2025)", note)
    for panel, history in zip(grid[:, 0], histories.values(), strict=True):
        factor = history.case.link.radius if tangential else 1.0
        panel.plot(history.time, factor * history.motion[:, 2], color=BLUE, label="quintic segments")
        samples = factor * history.case.accelerations
        label = "samples" if history.case.measured else "synthetic samples, every 0.033 s"
        panel.plot(history.case.knots, samples, color=VERMILION, marker="o", linestyle="", label=label)
        panel.set_title(history.case.title)
        panel.set_ylabel(f"acceleration / ({unit})")
    grid[0, 0].legend(loc="upper right")
    figure.align_ylabels()
    return figure


def torque(histories: Mapping[str, History], *, rate: int, number: int) -> Figure:
    """Draw the driving torque or one of its rates, and the share of inertia (figures 7 to 9)."""
    name, title, unit = TORQUES[rate]
    figure, grid = _panels(len(histories), 1, (6.0, 4.8), f"{title} (figure {number} of Negrean 2025)")
    for panel, history in zip(grid[:, 0], histories.values(), strict=True):
        total = history.torques[:, rate]
        gravity = history.gravity[:, rate]
        inertial = {"color": VERMILION, "linestyle": "--", "linewidth": 1.1, "label": "share of inertia"}
        panel.plot(history.time, total, color=BLUE, label="driving torque", zorder=3)
        panel.plot(history.time, total - gravity, **inertial)
        panel.plot(history.time, gravity, color=GREEN, linestyle=":", linewidth=1.3, label="share of gravity")
        panel.set_title(history.case.title)
        panel.set_ylabel(f"{name} / ({unit})")
    legend_below(figure, grid[0, 0], 3, note_on_substitutes(_any_case(histories)))
    figure.align_ylabels()
    return figure


def energies(histories: Mapping[str, History]) -> Figure:
    """Draw the acceleration energies of orders 1 to 3, by the library and by the closed forms (equations 141-143)."""
    title = "Acceleration energies of orders 1 to 3 (equations 141-143 of Negrean 2025)"
    figure, grid = _panels(3, len(histories), (7.2, 6.0), title, note_on_substitutes(_any_case(histories)))
    for column, history in enumerate(histories.values()):
        for p, panel in enumerate(grid[:, column], 1):
            computed, formula = history.energies[:, p - 1], history.closed_energies[:, p - 1]
            panel.plot(history.time, computed, color=ENERGY_COLORS[p - 1], label="library")
            knots = slice(None, None, STEPS)  # the knots
            panel.plot(
                history.time[knots], formula[knots], color=GRAY, marker="x", linestyle="", label="closed form", zorder=3
            )
            panel.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4), useMathText=True)
            if column == 0:
                panel.set_ylabel(rf"$E_{p}$ / (kg m$^2$ s$^{{-{2 * p + 2}}}$)")
            if p == 1:
                panel.set_title(history.case.title)
    grid[0, -1].legend(loc="upper left")
    figure.align_ylabels()
    return figure


FIGURES: dict[str, Any] = {
    "figure_04": partial(accelerations, tangential=True, number=4),
    "figure_05": partial(accelerations, tangential=False, number=5),
    "figure_07": partial(torque, rate=0, number=7),
    "figure_08": partial(torque, rate=1, number=8),
    "figure_09": partial(torque, rate=2, number=9),
    "energies": energies,
}
