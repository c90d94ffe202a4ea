"""Outputs of a mechanism: positions, angles, attitudes, instant centers, and derivatives of outputs."""
