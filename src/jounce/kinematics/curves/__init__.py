"""Curves of configurations: the positions of a mechanism with one driver free, through dead and change points."""
