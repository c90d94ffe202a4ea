"""What is computed of a robot with its joint coordinates: torques, accelerations, Jacobians."""
