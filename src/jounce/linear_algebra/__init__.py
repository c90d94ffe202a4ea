"""Linear algebra of many small matrices side by side, and of large sparse ones; independent of mechanisms."""

from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
