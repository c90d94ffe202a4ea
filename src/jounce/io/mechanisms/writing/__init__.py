"""Writing a mechanism as a file."""
