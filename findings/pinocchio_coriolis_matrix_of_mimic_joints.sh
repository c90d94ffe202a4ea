#!/usr/bin/env bash
# Pinocchio 4.1.0: computeCoriolisMatrix is wrong for a model with a mimic joint, which its neighbors refuse.
#
# buildModelFromUrdf(..., mimic=True) makes joints that follow others without a coordinate of their own. rnea, crba and
# nonLinearEffects are right for them; aba, computeMinverse and computeRNEADerivatives refuse the model ("This algorithm
# does not support Joint Mimic type"). One would expect computeCoriolisMatrix to do one or the other. It returns a
# matrix whose product with the velocities is not the Coriolis torque, without a message; that of the same arm with a
# free joint in place of the mimic is right. Output seen for an arm of three joints, the third of which follows the
# first: "torques off by: without mimic 0, mimic 1.3; computeMinverse refuses mimic". Exits with 1 if that is no longer
# so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import pinocchio

INERTIAL = (
    '<inertial><origin xyz="0.3 0.1 0"/><mass value="2"/>'
    '<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def joint(name, parent, axis, more=""):
    return (
        f'<link name="{name}_link">{INERTIAL}</link><joint name="{name}" type="revolute"><parent link="{parent}"/>'
        f'<child link="{name}_link"/><origin xyz="0.5 0 0"/><axis xyz="{axis}"/>'
        f'<limit lower="-3" upper="3" effort="9" velocity="9"/>{more}</joint>'
    )


text = '<robot name="r"><link name="base"/>' + joint("a", "base", "0 0 1") + joint("b", "a_link", "0 1 0")
text += joint("c", "b_link", "0 0 1", '<mimic joint="a" multiplier="2" offset="0.1"/>') + "</robot>"


def off(mimic):
    model = pinocchio.buildModelFromXML(text, mimic=mimic)
    data = model.createData()
    q, v = np.array([0.4, 0.7, 0.9])[: model.nq], np.array([1.0, 2.0, 2.0])[: model.nv]
    torques = pinocchio.nonLinearEffects(model, data, q, v) - pinocchio.computeGeneralizedGravity(model, data, q)
    matrix = pinocchio.computeCoriolisMatrix(model, data, q, v)
    return model, data, q, np.abs(matrix @ v - torques).max()


free, (model, data, q, wrong) = off(False)[3], off(True)
try:
    pinocchio.computeMinverse(model, data, q)
    refused = False
except RuntimeError:
    refused = True
print("pinocchio", pinocchio.__version__)
print(f"torques off by: without mimic {free:.0f}, mimic {wrong:.2g}; ", end="")
print("computeMinverse refuses mimic" if refused else "computeMinverse takes mimic")
assert model.nv == 2 and free < 1e-12 and refused
assert wrong > 0.01, "the Coriolis matrix is right now"
PY
