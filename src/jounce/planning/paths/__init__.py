"""Paths of joints: positions as functions of a parameter independent of time."""
