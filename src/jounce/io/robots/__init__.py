"""Files of robots, of their trajectories and of their limits."""
