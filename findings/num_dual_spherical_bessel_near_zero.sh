#!/usr/bin/env bash
# num-dual 0.15.1: near zero, derivatives of sin(x)/x and its relatives are wrong: -0.001 for 2e-5 at x = 1e-4.
#
# Dual numbers give derivatives without differences, exact to rounding. sph_j0, sph_j1, sph_j2 are the spherical Bessel
# functions; sph_j0 is sin(x)/x, the factor of exponentials of rotations. One would expect a series near zero, as there
# is one at zero itself. The quotients are used down to rounding: each derivative loses as many digits more. At 1e-4 the
# third derivative of sph_j0 is -0.001 instead of 2e-5, the second of sph_j2 is 20.7 instead of 2/15; at 1e-8 sph_j2
# itself is -1 instead of 7e-18. At zero itself, the third derivative of sph_j1 is 0 instead of -0.2. There is no
# message. Output seen: "third derivative of sph_j0 at 1e-4: -9.766e-04, right 2.000e-05; second of sph_j2: 20.74, right
# 0.1333; sph_j2 at 1e-8: -1; third of sph_j1 at 0: 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "num-dual==0.15.1" "mpmath==1.3.0" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import mpmath
import num_dual

mpmath.mp.dps = 60


def exact(n, x, order):
    """Derivative of the spherical Bessel function j_n: its power series, term by term."""
    x = mpmath.mpf(x)
    terms = []
    for k in range(12):
        factor = mpmath.mpf(-1) ** k / (2**k * mpmath.factorial(k) * mpmath.fac2(2 * n + 2 * k + 1))
        power = n + 2 * k
        if power >= order:
            terms.append(factor * mpmath.ff(power, order) * x ** (power - order))
    return float(mpmath.fsum(terms))


def derivatives(name, x):
    return num_dual.third_derivative(lambda y: getattr(y, name)(), x)


j0, j2, tiny = derivatives("sph_j0", 1e-4), derivatives("sph_j2", 1e-4), derivatives("sph_j2", 1e-8)
zero = derivatives("sph_j1", 0.0)
print("num-dual", importlib.metadata.version("num-dual"))
print(f"third derivative of sph_j0 at 1e-4: {j0[3]:.3e}, right {exact(0, 1e-4, 3):.3e};", end=" ")
print(f"second of sph_j2: {j2[2]:.4g}, right {exact(2, 1e-4, 2):.4g};", end=" ")
print(f"sph_j2 at 1e-8: {tiny[0]:.0f}; third of sph_j1 at 0: {zero[3]:.0f}")
for n in range(3):
    for order, value in enumerate(derivatives(f"sph_j{n}", 0.5)):
        assert abs(value - exact(n, 0.5, order)) < 1e-10, "derivatives at 0.5 are wrong"
assert abs(j0[3] - exact(0, 1e-4, 3)) > 1e-4, "third derivatives of sph_j0 are right now"
assert abs(j2[2] - exact(2, 1e-4, 2)) > 1.0, "second derivatives of sph_j2 are right now"
assert tiny[0] == -1.0, "sph_j2 is right near zero now"
assert abs(exact(1, 0.0, 3) + 0.2) < 1e-15 and zero[3] == 0.0, "the third derivative of sph_j1 at zero is right now"
PY
