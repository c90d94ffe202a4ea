"""Gears, belts and ropes: turns counted about axes, frames and lengths."""
