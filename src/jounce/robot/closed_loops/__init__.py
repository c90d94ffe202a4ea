"""Robots with closed loops, and robots as mechanisms."""
