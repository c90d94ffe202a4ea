#!/usr/bin/env bash
# dual_quaternions 0.4.0: the logarithm of every translation is zero, and exp is not the inverse of log.
#
# log of a unit dual quaternion is documented as half of the screw of a displacement, angle and way along its axis, and
# exp as the way back. One would expect exp(d.log()) to be d, and log of a translation to be half of the translation. The
# part of log that belongs to translations is (q_d q_r* - q_r* q_d) / 2, which is zero for a translation and for a screw
# along its axis, and wrong elsewhere; exp is not the exponential for slanted axes either. Velocities from logarithms of
# steps lack their linear part. screw, pow, sqrt and sclerp are right. There is no message. Output seen: "translation 1 2
# 3: log 0 0 0, half 0.5 1 1.5; exp(log) of a screw off by 1.56, pow(0.5) squared by 3e-15". Exits with 1 if that is no
# longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "dual_quaternions==0.4.0" numpy scipy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from dual_quaternions import DualQuaternion
from scipy.spatial.transform import Rotation


def displacement(turn, way):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), way
    return DualQuaternion.from_homogeneous_matrix(matrix)


def off(first, second):
    return np.abs(first.homogeneous_matrix() - second.homogeneous_matrix()).max()


print("dual_quaternions", importlib.metadata.version("dual_quaternions"))
straight = np.array(displacement([0, 0, 0], [1, 2, 3]).log().dq_array(), float)
print("translation 1 2 3: log", straight[5:], "half", [0.5, 1, 1.5])
screw = displacement([0.2, 0.3, 0.8], [1, 2, 0])
returned = off(DualQuaternion.exp(screw.log()), screw)
halves = off(screw.pow(0.5) * screw.pow(0.5), screw)
print(f"exp(log) of a screw off by {returned:.3g}, pow(0.5) squared by {halves:.2g}")
assert not straight.any(), "the logarithm of a translation is not zero now"
assert returned > 0.5, "exp is the inverse of log now"
assert halves < 1e-12
turn = displacement([0, 0, 0.8], [0, 0, 0])
assert off(DualQuaternion.exp(turn.log()), turn) < 1e-12
PY
