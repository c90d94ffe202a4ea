"""Time-optimal motion along a path within the limits of a robot or of the drivers of a mechanism."""
