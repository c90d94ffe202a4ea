"""Putting a mechanism together by Gauss-Newton steps, redundant equations, and what can then move."""
