"""Sweeps that outgrow a machine: designs by the million, in chunks that are written as they finish."""

from jounce.precision import compute_in_double as _compute_in_double
from jounce.sweeps.sweep import sweep as sweep

_compute_in_double(__name__)
