"""Results of smoothing: distances of samples from the motion, and its jerk, with the dwells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from jounce.planning.smoothing.smooth import SmoothedTrajectory, samples_of
from jounce.plot.instants import evenly_chosen
from jounce.plot.style import GRAY, LINE_COLORS, PALE_GRAY, blank_figure, set_ticks, shown_name, style
from jounce.trajectory import JointTrajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, PANEL = 7.0, 2.0  # inches
DRAWN = 4000  # largest number of samples
NAMED = 14  # largest number of names in the legend
DASHES = ("-", (0, (4, 1.5)), (0, (1, 1.2)))


def draw_smoothing(given: JointTrajectory, motion: SmoothedTrajectory, title: str = "") -> Figure:
    """Draw the distances of samples from a smoothed motion, and the jerk of the motion.

    Parameters
    ----------
    given : JointTrajectory
        Trajectory through the samples.
    motion : SmoothedTrajectory
        Result of `smooth`.
    title : str, optional
        Title of the figure, by default the names of the joints.

    Returns
    -------
    matplotlib.figure.Figure
        Above, the distances relative to the deviation; below, the jerk. At most 4000 samples are drawn. The background
        is gray where all joints rest.
    """
    names = list(motion.joints)
    with style():
        figure = blank_figure(WIDTH, 2 * PANEL + 0.9, title or ", ".join(names), h_pad=0.06)
        distance_axes, jerk = figure.subplots(2, 1, sharex=True)
        times = np.linspace(motion.start, motion.stop, DRAWN)
        jerks = motion.derivatives(times, 3)[:, 3]
        for k, name in enumerate(names):
            rounds, index = divmod(k, len(LINE_COLORS))
            line: dict[str, Any] = {"color": LINE_COLORS[index], "linestyle": DASHES[rounds % len(DASHES)]}
            t, values = _samples(given, name)
            positions = motion.derivatives(t, 0)[:, 0, motion.names.index(name)]
            distance_axes.plot(t, (values - positions) / motion.deviation, ".", markersize=1.2, color=line["color"])
            label = shown_name(name) if k < NAMED else None
            jerk.plot(times, jerks[:, motion.names.index(name)], label=label, linewidth=0.9, **line)
        for side in (-1, 1):
            distance_axes.axhline(side, color=GRAY, linewidth=1.0)
        for axes in (distance_axes, jerk):
            for first, last in _common_dwells(motion):
                axes.axvspan(first, last, color=PALE_GRAY, linewidth=0, zorder=0)
            set_ticks(axes.yaxis, 5)
        distance_axes.set_ylabel(f"from the samples\n(share of {motion.deviation:.3g} rad or m)")
        jerk.set_ylabel("jerk  (rad/s$^3$ or m/s$^3$)")
        jerk.set_xlabel("time  $t$  (s)")
        jerk.set_xlim(motion.start, motion.stop)
        jerk.legend(fontsize=6.5, ncols=2, loc="upper right")
    return figure


def _samples(given: JointTrajectory, name: str) -> tuple[np.ndarray, np.ndarray]:
    samples = samples_of(given, name)
    assert samples is not None
    chosen = evenly_chosen(np.arange(len(samples[0])), DRAWN)
    return samples[0][chosen], samples[1][chosen]


def _common_dwells(motion: SmoothedTrajectory) -> list[tuple[float, float]]:
    """Return the intervals in which all joints rest."""
    common = [(motion.start, motion.stop)]
    for joint in motion.joints.values():
        overlaps = [(max(a, c), min(b, d)) for a, b in common for c, d in joint.dwells]
        common = [(first, last) for first, last in overlaps if first < last]
    return common
