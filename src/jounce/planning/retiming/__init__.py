"""The fastest motion along a path that keeps the limits of a robot or of the drivers of a mechanism."""
