#!/usr/bin/env bash
# ndcurves 2.3.0: the acceleration of exact_cubic jumps at knots that are not evenly spaced.
#
# exact_cubic(points, instants) is a cubic spline through points at given instants. One would expect what a cubic spline
# is: continuous to the acceleration, at any spacing. It is so where all intervals are equal. Where a knot lies between
# intervals of different length, position and velocity are continuous and the acceleration jumps, by many times the
# values beside it; jerk and torque of a robot are then infinite there. There is no message. Output seen for one
# coordinate through 0 1 3 4 2: "at 0 1 2 3 4 s: jumps of the acceleration 0.0 0.0 0.0; at 0 1 2 4 5 s: 0.0 27.0 -36.0,
# of the velocity 0.0 0.0 0.0", and a spline of SciPy has none. Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "ndcurves==2.3.0" numpy scipy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import ndcurves
import numpy as np
from scipy.interpolate import CubicSpline

POINTS = np.array([[0.0, 1.0, 3.0, 4.0, 2.0]])
NEAR = 1e-9


def jumps(instants, order):
    spline = ndcurves.exact_cubic(POINTS, np.array(instants, float))
    reached = [float(np.ravel(spline(t))[0]) for t in instants]
    assert np.allclose(reached, POINTS[0]), "the spline does not go through its points"
    return [
        float(np.ravel(spline.derivate(t + NEAR, order) - spline.derivate(t - NEAR, order))[0]) for t in instants[1:-1]
    ]


def words(values):
    return " ".join(f"{round(x, 5) + 0.0:.1f}" for x in values)


EVEN, UNEVEN = [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 2.0, 4.0, 5.0]
print("ndcurves", importlib.metadata.version("ndcurves"))
print(f"at 0 1 2 3 4 s: jumps of the acceleration {words(jumps(EVEN, 2))};", end=" ")
print(f"at 0 1 2 4 5 s: {words(jumps(UNEVEN, 2))}, of the velocity {words(jumps(UNEVEN, 1))}")
peer = CubicSpline(UNEVEN, POINTS[0], bc_type="natural")
assert max(abs(peer(t + NEAR, 2) - peer(t - NEAR, 2)) for t in UNEVEN[1:-1]) < 1e-6
assert np.allclose(jumps(EVEN, 2), 0.0, atol=1e-5), "even knots have jumps now"
assert np.allclose(jumps(UNEVEN, 1), 0.0, atol=1e-5), "velocities jump now"
assert np.allclose(jumps(UNEVEN, 2), [0.0, 27.0, -36.0], atol=1e-4), "accelerations are continuous now"
PY
