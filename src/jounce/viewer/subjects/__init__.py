"""Subjects of the viewer, each with its controls."""
