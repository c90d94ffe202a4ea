"""Joint coordinates that place a tool or move it along a path, with all derivatives."""
