#!/usr/bin/env bash
# spatialmath-python 1.1.18: angdist of two UnitQuaternions is half the angle of the rotation, of the same SO3 all of
# it.
#
# UnitQuaternion and SO3 are two classes for rotations, with the same methods, and a.angdist(b) is the angle between two
# of them in radians. One would expect the same angle of both. Each has a default of its own for the measure, 3 and 6:
# that of quaternions is the angle between two points of the sphere in four dimensions, half of the angle by which one
# body must turn to stand as the other. A tolerance or an error in radians changes by a factor of two with the class.
# With no measure do quaternions give the angle itself but with the fourth. Output seen for a turn of 1 rad:
# "UnitQuaternion 0.5, SO3 1". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "spatialmath-python==1.1.18" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from spatialmath import SO3, UnitQuaternion

of_quaternions = float(UnitQuaternion.Rx(0.2).angdist(UnitQuaternion.Rx(1.2)))
of_matrices = float(SO3.Rx(0.2).angdist(SO3.Rx(1.2)))
print("spatialmath-python", importlib.metadata.version("spatialmath-python"))
print(f"UnitQuaternion {of_quaternions:.3g}, SO3 {of_matrices:.3g}")
turn = (UnitQuaternion.Rx(0.2).inv() * UnitQuaternion.Rx(1.2)).angvec()[0]
assert np.isclose(turn, 1.0) and np.isclose(of_matrices, 1.0)
assert np.isclose(UnitQuaternion.Rx(0.2).angdist(UnitQuaternion.Rx(1.2), metric=4), 1.0)
assert np.isclose(of_quaternions, 0.5), "the two agree now"
PY
