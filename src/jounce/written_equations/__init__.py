"""Equations as code for other programs and as text for readers, from the residuals of joints on jets."""

from jounce.settings import compute_under_own_settings as _compute_under_own_settings
from jounce.written_equations.write import equations as equations

_compute_under_own_settings(__name__)
