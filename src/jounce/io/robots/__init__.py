"""Files of robots and of their limits."""
