"""MJCF, compiled by MuJoCo: bodies, drives, ties, and parts that are left out."""
