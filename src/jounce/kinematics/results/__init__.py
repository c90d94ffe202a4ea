"""Results of a solution: motions, and outputs of poses."""
