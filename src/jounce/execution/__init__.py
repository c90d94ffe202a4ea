"""Execution of functions of arrays: compilation by XLA or to machine code, storage of programs, threads, and chunks.

It knows nothing of mechanisms and robots. Functions that compute in double precision are decorated one by one.
"""
