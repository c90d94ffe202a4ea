"""The matrix of constrained motion, the accelerations of what moves freely, and the state it starts from."""
