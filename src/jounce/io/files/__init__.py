"""Files of any kind: read safely, parsed with the lines of their entries, written whole."""

DATA_FILES = (".yaml", ".yml", ".toml", ".json")
"""Endings of files of mechanisms, laws and limits: of data that are read and written alike."""
ROBOT_FILES = (".urdf", ".xml")
"""Endings of files of robots."""
