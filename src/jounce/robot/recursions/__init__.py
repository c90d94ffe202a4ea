"""Recursions over the tree of links: poses, Newton and Euler, articulated bodies."""
