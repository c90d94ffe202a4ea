"""Files of any kind: read safely, parsed with the lines of their entries, written whole."""
