"""Trajectories and paths of robots: files of laws and samples, recordings and messages of other tools."""
