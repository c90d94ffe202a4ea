"""Linear algebra of many small matrices side by side, and of large ones with few entries; it knows no mechanism."""

from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
