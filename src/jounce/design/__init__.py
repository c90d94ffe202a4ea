"""Design: what varies in a mechanism and how, and what follows from it."""
