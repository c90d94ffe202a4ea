"""Positions and derivatives at the instants of a grid, in blocks of rounds."""
