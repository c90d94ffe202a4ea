#!/usr/bin/env bash
# JAX 0.10.2: jax.closure_convert and jnp.frompyfunc keep the values of attributes and globals of their first call.
#
# Neither is called within jax.jit here. closure_convert is handed the function anew each time, to find what it closes
# over, and frompyfunc makes a universal function of Python code, as numpy.frompyfunc does; one would expect both to run
# the function as it is now. Both compile it at the first call, and find the compiled one again by the identity of the
# function: after a gain is changed from 1 to 2, the function itself gives 2, closure_convert of it 1, and a universal
# function made of it, called before and after, 1. NumPy's gives 2. There is no message. Output seen:
# "function 2.0, closure_convert 1.0, jnp.frompyfunc 1.0, numpy.frompyfunc 2.0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "jax==0.10.2" "jaxlib==0.10.2" numpy
JAX_PLATFORMS=cpu "$folder/venv/bin/python" - <<'PY'
import jax
import jax.numpy as jnp
import numpy as np


class Controller:
    gain = 1.0


controller = Controller()


def torque(error, rate):
    return controller.gain * error + rate


def converted():
    function, closed_over = jax.closure_convert(torque, 1.0, 0.0)
    return float(function(1.0, 0.0, *closed_over))


of_jax, of_numpy = jnp.frompyfunc(torque, 2, 1), np.frompyfunc(torque, 2, 1)
before = torque(1.0, 0.0), converted(), float(of_jax(1.0, 0.0)), float(of_numpy(1.0, 0.0))
controller.gain = 2.0
after = torque(1.0, 0.0), converted(), float(of_jax(1.0, 0.0)), float(of_numpy(1.0, 0.0))
print("jax", jax.__version__)
print("function {}, closure_convert {}, jnp.frompyfunc {}, numpy.frompyfunc {}".format(*after))
assert before == (1.0, 1.0, 1.0, 1.0)
assert after == (2.0, 1.0, 1.0, 2.0), "captured values are read anew"
PY
