"""The rate along a path as a spline, its motion in time, and the convex programs that determine it."""
