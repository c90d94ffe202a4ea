"""Linearized equations about an equilibrium, natural frequencies and modes."""
