"""The search for the design in which an objective is least."""
