"""Curves of configurations: the paths of points, circuit by circuit, and outputs against the driver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jounce.errors import MechanismError, check_name
from jounce.kinematics import Curve
from jounce.mechanism import PointOutput
from jounce.plot.labels import scale_of, symbol, unit_label
from jounce.plot.style import GRAY, LINE_COLORS, blank_figure, set_ticks, shown_name, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIDE = 3.6  # inches
MARKS = {"maximum": "^", "minimum": "v", "stationary": "s"}
PROJECTIONS = ((0, 1), (0, 2), (1, 2))


def draw_curves(curves: Curve | Sequence[Curve], outputs: Sequence[str] | None = None) -> Figure:
    r"""Draw curves of configurations of a mechanism: paths of points, and other outputs against the driver.

    Parameters
    ----------
    curves : Curve or sequence of Curve
        One curve, or the circuits of a mechanism, each in its own color.
    outputs : sequence of str, optional
        Names of outputs; all by default.

    Returns
    -------
    matplotlib.figure.Figure
        One panel for each output, or for each projection of a point in space. Triangles mark limit positions, crosses
        change points.

    Raises
    ------
    MechanismError
        If there is no output, or a name does not exist.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw_curves
    >>> figure = draw_curves(jn.trace(jn.load("examples/four_bar.yaml")))
    >>> [axes.get_xlabel() for axes in figure.axes]
    ['theta  (rad)', '$C_{x}$  (m)']
    """
    curve_list = [curves] if isinstance(curves, Curve) else list(curves)
    if not curve_list:
        raise MechanismError("there is no curve to draw", name="curves", value=[])
    given_outputs = curve_list[0].outputs
    for name in outputs or ():
        check_name("output", name, given_outputs, MechanismError, name="outputs")
    panels = _panels(curve_list[0], list(outputs or given_outputs))
    if not panels:
        raise MechanismError("there is nothing to draw; name some outputs", name="outputs")
    title = curve_list[0].mechanism.title
    with style():
        width = min(len(panels), 3)
        height = -(-len(panels) // width)
        figure = blank_figure(SIDE * width + 0.5, SIDE * height + 0.4 + 0.3 * (len(curve_list) > 1), title)
        grid = np.atleast_1d(figure.subplots(height, width)).ravel()
        for axes in grid[len(panels) :]:
            axes.set_axis_off()
        for axes, panel in zip(grid, panels, strict=False):
            _draw_panel(axes, curve_list, *panel)
        if len(curve_list) > 1:
            handles, labels = grid[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", ncols=min(4, len(curve_list)))
    return figure


Panel = tuple[str, tuple[int, ...]]
"""An output, with the components of a path if it is a point."""


def _panels(curve: Curve, names: Sequence[str]) -> list[Panel]:
    panels: list[Panel] = []
    for name in names:
        values = curve.outputs[name]
        if isinstance(curve.mechanism.outputs[name], PointOutput):
            pairs = PROJECTIONS if values.shape[-1] == 3 else PROJECTIONS[:1]
            panels += [(name, pair) for pair in pairs]
        elif values.ndim == 2:
            panels.append((name, ()))
    return panels


def _draw_panel(axes: Any, curves: Sequence[Curve], name: str, pair: tuple[int, ...]) -> None:
    output = curves[0].mechanism.outputs[name]
    shown, factor = curves[0].mechanism.shown_units.of(output.unit, name)
    exponent = scale_of(np.concatenate([curve.outputs[name][:, 0].ravel() for curve in curves]) * factor)
    unit = unit_label(shown, 0, exponent)
    for number, curve in enumerate(curves):
        values = curve.outputs[name][:, 0] * factor * 10.0**-exponent
        x_values = curve.arc_lengths if curve.driver is None else curve.values[:, 0]
        x, y = (values[:, k] for k in pair) if pair else (x_values, values)
        color = LINE_COLORS[number % len(LINE_COLORS)]
        axes.plot(x, y, color=color, label=f"circuit {number + 1}")
        marks = [(point.arc_length, MARKS[point.kind]) for point in curve.limits]
        marks += [(point.arc_length, "x") for point in curve.change_points]
        for arc_length, mark in marks:
            index = int(np.argmin(np.abs(curve.arc_lengths - arc_length)))
            axes.plot(
                x[index], y[index], marker=mark, color=GRAY, fillstyle="none", markersize=5.5, linestyle="", zorder=4
            )
    if pair:
        for label, k in zip((axes.set_xlabel, axes.set_ylabel), pair, strict=True):
            label(f"{symbol(name, 0, output.labels[k]) or shown_name(name)}  ({unit})")
        axes.set_aspect("equal", adjustable="datalim")
    else:
        driver = curves[0].driver
        axes.set_xlabel("arc length" if driver is None else f"{driver}  ({curves[0].unit})")
        axes.set_ylabel(f"{symbol(name, 0, '') or shown_name(name)}  ({unit})")
    for axis in (axes.xaxis, axes.yaxis):
        set_ticks(axis, 5)
    axes.ticklabel_format(useOffset=False)
    axes.margins(0.06)
