"""The web viewer: a mechanism or a robot in a local browser, with arrows, plots and live parameters."""

from jounce.settings import compute_under_own_settings as _compute_under_own_settings
from jounce.viewer.server import View as View, view as view

_compute_under_own_settings(__name__)
