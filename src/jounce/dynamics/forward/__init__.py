"""The matrix of constrained motion, the accelerations of free motions, and the states from which they start."""
