"""Joint coordinates that place a tool, or lead it along a path, with all derivatives."""
