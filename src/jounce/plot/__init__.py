"""Figures of publication quality; matplotlib is imported when a figure is drawn."""

from jounce.plot.animation import animate as animate, check_animation as check_animation
from jounce.plot.charts.bands import draw_bands as draw_bands
from jounce.plot.charts.cams import draw_cam as draw_cam
from jounce.plot.charts.curves import draw_curves as draw_curves
from jounce.plot.charts.elastic import draw_feedforward as draw_feedforward
from jounce.plot.charts.limits import draw_limits as draw_limits
from jounce.plot.charts.portraits import hodograph as hodograph, phase_portrait as phase_portrait
from jounce.plot.figure import check_figure as check_figure, draw as draw, save as save
from jounce.plot.forces import (
    draw_energy as draw_energy,
    draw_power as draw_power,
    draw_reactions as draw_reactions,
)
from jounce.plot.html_report import check_report as check_report, report as report
from jounce.plot.machine_sketch import sketch as sketch
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
