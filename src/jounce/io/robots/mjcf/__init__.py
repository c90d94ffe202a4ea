"""MJCF, compiled by MuJoCo: bodies, drives, ties, and what is left out."""
