#!/usr/bin/env bash
# Exudyn 1.13.6: RotationVector2G does not give the angular velocity, except about the rotation vector itself.
#
# rigidBodyUtilities has such matrices for Euler parameters, for angles about x, y, z, and for rotation vectors, each
# the derivative of the angular velocity by the rates of the parameters. One would expect the matrix times the rates to
# be the angular velocity for all three. For rotation vectors the global matrix is the rotation matrix, and the local
# one the identity: right at zero, and with an error that grows with the angle. There is no message. Output seen:
# "angles: error 0.0000; Euler parameters: error 0.0000; rotation vector of 0.911 rad: error 0.1900 rad/s of 0.7483,
# local 0.1900". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "exudyn==1.13.6" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import exudyn.rigidBodyUtilities as utilities
import numpy as np

vector, rates = np.array([0.3, -0.5, 0.7]), np.array([0.2, 0.4, -0.6])
parameters = np.array([0.8, 0.1, -0.3, 0.2])
parameters /= np.linalg.norm(parameters)
of_parameters = np.array([0.2, 0.4, -0.6, 0.1])
of_parameters -= parameters * (parameters @ of_parameters)


def errors(name, state, rate, step=1e-6):
    to_matrix = getattr(utilities, name + "2RotationMatrix")
    slope = (to_matrix(state + step * rate) - to_matrix(state - step * rate)) / (2 * step)
    skew = {"G": slope @ to_matrix(state).T, "GLocal": to_matrix(state).T @ slope}
    right = {kind: np.array([s[2, 1], s[0, 2], s[1, 0]]) for kind, s in skew.items()}
    return [np.linalg.norm(getattr(utilities, f"{name}2{kind}")(state) @ rate - right[kind]) for kind in right]


print("Exudyn", importlib.metadata.version("exudyn"))
angles, euler = errors("RotXYZ", vector, rates), errors("EulerParameters", parameters, of_parameters)
turn = errors("RotationVector", vector, rates)
print(
    f"angles: error {max(angles):.4f}; Euler parameters: error {max(euler):.4f}; rotation vector of "
    f"{np.linalg.norm(vector):.3f} rad: error {turn[0]:.4f} rad/s of {np.linalg.norm(rates):.4f}, local {turn[1]:.4f}"
)
assert max(*angles, *euler) < 1e-8, "the matrices of angles or Euler parameters are not right"
assert min(turn) > 0.1, "the matrices of rotation vectors are right now"
assert np.allclose(utilities.RotationVector2GLocal(vector), np.eye(3))
PY
