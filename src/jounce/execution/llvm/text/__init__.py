"""What is written for LLVM: values and arrays of them, in registers and in memory, and the lines of a program."""
