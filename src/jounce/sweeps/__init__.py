"""Large sweeps: millions of designs, computed in chunks that are written as they finish."""

from jounce.settings import compute_under_own_settings as _compute_under_own_settings
from jounce.sweeps.sweeping import sweep as sweep

_compute_under_own_settings(__name__)
