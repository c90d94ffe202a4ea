"""Plate cams: the profile with its follower, and lift, pressure angle and radius of curvature over the cam angle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from jounce.errors import MechanismError
from jounce.kinematics import OscillatingFollower, PlateCam
from jounce.kinematics.cams.plate_cams import SIGNS
from jounce.plot.labels import axis_range
from jounce.plot.style import BLUE, GRAY, ORANGE, PALE_GRAY, VERMILION, blank_figure, set_ticks, shown_name, style
from jounce.units.shown_units import ShownUnits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 8.4, 4.6  # inches
MOST_RADII = 12  # range of the axis of radii of curvature, in base radii


def draw_cam(cam: PlateCam, units: Mapping[str, str] | ShownUnits | None = None) -> Figure:
    """Draw a plate cam with its follower at cam angle zero, and its lift, pressure angle and radii of curvature.

    Parameters
    ----------
    cam : PlateCam
        The cam; undercut parts are red.
    units : dict of str to str, optional
        Units of lengths and angles, by default those of the cam.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MechanismError
        If `cam` is not a cam.
    UnitError
        If a unit does not fit.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.plot import draw_cam
    >>> figure = draw_cam(jn.cams.load_cam("examples/cams/intake.yaml"))
    >>> [axes.get_ylabel() for axes in figure.axes[1:]]
    ['lift (mm)', 'pressure angle (deg)', 'radius (mm)']
    """
    if not isinstance(cam, PlateCam):
        raise MechanismError("must be a jn.cams.PlateCam", name="cam", value=cam)
    shown_units = cam.shown_units if units is None else units
    shown_units = shown_units if isinstance(shown_units, ShownUnits) else cam.shown_units.merged(shown_units)
    with style():
        figure = blank_figure(WIDTH, HEIGHT, cam.title)
        grid = figure.add_gridspec(3, 2, width_ratios=(1.25, 1.0))
        sketch = figure.add_subplot(grid[:, 0])
        _draw_profile(sketch, cam, shown_units)
        panels = [figure.add_subplot(grid[row, 1]) for row in range(3)]
        _draw_curves(panels, cam, shown_units)
        figure.align_ylabels(panels)
    return figure


def _draw_profile(axes: Any, cam: PlateCam, shown_units: ShownUnits) -> None:
    """Draw the cam at cam angle zero, with its pitch curve, base circle and follower."""
    unit, factor = shown_units.of("m")
    table, turn = cam.table, np.linspace(0, 2 * np.pi, 181)
    base = cam.base_radius * factor
    axes.plot(base * np.cos(turn), base * np.sin(turn), color=PALE_GRAY, linewidth=0.8, linestyle=":")
    x, y = table.profile * factor
    if cam.follower.shape == "roller":
        axes.plot(*(table.pitch * factor), color=GRAY, linewidth=0.8, linestyle="--")
    axes.fill(x, y, color=BLUE, alpha=0.12, linewidth=0)
    axes.plot(x, y, color=BLUE, linewidth=1.4)
    is_cut = (cam.table.lift - cam.followed_lift) > 0
    is_reversed = table.forward < 0
    axes.plot(
        np.where(is_cut | is_reversed, x, np.nan),
        np.where(is_cut | is_reversed, y, np.nan),
        color=VERMILION,
        linewidth=2.0,
    )
    axes.plot(0, 0, marker="+", color=GRAY, markersize=8)
    _draw_follower(axes, cam, factor)
    sign = SIGNS[cam.sense]
    arc = np.linspace(0.35, 1.15, 31) * sign + (np.pi / 2 if sign < 0 else 0.0)
    radius = 0.45 * base
    tip, before = (radius * np.array([np.cos(a), np.sin(a)]) for a in (arc[-1], arc[-4]))
    axes.plot(radius * np.cos(arc), radius * np.sin(arc), color=GRAY, linewidth=0.9)
    axes.annotate("", tip, before, arrowprops={"arrowstyle": "->", "color": GRAY, "linewidth": 0.9})
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"x ({unit})")
    axes.set_ylabel(f"y ({unit})")
    axes.margins(0.06)
    for axis in (axes.xaxis, axes.yaxis):
        set_ticks(axis, 6)


def _draw_follower(axes: Any, cam: PlateCam, factor: float) -> None:
    """Draw the follower at cam angle zero."""
    follower, state = cam.follower, cam.at(0.0)
    touch, center = state.profile[:, 0] * factor, state.pitch[:, 0] * factor
    line = {"color": ORANGE, "linewidth": 1.4}
    reach = cam.base_radius * factor
    coordinate = follower.start(cam.base_radius) + float(state.lift[0])
    if isinstance(follower, OscillatingFollower):
        pivot = np.array([follower.center_distance * factor, 0.0])
        axes.plot(*pivot, marker="o", color=ORANGE, fillstyle="none", markersize=6)
        if not follower.is_flat:
            axes.plot(*np.array([pivot, center]).T, **line)
        else:
            direction = np.array([-math.cos(coordinate), math.sin(coordinate)])
            foot = pivot - follower.face_offset * factor * np.array([math.sin(coordinate), math.cos(coordinate)])
            ends = [foot, foot + direction * (np.linalg.norm(touch - foot) + 0.6 * reach)]
            axes.plot(*np.array([pivot, *ends]).T, **line)
    elif follower.is_flat:
        low, high = (end.value * factor for end in cam.face or ())
        face = follower.offset * factor + np.array([low, high])
        axes.plot(face, [touch[1]] * 2, **line)
        axes.plot([follower.offset * factor] * 2, [touch[1], touch[1] + reach], **line)
    else:
        axes.plot([center[0]] * 2, [center[1], center[1] + reach], **line)
    if follower.shape == "roller":
        turn = np.linspace(0, 2 * np.pi, 91)
        radius = follower.radius * factor
        axes.plot(center[0] + radius * np.cos(turn), center[1] + radius * np.sin(turn), **line)


def _draw_curves(panels: Any, cam: PlateCam, shown_units: ShownUnits) -> None:
    """Draw lift, pressure angle and radius of curvature over the cam angle."""
    table = cam.table
    angle_unit, by_angle = shown_units.of("rad", "angle")
    lift_unit, by_lift = shown_units.of("rad" if cam.follower.turning else "m", "lift")
    pressure_unit, by_pressure = shown_units.of("rad", "pressure_angle")
    length_unit, by_length = shown_units.of("m")
    angle = cam.angle * by_angle
    limit = MOST_RADII * cam.base_radius
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = 1.0 / table.curvature
    radius = np.where(np.abs(radius) > limit, np.nan, radius) * by_length
    rows = [
        (table.lift * by_lift, f"lift ({lift_unit})"),
        (table.pressure_angle * by_pressure, f"pressure angle ({pressure_unit})"),
        (radius, f"radius ({length_unit})"),
    ]
    for axes, (values, label) in zip(panels, rows, strict=True):
        axes.plot(angle, values, color=BLUE, linewidth=1.2)
        axes.set_ylabel(shown_name(label))
        axes.set_xlim(angle[0], angle[-1])
        axes.set_ylim(*axis_range(values, 0.08))
        axes.axhline(0.0, color=PALE_GRAY, linewidth=0.7, zorder=1)
        set_ticks(axes.yaxis, 4, least=3)
        axes.tick_params(labelbottom=axes is panels[-1])
    if np.any(cam.followed_lift < table.lift):
        panels[0].plot(angle, cam.followed_lift * by_lift, color=VERMILION, linewidth=1.0, linestyle="--")
    panels[-1].set_xlabel(f"cam angle ({angle_unit})")
    if angle_unit in ("deg", "degree", "degrees"):
        for axes in panels:
            axes.set_xticks(np.arange(0, 361, 60))
