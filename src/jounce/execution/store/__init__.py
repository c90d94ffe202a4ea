"""Compiled programs, stored in a folder for later processes."""
