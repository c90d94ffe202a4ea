"""Positions in which a mechanism stands still, whether it stays there, and in which coordinates it moves."""
