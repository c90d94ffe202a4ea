"""Trajectories in the forms of ROS: messages, recorded joint states, bags."""
