"""Deflections of springs under a feedforward, and errors of links in simulations with and without spring torques."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from jounce.planning.elastic.link_errors import LinkErrors
from jounce.planning.elastic.motor_motion import Feedforward
from jounce.plot.instants import evenly_chosen
from jounce.plot.style import BLUE, GRAY, LINE_COLORS, PALE_GRAY, VERMILION, blank_figure, set_ticks, shown_name, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, PANEL = 7.0, 2.1  # inches
DRAWN = 4000  # largest number of instants
LEAST = 1e-17  # value at which zero errors are drawn
DASHES = ("-", (0, (4, 1.5)), (0, (1, 1.2)))


def draw_feedforward(feedforward: Feedforward, errors: LinkErrors, title: str = "") -> Figure:
    """Draw the deflections of springs, and the errors of links in a simulation under the motor torques.

    Parameters
    ----------
    feedforward : Feedforward
        Feedforward of a robot or a mechanism with elastic drives.
    errors : LinkErrors
        Result of `jounce.planning.link_errors`.
    title : str, optional
        Title of the figure, by default that of the robot or mechanism.

    Returns
    -------
    matplotlib.figure.Figure
        Above, the deflections in mrad for turning joints and in mm for sliding ones; below, on a logarithmic axis, the
        largest error of all links under the exact torques, and without the torques that accelerate the deflections.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw_feedforward
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 12, 1 / 12])
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, 0, 1])
    >>> arm = jn.Robot("arm", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    >>> drives = {"pin": jn.planning.Drive(stiffness=100.0, rotor_inertia=1e-4, gear_ratio=50)}
    >>> found = jn.planning.feedforward(arm, jn.JointTrajectory({"pin": "sin(t)"}, start=0.0, stop=0.5), drives)
    >>> errors = jn.planning.LinkErrors(("pin",), ("rad",), found.time, 1e-14 * found.q[:, 0], None)
    >>> figure = draw_feedforward(found, errors)  # in earnest: those that jn.planning.link_errors finds
    >>> [axes.get_ylabel().split()[0] for axes in figure.axes]
    ['deflection', 'error']
    """
    arrays = feedforward.system.arrays
    elastic = np.flatnonzero(arrays.elastic)
    kinds = [(kind, [k for k in elastic if arrays.turning[k] == kind]) for kind in (True, False)]
    panels = [(kind, joints) for kind, joints in kinds if joints]
    with style():
        figure = blank_figure(WIDTH, PANEL * (len(panels) + 1) + 0.5, title or feedforward.title)
        axes_column = figure.subplots(len(panels) + 1, 1, sharex=True, squeeze=False)[:, 0]
        chosen = evenly_chosen(np.arange(len(feedforward.time)), DRAWN)
        for axes, (are_angles, joints) in zip(axes_column, panels, strict=False):
            axes.axhline(0.0, color=PALE_GRAY, linewidth=0.7, zorder=1)
            for k in joints:
                rounds, color = divmod(int(k), len(LINE_COLORS))
                line = {"color": LINE_COLORS[color], "linestyle": DASHES[rounds % len(DASHES)]}
                values = 1e3 * feedforward.deflection[chosen, 0, k]
                axes.plot(feedforward.time[chosen], values, label=shown_name(feedforward.names[k]), **line)
            axes.set_ylabel(f"deflection\n({'mrad' if are_angles else 'mm'})")
            set_ticks(axes.yaxis, 5)
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, handlelength=1.8)
        _draw_errors(errors, axes_column[-1])
        axes_column[-1].set_xlim(feedforward.time[0], feedforward.time[-1])
        set_ticks(axes_column[-1].xaxis, 6)
        axes_column[-1].set_xlabel("time  $t$  (s)")
        figure.align_ylabels()
    return figure


def _draw_errors(errors: LinkErrors, axes: Any) -> None:
    lines = [(errors.exact, BLUE, "exact torques")]
    if errors.rigid is not None:
        lines.append((errors.rigid, VERMILION, "without $\\ddot\\tau$"))
    for values, color, label in lines:
        axes.plot(errors.time, np.maximum(values.max(axis=1), LEAST), color=color, label=label)
    axes.set_yscale("log")
    axes.axhline(1e-9, color=GRAY, linewidth=0.7, linestyle=":", zorder=1)
    unit = errors.units[0] if len(set(errors.units)) == 1 else "rad, m"
    axes.set_ylabel(f"error of links\n({unit})")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, handlelength=1.8)
