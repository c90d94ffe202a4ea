#!/usr/bin/env bash
# splines 0.3.3: the angular velocity of a rotation spline is right only at the ends of its pieces.
#
# Rotation splines of splines.quaternion are made of slerps by De Casteljau's algorithm; evaluate(t) is a quaternion,
# and evaluate(t, 1) "the angular velocity". One would expect the angular velocity of evaluate(t), as evaluate(t, 1) of
# a spline of points is its velocity. It is a multiple of the last slerp of the algorithm, which is the velocity of a
# curve of points; for rotations that is right only at the ends of a piece, or about one axis. A CatmullRom spline has
# the same error, smaller as its pieces turn less. There is no message. Output seen for a piece that turns by 120
# degrees about z and x: "error of the angular velocity 0.0000 rad/s at the ends, up to 0.0744 between them, where it is
# 2.8; about one axis 0.0000; of a CatmullRom spline 0.0046". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "splines==0.3.3" "numpy<3" "scipy==1.17.1"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from scipy.spatial.transform import Rotation
from splines.quaternion import CatmullRom, DeCasteljau, UnitQuaternion

STEP = 1e-6
TURN, TWO_TURNS, ONE_AXIS = (120, 0, 0), (120, 0, 120), (200, 0, 0)
WAY = [(0, 0, 0), TURN, (120, 90, 0), (0, 90, 120), (-90, 0, 120)]


def quaternions(degrees):
    return [UnitQuaternion.from_unit_xyzw(q) for q in Rotation.from_euler("ZYX", degrees, degrees=True).as_quat()]


def rotation(spline, time):
    quaternion = spline.evaluate(time)
    return Rotation.from_quat([*quaternion.vector, quaternion.scalar])


def velocity(spline, time):
    """Angular velocity along the fixed axes by differences of the rotations."""
    before, after = max(time - STEP, 0), min(time + STEP, spline.grid[-1])
    return (rotation(spline, after) * rotation(spline, before).inv()).as_rotvec() / (after - before)


def largest_error(spline, times):
    """Largest error of the angular velocity, and its right value there, rad/s."""
    rates = [(t, velocity(spline, t)) for t in times]
    return max((np.linalg.norm(spline.evaluate(t, 1) - w), np.linalg.norm(w)) for t, w in rates)


piece = DeCasteljau([quaternions([(0, 0, 0), TURN, TWO_TURNS])], [0, 1])
flat = DeCasteljau([quaternions([(0, 0, 0), TURN, ONE_AXIS])], [0, 1])
long = CatmullRom(quaternions(WAY), list(range(len(WAY))))
inside = np.linspace(0.01, 0.99, 99)
ends, one_axis = largest_error(piece, [0, 1])[0], largest_error(flat, inside)[0]
between, rate = largest_error(piece, inside)
of_long = largest_error(long, np.linspace(0.01, 3.99, 399))[0]
print("splines", importlib.metadata.version("splines"))
print(f"error of the angular velocity {ends:.4f} rad/s at the ends, up to {between:.4f} between them,", end=" ")
print(f"where it is {rate:.2g}; about one axis {one_axis:.4f}; of a CatmullRom spline {of_long:.4f}")
assert ends < 1e-4 and one_axis < 1e-4, "the angular velocity is another"
assert between > 0.02 * rate and of_long > 1e-3, "the angular velocity is the rate of the rotations now"
PY
