"""Smooth motions within a deviation of noisy samples."""
