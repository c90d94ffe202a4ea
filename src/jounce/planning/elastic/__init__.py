"""Motors behind springs: what they must do for a wanted motion, and what the links do under it."""
