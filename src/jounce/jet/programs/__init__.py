"""Programs of JAX, read as users write them and run on Taylor series: composition, recursion, what they capture."""
