"""Programs of JAX for one instant, translated to machine code that runs them for many instants side by side."""
