#!/usr/bin/env bash
# daceypy 1.4.0: from order 5 on, x**-2 is not 1/x^2, not even in its constant term.
#
# DACE computes with truncated power series; daceypy is its interface for Python. One would expect the same series of
# x**-2, 1/(x*x), and the exponential of -2 log x, as up to order 4. From order 5 on, powers with an integer exponent of
# -2 or less have other coefficients, also where the exponent is a float (-2.0): attraction by an inverse square, or a
# rate by a lever squared, has the wrong size before any derivative is taken. x**-1, x**-2.5 and 1/(x*x) are right.
# There is no message. Output seen at x = 2: "order 4: 0.25, order 5: 0.484375, order 6: 0.855106; 1/(x*x): 0.25". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "daceypy==1.4.0" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from daceypy import DA


def coefficients(y, count=3):
    return [y.getCoefficient([i]) for i in range(count)]


RIGHT = [0.25, -0.25, 0.1875]  # of 1/x^2 at 2, by hand
powers = {}
for order in (4, 5, 6):
    DA.init(order, 1)
    x = 2.0 + DA(1)
    powers[order] = coefficients(x**-2)
    assert np.allclose(coefficients(x**-2.0), powers[order])
    assert np.allclose(coefficients(1 / (x * x)), RIGHT)
    assert np.allclose(coefficients((-2.0 * x.log()).exp()), RIGHT)
    assert np.allclose(coefficients(x**-1), [0.5, -0.25, 0.125])
    assert np.allclose(coefficients(x**-2.5)[:2], [2**-2.5, -2.5 * 2**-3.5])

print("daceypy", importlib.metadata.version("daceypy"))
print(", ".join(f"order {order}: {power[0]:.6g}" for order, power in powers.items()) + "; 1/(x*x): 0.25")
assert np.allclose(powers[4], RIGHT)
assert not np.isclose(powers[5][0], 0.25, rtol=0.5) and not np.isclose(powers[6][0], 0.25, rtol=0.5), "powers are right"
PY
