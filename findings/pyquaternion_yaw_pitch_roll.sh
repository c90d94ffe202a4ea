#!/usr/bin/env bash
# pyquaternion 0.9.9: yaw_pitch_roll are the angles of the sequence x-y'-z'', not of z-y'-x''.
#
# By its documentation yaw_pitch_roll follows the convention z-y'-x'', the one of vehicles. One would expect the three
# angles from which a quaternion was made by a turn about z, then about the new y, then about the new x. They are those
# of the reversed sequence, roll first, which the matrix product in the same documentation says, too. Angles about one
# axis alone are right, so that simple checks pass. Output seen for yaw 0.3, pitch 0.5, roll 0.7: "yaw_pitch_roll -0.082
# 0.571 0.647, SciPy ZYX 0.300 0.500 0.700, XYZ reversed -0.082 0.571 0.647". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pyquaternion==0.9.9" numpy scipy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from pyquaternion import Quaternion
from scipy.spatial.transform import Rotation

YAW, PITCH, ROLL = 0.3, 0.5, 0.7
quaternion = (
    Quaternion(axis=[0, 0, 1], radians=YAW)
    * Quaternion(axis=[0, 1, 0], radians=PITCH)
    * Quaternion(axis=[1, 0, 0], radians=ROLL)
)
found = np.array(quaternion.yaw_pitch_roll)
matrix = Rotation.from_matrix(quaternion.rotation_matrix)
of_zyx, of_xyz = matrix.as_euler("ZYX"), matrix.as_euler("XYZ")[::-1]
print("pyquaternion", importlib.metadata.version("pyquaternion"))
for name, angles in {"yaw_pitch_roll": found, ", SciPy ZYX": of_zyx, ", XYZ reversed": of_xyz}.items():
    print(name, "{:.3f} {:.3f} {:.3f}".format(*angles), end="")
print()
assert np.allclose(of_zyx, [YAW, PITCH, ROLL])
assert np.allclose(found, of_xyz) and not np.allclose(found, of_zyx, atol=0.1), "the sequence is z-y'-x'' now"
for axis, place in ((2, 0), (1, 1), (0, 2)):
    assert np.isclose(Quaternion(axis=np.eye(3)[axis], radians=0.4).yaw_pitch_roll[place], 0.4)
PY
