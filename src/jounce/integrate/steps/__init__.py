"""One step: Taylor series, Obreshkov formulas, projection, and what lies within the step."""
