"""Drawings of machines: bodies, symbols of joints and drivers, gears, curves, names."""
