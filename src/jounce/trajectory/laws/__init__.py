"""Laws of motion: expressions, profiles, pieces, and laws composed of others."""
