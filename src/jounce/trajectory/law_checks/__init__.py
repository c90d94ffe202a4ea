"""Breaks and smoothness of motion laws, and doubts about their units."""
