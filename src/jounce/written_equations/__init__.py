"""Equations as text and code, from the residuals of joints on jets: for programs of others, and to be read."""

from jounce.settings import compute_under_own_settings as _compute_under_own_settings
from jounce.written_equations.write import equations as equations

_compute_under_own_settings(__name__)
