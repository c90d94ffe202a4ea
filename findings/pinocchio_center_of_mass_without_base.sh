#!/usr/bin/env bash
# Pinocchio 4.1.0: the center of mass of a fixed robot leaves its base out, and so does the total mass.
#
# centerOfMass and computeTotalMass take the model of a URDF, whose base has a mass as the other links have. One would
# expect the mass of the file and its center, as iDynTree 15.1.0 and MuJoCo 4.0.0 give them. What is fixed to the world
# does not count in Pinocchio, neither the base nor what is fixed to it, without a message; with a free base it does:
# the same file at the same place has another mass and another center. Output seen for a base of 10 kg at 1 m and an arm
# of 1 kg at 0: "fixed: 1 kg at 0 m, free: 11 kg at 0.909 m; iDynTree 11 kg at 0.909 m, MuJoCo 11 kg at 0.909 m". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "mujoco==4.0.0" "idyntree==15.1.0" numpy
"$folder/venv/bin/python" - <<'PY'
import mujoco
import numpy as np
import idyntree.bindings as idyntree
import pinocchio

INERTIA = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
TEXT = (
    '<robot name="r"><mujoco><compiler fusestatic="false"/></mujoco><link name="base"><inertial><origin xyz="1 0 0"/>'
    f'<mass value="10"/>{INERTIA}<link name="arm"><inertial><mass value="1"/>{INERTIA}'
    '<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint></robot>'
)


def of_pinocchio(*root):
    model = pinocchio.buildModelFromXML(TEXT, *root)
    data = model.createData()
    center = pinocchio.centerOfMass(model, data, pinocchio.neutral(model))
    assert data.mass[0] == pinocchio.computeTotalMass(model)
    return data.mass[0], center[0]


loader = idyntree.ModelLoader()
assert loader.loadModelFromString(TEXT)
computed = idyntree.KinDynComputations()
computed.loadRobotModel(loader.model())
computed.setRobotState([0.0], [0.0], [0.0, 0.0, -9.81])
theirs = mujoco.MjModel.from_xml_string(TEXT)
data = mujoco.MjData(theirs)
mujoco.mj_forward(theirs, data)
found = {
    "fixed": of_pinocchio(),
    "free": of_pinocchio(pinocchio.JointModelFreeFlyer()),
    "iDynTree": (loader.model().getTotalMass(), computed.getCenterOfMassPosition().toNumPy()[0]),
    "MuJoCo": (theirs.body_subtreemass[0], data.subtree_com[0, 0]),
}
print("pinocchio", pinocchio.__version__, "mujoco", mujoco.__version__)
print(", ".join("{} {:.3g} kg at {:.3g} m".format(name, *pair) for name, pair in found.items()))
assert np.allclose([found[name] for name in ("free", "iDynTree", "MuJoCo")], [11.0, 10.0 / 11.0])
assert np.allclose(found["fixed"], [1.0, 0.0]), "the base counts now"
PY
