#!/usr/bin/env bash
# CasADi 3.8.2: an interpolant by B-splines is 0 outside of its grid, with derivative 0; a linear one goes on.
#
# Both kinds of interpolant take the same grid and values. One would expect both to continue the last piece, as the
# linear one and SciPy 1.17.1 do, or to hold the last value, or NaN. The B-spline jumps to 0 there without a message: a
# table of a cam or of torques read one rounding error past its last point gives 0, and an optimizer sees a slope of 0.
# Output seen at 1.001 for x^2 + 1 on [0, 1]: "linear 2.002, bspline 0, SciPy 2.002; slope of the bspline 0". Exits with
# 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "casadi==3.8.2" "scipy==1.17.1" numpy
"$folder/venv/bin/python" - <<'PY'
import casadi
import numpy as np
import scipy
from scipy.interpolate import make_interp_spline

grid = np.linspace(0.0, 1.0, 6)
values = grid**2 + 1.0
x = casadi.MX.sym("x")


def of_casadi(kind, at):
    table = casadi.interpolant("table", kind, [grid], values)
    both = casadi.Function("both", [x], [table(x), casadi.jacobian(table(x), x)])
    return [float(number) for number in both(at)]


linear, spline = of_casadi("linear", 1.001), of_casadi("bspline", 1.001)
of_scipy = float(make_interp_spline(grid, values)(1.001))
print("casadi", casadi.__version__, "scipy", scipy.__version__)
print(f"linear {linear[0]:.4g}, bspline {spline[0]:.4g}, SciPy {of_scipy:.4g}; slope of the bspline {spline[1]:.4g}")
assert np.allclose(of_casadi("bspline", 0.999), [0.999**2 + 1.0, 2 * 0.999])
assert abs(linear[0] - 2.002) < 1e-3 and abs(of_scipy - (1.001**2 + 1.0)) < 1e-9
assert spline == of_casadi("bspline", -1e-12) == [0.0, 0.0], "the B-spline goes on now"
PY
