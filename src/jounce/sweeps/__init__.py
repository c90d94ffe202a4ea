"""Sweeps that outgrow a machine: designs by the million, in chunks that are written as they finish."""

from jounce.sweeps.sweep import sweep as sweep
