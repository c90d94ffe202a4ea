"""Continuation of a motion in time: predictor, corrector, singularity distance, change points."""
