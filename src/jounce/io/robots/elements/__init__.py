"""Common parts of the readers of robot files: XML elements, faults of a file, and joints that follow others."""
