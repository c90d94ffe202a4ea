"""Simulations of mechanisms, alone and in batches."""
