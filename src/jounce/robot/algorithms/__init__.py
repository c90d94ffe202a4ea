"""Algorithms on the joint coordinates of a robot: torques, accelerations, Jacobians."""
