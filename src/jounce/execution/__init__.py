"""How functions of arrays are run: compiled by XLA or as machine code, kept, in threads and in chunks.

It knows nothing of mechanisms and robots. What it computes in double precision it says function by function.
"""
