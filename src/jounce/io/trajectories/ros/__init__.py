"""Trajectories as ROS writes them: messages, recorded joint states, bags."""
