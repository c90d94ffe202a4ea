"""Trajectories of robots, and whether they keep the limits of the joints."""
