"""What every subpackage may use: settings of JAX, lazy imports, shapes in types, interrupts, progress."""
