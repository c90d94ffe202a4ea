"""Recursions over the tree of links: poses, Newton-Euler, articulated bodies."""
