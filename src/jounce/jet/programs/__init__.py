"""Programs of JAX, traced from users' functions and run on Taylor series: composition, recursion, captured values."""
