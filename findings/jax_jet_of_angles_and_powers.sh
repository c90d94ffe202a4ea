#!/usr/bin/env bash
# JAX 0.10.2: jax.experimental.jet gives NaN for an angle of arctan2 on the y axis, and for x**3.0 at x <= 0.
#
# jet computes Taylor series of smooth functions. One would expect the derivatives that nested jax.jvp gives. The rule
# of arctan2 divides y by x: at the top of its circle, where x is 0, a crank has an angle and no derivatives. The rule
# of powers takes the logarithm of the base: for a float exponent, all derivatives are NaN where the base is negative or
# 0, also where the exponent is a whole number and each derivative by jax.jvp is right; for x**3 they are right. There
# is no message, and the values themselves are right. Output seen: "arctan2(1 + x, x) at 0: 1.571 nan nan, by jvp 1.571
# -1 2; x**3.0 at -2: -8 nan nan, by jvp -8 12 -12". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "jax==0.10.2" "jaxlib==0.10.2" numpy
JAX_ENABLE_X64=1 JAX_PLATFORMS=cpu "$folder/venv/bin/python" - <<'PY'
import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.jet import jet


def by_jet(f, x):
    value, derivatives = jet(f, (x,), ([1.0, 0.0],))
    return np.array([value, *derivatives])


def by_jvp(f, x):
    def first(x):
        return jax.jvp(f, (x,), (1.0,))[1]

    return np.array([f(x), first(x), jax.jvp(first, (x,), (1.0,))[1]])


def angle(x):
    return jnp.arctan2(1.0 + x, x)


def cube(x):
    return x**3.0


cases = {
    "arctan2(1 + x, x) at 0": (angle, 0.0, [np.pi / 2, -1.0, 2.0]),
    "x**3.0 at -2": (cube, -2.0, [-8.0, 12.0, -12.0]),
}
print("jax", jax.__version__)
found = []
for name, (f, x, right) in cases.items():
    series, nested = by_jet(f, x), by_jvp(f, x)
    assert np.allclose(nested, right) and np.isclose(series[0], right[0])
    found.append(f"{name}: {' '.join(f'{v:.4g}' for v in series)}, by jvp {' '.join(f'{v:.4g}' for v in nested)}")
    assert np.isnan(series[1:]).all(), f"derivatives of {name} are numbers"
print("; ".join(found))
assert np.allclose(by_jet(lambda x: x**3, -2.0), [-8.0, 12.0, -12.0])
assert np.allclose(by_jet(angle, 0.1), by_jvp(angle, 0.1))
PY
