#!/usr/bin/env bash
# modern_robotics 1.1.1: the logarithm of a half turn is zero for a third of all half turns that are computed.
#
# MatrixLog3 is the rotation vector of a rotation, as a matrix. A gripper that points down is a half turn, and its
# rotation, a product of the turns of the joints, is one up to rounding. One would expect pi times the axis up to
# rounding, as from SciPy 1.17.1, whichever side of pi it falls on. Only where the trace is at most -1 does MatrixLog3
# take its branch for half turns; one bit above it divides the rounding errors of R - R^T by each other, and returns
# zero or a vector of another length. MatrixLog6 takes it for no turn at all: ScrewTrajectory ends where it began, and
# IKinSpace of a single joint, asked for a half turn, reports success at angle 0. And turns below 1e-6 rad are none in
# MatrixExp3. There is no message. Output seen for 2000 products of two turns about one axis: "off by more than 1 %:
# modern_robotics 34 %, SciPy 0 %; turned by ScrewTrajectory 0.00 of 3.14 rad; IKinSpace succeeds at angle 0 for 1143;
# turn of 9e-7 rad: 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "modern_robotics==1.1.1" "scipy==1.17.1" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import modern_robotics
import numpy as np
from scipy.spatial.transform import Rotation


def turn(vector):
    return modern_robotics.MatrixExp3(modern_robotics.VecToso3(vector))


def logarithm(rotation):
    return modern_robotics.so3ToVec(modern_robotics.MatrixLog3(rotation))


random = np.random.default_rng(0)
axes = random.normal(size=(2000, 3))
axes /= np.linalg.norm(axes, axis=1)[:, None]
parts = random.uniform(-3, 3, size=2000)
turns = [turn(part * axis) @ turn((np.pi - part) * axis) for part, axis in zip(parts, axes, strict=True)]
assert max(np.abs(t @ t - np.eye(3)).max() for t in turns) < 1e-14  # half turns up to rounding
theirs = np.array([np.linalg.norm(logarithm(t)) for t in turns])
of_scipy = Rotation.from_matrix(turns).magnitude()
wrong, other = ((np.abs(lengths / np.pi - 1) > 0.01).mean() for lengths in (theirs, of_scipy))
goal = np.eye(4)
goal[:3, :3] = turns[int(np.argmin(theirs))]
end = modern_robotics.ScrewTrajectory(np.eye(4), goal, 1, 3, 5)[-1]
reached = Rotation.from_matrix(end[:3, :3]).magnitude()
stuck = 0
for axis, rotation in zip(axes, turns, strict=True):
    goal[:3, :3] = rotation
    screw = np.concatenate([axis, np.zeros(3)])[:, None]
    angle, success = modern_robotics.IKinSpace(screw, np.eye(4), goal, np.zeros(1), 1e-3, 1e-3)
    stuck += bool(success) and abs(angle[0]) < 1e-3
tiny = Rotation.from_matrix(turn(np.array([0, 0, 9e-7]))).magnitude()
print("modern_robotics", importlib.metadata.version("modern_robotics"))
print(f"off by more than 1 %: modern_robotics {100 * wrong:.0f} %, SciPy {100 * other:.0f} %; ", end="")
print(f"turned by ScrewTrajectory {reached:.2f} of 3.14 rad; IKinSpace succeeds at angle 0 for {stuck}; ", end="")
print(f"turn of 9e-7 rad: {tiny:g}")
assert other == 0.0 and np.isclose(np.linalg.norm(logarithm(turn(np.array([3.0, 0, 0])))), 3.0)
assert wrong > 0.1 and theirs.min() < 0.01 and reached < 0.01, "logarithms of half turns are right now"
assert stuck > 500, "inverse kinematics finds half turns now"
assert tiny == 0.0, "small turns count now"
PY
