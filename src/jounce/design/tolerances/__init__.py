"""Tolerance analysis: the spread of outputs by deviations of parameters."""
