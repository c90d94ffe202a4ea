"""The spread of outputs by deviations of parameters."""
