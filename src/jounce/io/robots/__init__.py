"""Reading of robots and their limits from files."""
