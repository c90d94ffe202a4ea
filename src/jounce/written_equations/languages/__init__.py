"""The languages that equations are written in."""
