#!/usr/bin/env bash
# Exudyn 1.13.6: TExpSE3Inv is not the inverse of TExpSE3; at 0.02 rad it has entries of 2450 for 0.0017.
#
# lieGroupBasics has the exponential of SE(3), and its tangent operator and the inverse of that, by which integrators on
# Lie groups relate twists and the rates of a screw vector. One would expect the product of the two to be the identity,
# and the operator to be the derivative of the exponential. The coupling of rotation and translation is another one in
# the inverse for all rotations above 0.01 rad; below, a series is used, which is right. The operator itself is wrong
# where the screw moves along its axis, by 0.11 for 1 m and 2 rad about z. The operators of SO(3), and ExpSE3, are
# right. There is no message. Output seen: "0.009 rad: product I + 1e-14; 0.02 rad: I + 2450, entry -2450, right
# 0.001667; 1 m along and 2 rad about z: TExpSE3 is 0.110 from the derivative of ExpSE3". Exits with 1 if that is no
# longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "exudyn==1.13.6" numpy
cd "$folder"
"$folder/venv/bin/python" -W ignore - <<'PY'
import exudyn
import numpy as np
from exudyn.lieGroupBasics import ExpSE3, TExpSE3, TExpSE3Inv, TExpSO3, TExpSO3Inv

STEP = 1e-5


def derivative(screw):
    """The twist along the axes of the body, as columns, by each component of a screw vector."""
    columns = []
    for change in np.eye(6) * STEP:
        rate = (ExpSE3(screw + change) - ExpSE3(screw - change)) / (2 * STEP)
        twist = np.linalg.inv(ExpSE3(screw)) @ rate
        columns.append([*twist[:3, 3], twist[2, 1], twist[0, 2], twist[1, 0]])
    return np.array(columns).T


def product_error(screw):
    return np.abs(TExpSE3(screw) @ TExpSE3Inv(screw) - np.eye(6)).max()


small, turned = np.array([1.0, 0, 0, 0, 0, 0.009]), np.array([1.0, 0, 0, 0, 0, 0.02])
along = np.array([0, 0, 1.0, 0, 0, 2.0])
right, entry = np.linalg.inv(derivative(turned))[0, 5], TExpSE3Inv(turned)[0, 5]
error = np.abs(TExpSE3(along) - derivative(along)).max()
print("exudyn", exudyn.__version__)
print(f"0.009 rad: product I + {product_error(small):.0e}; 0.02 rad: I + {product_error(turned):.0f},", end=" ")
print(f"entry {entry:.0f}, right {right:.4g}; 1 m along and 2 rad about z: TExpSE3 is {error:.3f} from the", end=" ")
print("derivative of ExpSE3")
assert product_error(small) < 1e-9 and np.abs(TExpSE3(turned) - derivative(turned)).max() < 1e-8
assert np.abs(TExpSO3(along[3:]) @ TExpSO3Inv(along[3:]) - np.eye(3)).max() < 1e-12
assert abs(right - 0.02 / 12) < 1e-6, "the derivative of ExpSE3 is another one"
assert product_error(turned) > 1000, "TExpSE3Inv is the inverse now"
assert error > 0.1, "TExpSE3 is the derivative of ExpSE3 now"
PY
