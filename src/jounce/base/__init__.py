"""What every room may use: settings of JAX, lazy imports, shapes in types, interrupts, progress."""
