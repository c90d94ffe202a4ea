"""The spread of outputs where parameters deviate."""
