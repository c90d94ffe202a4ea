"""Following a motion in steps: predictor, corrector, singularity distance, change points."""
