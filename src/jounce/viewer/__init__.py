"""The web view: a mechanism or a robot in the browser, on this machine only, with arrows, plots and live parameters."""

from jounce.precision import compute_in_double as _compute_in_double
from jounce.viewer.server import View as View, view as view

_compute_in_double(__name__)
