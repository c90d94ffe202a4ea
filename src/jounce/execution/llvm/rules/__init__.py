"""How each operation of JAX is written for LLVM: on single values, and as loops over arrays in memory."""
