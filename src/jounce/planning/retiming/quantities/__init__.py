"""Limited quantities along a path, of robots and mechanisms, and checks whether a motion keeps the limits."""
