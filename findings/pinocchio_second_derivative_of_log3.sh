#!/usr/bin/env bash
# Pinocchio 4.1.0: Hlog3 is by turns about fixed axes, Jlog3 by turns about the axes of the body.
#
# Jlog3(R) is the derivative of the rotation vector log3(R), and Hlog3(R, v) "v^T times the Hessian". One would expect
# both of the same small turns, so that v^T log3 has the gradient Jlog3^T v and the Hessian Hlog3, as Newton's method
# for an orientation needs. Jlog3 is by turns about the axes of the body, log3(R exp3(d)), and Hlog3 by turns about the
# fixed axes, log3(exp3(d) R). There is no message, and the docstrings do not say so. Output seen for a turn of (0.3,
# -0.8, 0.5) and v = (1, 2, 3), relative to the right numbers: "Jlog3: error 0.0e+00 by the body, 9.8e-01 by fixed axes;
# Hlog3: 7.2e-01 by the body, 0.0e+00 by fixed axes". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "numpy<3"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
import pinocchio as pin

ROTATION, WEIGHT, STEP = pin.exp3(np.array([0.3, -0.8, 0.5])), np.array([1.0, 2.0, 3.0]), 1e-4
AXES = STEP * np.eye(3)


def by_the_body(turn):
    return WEIGHT @ pin.log3(ROTATION @ pin.exp3(turn))


def by_fixed_axes(turn):
    return WEIGHT @ pin.log3(pin.exp3(turn) @ ROTATION)


def gradient(function):
    return np.array([function(a) - function(-a) for a in AXES]) / (2 * STEP)


def hessian(function):
    return np.array(
        [[function(a + b) - function(a - b) - function(b - a) + function(-a - b) for a in AXES] for b in AXES]
    ) / (4 * STEP**2)


def error(found, right):
    return round(np.abs(found - right).max() / np.abs(right).max(), 4)


first = pin.Jlog3(ROTATION).T @ WEIGHT
second = pin.Hlog3(ROTATION, WEIGHT)
second = (second + second.T) / 2
functions = by_the_body, by_fixed_axes
errors = [error(first, gradient(f)) for f in functions] + [error(second, hessian(f)) for f in functions]
print("pin", importlib.metadata.version("pin"))
print("Jlog3: error {:.1e} by the body, {:.1e} by fixed axes;".format(*errors[:2]), end=" ")
print("Hlog3: {:.1e} by the body, {:.1e} by fixed axes".format(*errors[2:]))
assert errors[0] < 1e-3 < 0.1 < errors[1], "Jlog3 is another"
assert errors[3] < 1e-3, "Hlog3 is another"
assert errors[2] > 0.1, "Hlog3 is the derivative of Jlog3 now"
PY
