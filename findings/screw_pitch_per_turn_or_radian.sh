#!/usr/bin/env bash
# The pitch of a screw joint is per turn in Drake 1.51.1 and DART (dartpy 6.20.0), per radian in Pinocchio 4.1.0.
#
# All three have a joint that turns about an axis and advances along it by its pitch. One would expect the pitch of a
# thread everywhere, the advance of one turn, or the documentation to say otherwise. JointModelHX, JointModelHY,
# JointModelHZ and JointModelHelicalUnaligned of Pinocchio advance by the pitch in one radian, "pitch value" by their
# documentation: a spindle of 10 mm advances by 62.8 mm a turn, and the force that holds it is 6.28 times too small.
# Output seen after one turn with a pitch of 0.01: "Drake 0.01 m, DART 0.01 m, Pinocchio 0.0628 m". Exits with 1 if that
# is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "drake==1.51.1" "dartpy==6.20.0" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import dartpy
import numpy as np
import pinocchio as pin
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ScrewJoint, SpatialInertia

PITCH, TURN, UP = 0.01, 2 * np.pi, np.array([0.0, 0.0, 1.0])

model = pin.Model()
model.addJoint(0, pin.JointModelHZ(PITCH), pin.SE3.Identity(), "screw")
data = model.createData()
pin.forwardKinematics(model, data, np.array([TURN]))
of_pinocchio = data.oMi[1].translation[2]

plant = MultibodyPlant(0.0)
nut = plant.AddRigidBody("nut", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
world = plant.world_frame()
screw = plant.AddJoint(ScrewJoint("screw", world, nut.body_frame(), UP, PITCH, 0.0))
plant.Finalize()
context = plant.CreateDefaultContext()
plant.SetPositions(context, [TURN])
of_drake = plant.EvalBodyPoseInWorld(context, nut).translation()[2]

skeleton = dartpy.dynamics.Skeleton()
joint, body = skeleton.createScrewJointAndBodyNodePair()
joint.setAxis(UP)
joint.setPitch(PITCH)
skeleton.setPositions([TURN])
of_dart = body.getTransform().translation()[2]

print("pin", pin.__version__, *(f"{name} {importlib.metadata.version(name)}" for name in ("drake", "dartpy")))
print(f"Drake {of_drake:.3g} m, DART {of_dart:.3g} m, Pinocchio {of_pinocchio:.3g} m")
assert np.allclose([of_drake, of_dart], PITCH)
assert np.isclose(of_pinocchio, TURN * PITCH), "it is per turn now"
PY
