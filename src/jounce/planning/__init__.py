"""Planning: what a controller is sent, from a path or a task: time laws, coordinates of a tool path, feedforward."""
