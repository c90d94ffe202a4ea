"""Tolerance bands of outputs and derivatives over time, and the shares of the parameters in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jounce.errors import MechanismError
from jounce.plot.labels import scale_of, symbol, unit_label
from jounce.plot.style import GRAY, LINE_COLORS, blank_figure, set_ticks, shown_name, style
from jounce.reporting.facts.spread_facts import Column, chosen

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

WIDTH, ROW = 9.5, 1.9  # inches
BAND = 0.3  # opacity
TWO_SIDED = 1.959964  # standard deviations within which 95 percent of a normal distribution lie
MOST_SHARES = 8


def draw_bands(spread: xarray.Dataset, columns: Sequence[Column], title: str = "") -> Figure:
    """Draw the tolerance band of each column over time, its deviation from the nominal motion, and parameter shares.

    Parameters
    ----------
    spread : xarray.Dataset
        Result of `jounce.tolerance`.
    columns : sequence of (str, str, int)
        Output, component (or an empty string), and derivative of each row.
    title : str, optional
        Title of the figure, by default that of the mechanism.

    Returns
    -------
    matplotlib.figure.Figure
        Three panels for each column: the band of 95 percent of the samples, with dashed lines for the band to first
        order, and the shares of the parameters in the variance to first order.

    Raises
    ------
    MechanismError
        If no column is given.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw_bands
    >>> four_bar = jn.load("examples/four_bar.yaml")
    >>> spread = jn.tolerance(four_bar, {"BC": "normal:0.1mm"}, [0.0, 0.5, 1.0], of=["psi_d1"], samples=0)
    >>> len(draw_bands(spread, [("psi", "", 1)]).axes)
    3
    """
    if not columns:
        raise MechanismError("there is nothing to draw; name some outputs", name="columns")
    parameters = [str(name) for name in spread["parameter"].values]
    with style():
        height = ROW * len(columns) + 0.9
        figure = blank_figure(WIDTH, height, title or spread.attrs.get("title", ""), h_pad=0.06)
        grid = figure.subplots(len(columns), 3, sharex=True, squeeze=False)
        for row, column in zip(grid, columns, strict=True):
            _draw_row(spread, column, row, parameters)
        for axes, heading in zip(grid[0], ("value", "deviation, 95 % of designs", "part of the variance"), strict=True):
            axes.set_title(heading, loc="left")
        for axes in grid[-1]:
            axes.set_xlabel("time  $t$  (s)")
        legend_entries = [axes.get_legend_handles_labels() for axes in grid[0][1:]]
        handles, labels = ([*first, *second] for first, second in zip(*legend_entries, strict=True))
        if handles:
            figure.legend(handles, labels, loc="outside lower center", ncols=min(6, len(handles)))
    return figure


def _draw_row(spread: Any, column: Column, panels: Any, parameters: list[str]) -> None:
    name, component, order = column
    time = spread["time"].values
    value, deviation, variance = panels
    nominal = chosen(spread, name, column)
    exponent = scale_of(nominal)
    label = symbol(name, order, component) or shown_name(f"{name} {component}".strip())
    units = spread[name].attrs["units"]
    value.set_ylabel(f"{label}  ({unit_label(units, order, exponent)})")
    value.plot(time, nominal * 10.0**-exponent, color=LINE_COLORS[0])
    bounds = [chosen(spread, f"{name}_{side}", column) for side in ("low", "high") if f"{name}_{side}" in spread]
    linear = f"{name}_linear_std"
    sides = [chosen(spread, linear, column) * TWO_SIDED * sign for sign in (-1, 1)] if linear in spread else []
    scaled = scale_of(np.concatenate([*(bound - nominal for bound in bounds), *sides, np.zeros(1)]))
    if bounds:
        value.fill_between(time, *(x * 10.0**-exponent for x in bounds), color=LINE_COLORS[0], alpha=BAND, linewidth=0)
        differences = [(x - nominal) * 10.0**-scaled for x in bounds]
        deviation.fill_between(time, *differences, color=LINE_COLORS[0], alpha=BAND, linewidth=0, label="samples")
    for side in sides:
        entry = "first order" if side is sides[0] else None
        deviation.plot(time, side * 10.0**-scaled, color=GRAY, linewidth=0.9, linestyle=(0, (4, 2)), label=entry)
    deviation.axhline(0.0, color=LINE_COLORS[0], linewidth=0.8)
    deviation.set_ylabel(rf"$\Delta$ {label}  ({unit_label(units, order, scaled)})")
    if f"{name}_share" in spread:
        parts = chosen(spread, f"{name}_share", column)
        first = np.argsort(-parts.mean(axis=1), kind="stable")[:MOST_SHARES]
        ordered = [k for k in range(len(parameters)) if k in first]  # one color in all rows
        colors = [LINE_COLORS[k % len(LINE_COLORS)] for k in ordered]
        names = [shown_name(parameters[k]) for k in ordered]
        variance.stackplot(time, parts[ordered], labels=names, colors=colors, alpha=0.75, linewidth=0)
    variance.set_ylim(0.0, 1.0)
    variance.set_ylabel(f"of {label}")
    for axes in panels:
        axes.set_xlim(time[0], time[-1])
        set_ticks(axes.yaxis, 5)
        set_ticks(axes.xaxis, 5)
        axes.ticklabel_format(useOffset=False)
