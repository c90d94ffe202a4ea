"""Kinetic energy and acceleration energies of any order, and the equations that follow from them."""
