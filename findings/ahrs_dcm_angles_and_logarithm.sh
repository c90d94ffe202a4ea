#!/usr/bin/env bash
# AHRS 0.4.0: DCM.to_rpy is not the inverse of DCM(rpy=...), and DCM.log is the logarithm of the inverse rotation.
#
# DCM(rpy=v) makes a matrix of three angles, and to_rpy and to_angles give three angles of a matrix. One would expect v
# again, perhaps in the other order. They are the angles of the transposed matrix: all three numbers differ, and two
# signs. Quaternion of the same package gives the angles rightly. The logarithm, by its documentation the inverse of the
# exponential, has the other sign: its exponential is the transposed matrix. And utils.angular_distance is the norm of
# that matrix, the square root of 2 times the angle; its documentation has the angle. There is no message. Output seen
# for the angles 0.3 0.5 0.7: "to_rpy -0.647 -0.571 0.082, by Quaternion 0.7 0.5 0.3; log of 0.3 rad about z: -0.3,
# angular distance 0.424". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "ahrs==0.4.0" numpy scipy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from ahrs import DCM, Quaternion
from ahrs.utils import angular_distance
from scipy.linalg import expm

ANGLES = np.array([0.3, 0.5, 0.7])
matrix = DCM(rpy=ANGLES)
made = np.asarray(matrix)
about = [np.asarray(DCM(**{axis: angle})) for axis, angle in zip("zyx", ANGLES, strict=True)]
assert np.allclose(made, about[0] @ about[1] @ about[2]), "rpy means another sequence now"
given, right = np.asarray(matrix.to_rpy()), np.asarray(Quaternion(dcm=made).to_angles())
logarithm = np.asarray(DCM(z=0.3).log)
print("AHRS", importlib.metadata.version("ahrs"))
print("to_rpy {:.3f} {:.3f} {:.3f},".format(*given), "by Quaternion {:.3g} {:.3g} {:.3g};".format(*right), end=" ")
distance = angular_distance(np.asarray(DCM(z=0.3)), np.eye(3))
print(f"log of 0.3 rad about z: {logarithm[1, 0]:.3g}, angular distance {distance:.3f}")
assert np.allclose(right, ANGLES[::-1]) and np.allclose(given, matrix.to_angles())
assert np.allclose(np.asarray(DCM(rpy=given[::-1])), made.T), "the angles are not those of the transposed matrix now"
assert abs(np.asarray(DCM(rpy=given[::-1])) - made).max() > 0.5, "the angles make the matrix again now"
assert np.allclose(expm(np.asarray(matrix.log)), made.T), "the logarithm has its sign now"
assert np.isclose(distance, 0.3 * np.sqrt(2)), "the angular distance is the angle now"
PY
