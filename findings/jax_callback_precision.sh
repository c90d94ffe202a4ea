#!/usr/bin/env bash
# JAX 0.10.2: jax.pure_callback within jax.jit hands numbers in single precision to the host under
# `with jax.enable_x64(True):`.
#
# The compiled program computes in double precision, as asked for. One would expect the host function to get the float64
# numbers of the program. Where the program has to wait for its operands, XLA calls it in a thread of its own, where the
# setting of the process holds, not that of the `with`: JAX puts the operands on the device there, and rounds them to
# float32. A function that decides by them (a comparison, an index) decides by rounded numbers without a message, and
# rightly where nothing had to be waited for; float64 results are refused ("Incorrect output dtype"). With
# jax.config.update("jax_enable_x64", True) all is right. Output seen: "at once: float64 True; waited for: float32 False".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "jax==0.10.2" "jaxlib==0.10.2" numpy
JAX_PLATFORMS=cpu "$folder/venv/bin/python" - <<'PY'
import jax
import jax.numpy as jnp
import numpy as np

seen = []


def is_at_most_a_tenth(x):
    seen.append(x.dtype)
    return np.asarray(x, np.float64)[:1] <= 0.1


with jax.enable_x64(True):
    program = jax.jit(lambda x: jax.pure_callback(is_at_most_a_tenth, jax.ShapeDtypeStruct((1,), bool), x))
    at_once = np.asarray(program(jnp.full(1000, 0.1)))
    slow = jax.jit(lambda x: x @ x)(jnp.zeros((2000, 2000)))
    waited_for = np.asarray(program(0.1 + slow[0, :1000]))
print("jax", jax.__version__)
print(f"at once: {seen[0]} {at_once[0]}; waited for: {seen[1]} {waited_for[0]}")
assert (seen[0], at_once[0]) == (np.float64, True)
assert (seen[1], waited_for[0]) == (np.float32, False), "the host gets double precision now"
PY
