#!/usr/bin/env bash
# geomdl 5.4.0: knots of a B-spline that are given in seconds are rescaled to 0 to 1, and derivatives are by that number.
#
# One would expect derivatives by the parameter of the knots that were given, as in SciPy. The knots 0 to 2 s become
# 0 to 1: velocities come out twice as large, accelerations four times, jerks eight times, and instants
# after 1 are refused. There is no message where the knots are set. With normalize_kv=False they are kept. Output seen:
# "at the start: geomdl [3.0, 6.0] [0.0, -12.0] SciPy [1.5, 3.0] [0.0, -3.0]". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "geomdl==5.4.0" "scipy==1.17.1" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
from geomdl import BSpline
from scipy.interpolate import BSpline as Spline

POINTS, KNOTS = [[0.0, 0.0], [1.0, 2.0], [2.0, 2.0], [4.0, 0.0]], [0.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 2.0]


def derivatives(**options):
    curve = BSpline.Curve(**options)
    curve.degree, curve.ctrlpts, curve.knotvector = 3, POINTS, KNOTS
    return curve.knotvector, np.array(curve.derivatives(0.0, 3)[1:])


print("geomdl", importlib.metadata.version("geomdl"))
kept, found = derivatives()
own = Spline(KNOTS, np.array(POINTS), 3)
exact = np.array([own.derivative(k)(0.0) for k in (1, 2, 3)])
print("at the start: geomdl", *found[:2].tolist(), "SciPy", *exact[:2].tolist())
assert list(kept) == [0.0] * 4 + [1.0] * 4, "the knots are kept now"
assert np.allclose(found, exact * [[2], [4], [8]]), "derivatives are by another parameter now"
assert np.allclose(derivatives(normalize_kv=False)[1], exact), "normalize_kv=False means something else now"
PY
