#!/usr/bin/env bash
# SciPy 1.17.1: the angular rate of RotationSpline is along the axes of the body; spatialmath 1.1.18 puts it into one
# twist with a velocity along the fixed axes.
#
# spline(t, 1) of RotationSpline is the angular rate of a motion of which spline(t) is the rotation from the body to the
# fixed axes. Its documentation names no axes. One would expect those in which the rotation gives vectors, the fixed
# ones, as angular_velocity of numpy-quaternion and to_angular_velocity of quaternionic do. The rate and the
# acceleration are along the axes that turn; for turns about one axis both are the same. InterpSplineSE3 of
# spatialmath-python takes it as it is: the velocity of its derivative(t) is along the fixed axes, the angular one along
# those of the body. There is no message. Output seen for a turn of a body that lies on its side, about the vertical:
# "RotationSpline 0 1 0, vertical 0 0 1; InterpSplineSE3 velocity 0 0 3, angular 0 1 0". Exits with 1 if that is no
# longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "scipy==1.17.1" "spatialmath-python==1.1.18" numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import scipy
from scipy.spatial.transform import Rotation, RotationSpline
from spatialmath import SE3
from spatialmath.spline import InterpSplineSE3

times = np.linspace(0.0, 1.0, 11)
on_its_side = Rotation.from_rotvec([np.pi / 2, 0.0, 0.0])
turns = Rotation.from_rotvec(np.outer(times, [0.0, 0.0, 1.0])) * on_its_side
spline = RotationSpline(times, turns)
rate = spline(0.5, 1)
step = 1e-5
vertical = (spline(0.5 + step) * spline(0.5 - step).inv()).as_rotvec() / (2 * step)
poses = [SE3.Rt(turn.as_matrix(), [0.0, 0.0, 3.0 * t]) for t, turn in zip(times, turns, strict=True)]
twist = InterpSplineSE3(times, poses).derivative(0.5)
texts = [" ".join(f"{x:g}" for x in np.round(v, 6) + 0.0) for v in (rate, vertical, twist.v, twist.w)]
print("scipy", scipy.__version__)
print("RotationSpline {}, vertical {}; InterpSplineSE3 velocity {}, angular {}".format(*texts))
assert np.allclose(vertical, [0, 0, 1], atol=1e-6) and np.allclose(spline(0.5).apply(rate), vertical, atol=1e-6)
assert np.allclose(rate, [0, 1, 0], atol=1e-6), "the rate is along the fixed axes now"
assert np.allclose(twist.v, [0, 0, 3], atol=1e-6) and np.allclose(twist.w, [0, 1, 0], atol=1e-6), "one kind of axes now"
PY
