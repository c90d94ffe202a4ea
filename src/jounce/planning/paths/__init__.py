"""Paths of joints: positions as functions of a parameter that says nothing of time."""
