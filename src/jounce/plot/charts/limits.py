"""Ratios of quantities of the joints of a robot to their limits along a trajectory: one panel for each quantity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from jounce.dynamics.limits.check_limits import FIELDS
from jounce.dynamics.limits.limit_report import LimitReport, LimitRow
from jounce.errors import RobotError
from jounce.plot.instants import evenly_chosen
from jounce.plot.labels import unit_label
from jounce.plot.style import GRAY, LINE_COLORS, PALE_GRAY, blank_figure, set_ticks, shown_name, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DASHES = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (5, 1.2, 1, 1.2)), (0, (8, 2)), (0, (2, 2)))
BROKEN, FORBIDDEN = "#B22222", "#EDEDED"
WIDTH, ROW = 7.0, 1.75  # inches
BEYOND = 1.3  # position of marks of infinite values, relative to the drawn range
DRAWN = 4000  # largest number of instants, to keep vector files small; the worst instants are marked exactly


def draw_limits(report: LimitReport, title: str = "") -> Figure:
    """Draw the ratios of the quantities of each joint to their limits over time, from -1 to 1 within the limits.

    Parameters
    ----------
    report : LimitReport
        Result of `check_limits`.
    title : str, optional
        Title of the figure, by default the name of the robot.

    Returns
    -------
    matplotlib.figure.Figure
        One panel for each quantity with limits, with the forbidden range shaded and the worst instant marked.

    Raises
    ------
    RobotError
        If no quantity has a limit.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.dynamics.limits.check_limits import check_limits
    >>> from jounce.plot.charts.limits import draw_limits
    >>> rod = jn.Inertia(1.0, center_of_mass=[0.5, 0, 0])
    >>> pin = jn.Joint("pin", "base", "rod", axis=[0, -1, 0], limits=jn.Limits(velocity=2.0, effort=8.0))
    >>> pendulum = jn.Robot("pendulum", [jn.Link("base"), jn.Link("rod", rod)], [pin])
    >>> report = check_limits(pendulum, jn.JointTrajectory({"pin": "sin(t)"}, start=0.0, stop=3.0))
    >>> [axes.get_title(loc="left") for axes in draw_limits(report).axes]
    ['worst: pin, 1 rad/s (limit 2)', 'worst: pin, 4.905 N m (limit 8)']
    """
    limited = np.array(np.isfinite(report.shares).any(axis=0))  # quantities, joints
    for name in report.held:
        limited[: FIELDS.index("effort"), report.joint_names.index(name)] = False
    rows = np.flatnonzero(limited.any(axis=1))
    if not rows.size:
        raise RobotError("there are no limits to draw; give some", name="limits")
    columns = 2 if len(rows) > 3 else 1
    lines = -(-len(rows) // columns)
    with style():
        joints = np.flatnonzero(limited.any(axis=0))
        legend = 0.22 * -(-len(joints) // _per_line(report, joints))
        height = ROW * lines + 0.75 + legend
        figure = blank_figure(WIDTH, height, title or report.robot, h_pad=0.06, hspace=0.02, wspace=0.03)
        grid = figure.subplots(lines, columns, sharex=True, squeeze=False)
        axes_list = [*grid.T.reshape(-1)]  # the derivatives of the position one below the other
        for axes in axes_list[len(rows) :]:
            axes.set_axis_off()
        for quantity, axes in zip(rows.tolist(), axes_list, strict=False):
            _draw_panel(report, quantity, np.flatnonzero(limited[quantity]).tolist(), axes)
        figure.align_ylabels()
        for axes in (*grid[-1], axes_list[len(rows) - 1]):
            axes.set_xlabel("time  $t$  (s)")
            axes.tick_params(labelbottom=True)
        _draw_legend(report, joints.tolist(), figure)
    return figure


def _per_line(report: LimitReport, joints: Any) -> int:
    """Return the number of names of joints in a line of the legend."""
    longest = max(len(report.joint_names[joint]) for joint in joints)
    return max(1, min(len(joints), int(WIDTH / (0.064 * longest + 0.5))))


def _line_style(joint: int) -> dict[str, Any]:
    rounds, index = divmod(joint, len(LINE_COLORS))
    return {"color": LINE_COLORS[index], "linestyle": DASHES[rounds % len(DASHES)]}


def _draw_panel(report: LimitReport, quantity: int, joints: list[int], axes: Any) -> None:
    chosen = evenly_chosen(np.arange(len(report.times)), DRAWN)
    shares = report.shares[chosen, quantity]
    for joint in joints:
        axes.plot(report.times[chosen], shares[:, joint], **_line_style(joint))
    worst = max(_rows_of(report, quantity), key=lambda row: row.ratio or 0.0)
    side = 1 if _is_upper(report, worst) else -1
    tip = side * BEYOND * max(1.0, float(np.nanmax(np.abs(shares)))) if worst.infinite else side * (worst.ratio or 0.0)
    low, high = min(-1.0, tip, float(np.nanmin(shares))), max(1.0, tip, float(np.nanmax(shares)))
    margin = 0.08 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlim(report.times[0], report.times[-1])
    for sign in (-1, 1):
        axes.axhline(sign, color=GRAY, linewidth=1.1, zorder=1.5)
        axes.axhspan(sign, sign * (abs(low) + abs(high) + margin), color=FORBIDDEN, linewidth=0, zorder=0)
    axes.axhline(0.0, color=PALE_GRAY, linewidth=0.7, zorder=1)
    mark = ("^" if side > 0 else "v") if worst.infinite else "o"
    axes.plot([worst.time], [tip], marker=mark, markersize=4, color="black", fillstyle="none", zorder=5, clip_on=False)
    set_ticks(axes.yaxis, 5, least=3)
    set_ticks(axes.xaxis, 6)
    label = " / ".join(dict.fromkeys(row.quantity for row in _rows_of(report, quantity)))
    axes.set_ylabel(f"{label}\n(share of limit)")
    name = shown_name(worst.joint)
    size = "infinite" if worst.infinite else f"{worst.value:.5g} {unit_label(worst.unit, 0)}"
    note = f"worst: {name}, {size} (limit {worst.limit:.5g})"
    axes.set_title(note, loc="left", pad=4, fontsize=7.5, color=BROKEN if worst.broken else GRAY)


def _rows_of(report: LimitReport, quantity: int) -> list[LimitRow]:
    """Return the rows of a quantity with a limit."""
    names = {FIELDS[quantity].replace("effort", kind).replace("_", " ") for kind in ("torque", "force")}
    return [row for row in report.limited if row.quantity in names]


def _is_upper(report: LimitReport, row: LimitRow) -> bool:
    """Return whether the limit of a row is the upper one."""
    if row.quantity != "position":
        return (row.limit or 0.0) > 0
    joint = report.joint_names.index(row.joint)
    index = int(np.argmin(np.abs(report.times - row.time)))
    return bool(report.shares[index, 0, joint] >= 0)


def _draw_legend(report: LimitReport, joints: list[int], figure: Any) -> None:
    from matplotlib.lines import Line2D

    names = {joint: shown_name(report.joint_names[joint]) for joint in joints}
    handles = [Line2D([], [], linewidth=1.6, label=name, **_line_style(joint)) for joint, name in names.items()]
    spacing = {"handlelength": 1.8, "handletextpad": 0.5, "columnspacing": 1.4, "borderaxespad": 0.1}
    figure.legend(handles=handles, loc="outside lower center", ncols=_per_line(report, joints), **spacing)
