"""Building a mechanism, and one whose parameters are traced."""
