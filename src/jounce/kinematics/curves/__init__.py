"""Curves of configurations: the positions of a mechanism with one free driver, through dead and change points."""
