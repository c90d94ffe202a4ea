"""Common functions for files of any kind: safe reading, parsing with the line of every entry, atomic writing."""

DATA_FILES = (".yaml", ".yml", ".toml", ".json")
"""Endings of data files: mechanisms, laws and limits."""
ROBOT_FILES = (".urdf", ".xml", ".sdf")
"""Endings of robot files."""
