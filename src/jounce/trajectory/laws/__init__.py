"""Motion laws: expressions, profiles, pieces, and laws composed of others."""
