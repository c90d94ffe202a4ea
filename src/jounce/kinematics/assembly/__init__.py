"""Assembly by Gauss-Newton iteration, redundant constraints, and mobility."""
