"""Figures of publication quality; matplotlib is imported when one is drawn, not before."""

from jounce.plot.figure import check_figure as check_figure, draw as draw, save as save
from jounce.plot.limits import draw_limits as draw_limits
