#!/usr/bin/env bash
# Pinocchio 4.1.0, MuJoCo 4.0.0, Drake 1.51.1 and PyBullet 3.2.7 give the reaction in one joint of one URDF as four
# different vectors: other order, axes and point, and one without the torque of the motor.
#
# A rod of 2 kg, 0.3 m from the second joint of an arm, held still at 0.5 rad by its motor. What the
# parent exerts on the child is 19.62 N upward, at the joint. Output seen: Pinocchio data.f, force then moment, axes and
# point of the joint, on the child; MuJoCo cfrc_int, moment then force, axes of the world, about the center of mass of
# the whole tree, on the child, and filled by mj_rnePostConstraint alone, not by mj_forward; Drake's reaction forces,
# rotational then translational, axes and point of the child's frame of the joint, on the child; PyBullet, force then
# moment, axes of the link, about its center of mass, on the child, WITHOUT the torque of the motor, which the three
# others include. Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "mujoco==4.0.0" "drake==1.51.1" "pybullet==3.2.7" numpy
"$folder/venv/bin/python" - "$folder" <<'PY'
import pathlib
import sys

import mujoco
import numpy as np
import pinocchio
import pybullet
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

ANGLE, MASS, ARM = 0.5, 2.0, np.array([0.3, 0.05, -0.02])
path = pathlib.Path(sys.argv[1]) / "rod.urdf"
path.write_text(
    '<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="i" type="revolute">'
    '<parent link="base"/><child link="arm"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="99" velocity="9"/>'
    '</joint><link name="rod"><inertial><origin xyz="0.3 0.05 -0.02"/><mass value="2"/>'
    '<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="j" type="revolute"><parent link="arm"/><child link="rod"/><origin xyz="0.1 0.2 1" rpy="0 0 0.7"/>'
    '<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="99" velocity="9"/></joint></robot>'
)
c, s, cy, sy = np.cos(ANGLE), np.sin(ANGLE), np.cos(0.7), np.sin(0.7)
turn = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
force = np.array([0.0, 0.0, MASS * 9.81])  # of the parent on the child, along the axes of the world
moment = np.cross(turn @ ARM, force)  # about the joint, which balances the weight
torque = float((turn @ [0, 1, 0]) @ moment)


def compare(name, found, force, moment):
    expected = np.concatenate([force, moment])
    print(f"{name}: {np.round(found, 4)}")
    assert np.abs(found - expected).max() < 1e-6, (name, found, expected)


model = pinocchio.buildModelFromUrdf(str(path))
data = model.createData()
pinocchio.rnea(model, data, np.array([0.0, ANGLE]), np.zeros(2), np.zeros(2))
compare("Pinocchio, force and moment", data.f[2].vector, turn.T @ force, turn.T @ moment)

theirs = mujoco.MjModel.from_xml_path(str(path))
state = mujoco.MjData(theirs)
state.qpos[1], state.qfrc_applied[1] = ANGLE, torque
mujoco.mj_forward(theirs, state)
assert not state.cfrc_int.any(), "MuJoCo fills cfrc_int in mj_forward now"
mujoco.mj_rnePostConstraint(theirs, state)
joint = np.array([0.1, 0.2, 1.0])
center = state.subtree_com[1]
print("MuJoCo: point of cfrc_int", np.round(center, 4), "joint", joint)
about = moment + np.cross(joint - center, force)
compare("MuJoCo, moment and force", state.cfrc_int[-1], about, force)

plant = MultibodyPlant(0.0)
Parser(plant).AddModels(str(path))
plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
plant.Finalize()
context = plant.CreateDefaultContext()
plant.SetPositions(context, [0.0, ANGLE])
plant.get_applied_generalized_force_input_port().FixValue(context, [0.0, torque])
reaction = plant.get_reaction_forces_output_port().Eval(context)[int(plant.GetJointByName("j").index())]
found = np.concatenate([reaction.rotational(), reaction.translational()])
compare("Drake, moment and force", found, turn.T @ moment, turn.T @ force)

pybullet.connect(pybullet.DIRECT)
pybullet.setGravity(0, 0, -9.81)
body = pybullet.loadURDF(str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
pybullet.enableJointForceTorqueSensor(body, 1)
for joint, angle in enumerate((0.0, ANGLE)):
    pybullet.resetJointState(body, joint, angle)
    pybullet.setJointMotorControl2(body, joint, pybullet.POSITION_CONTROL, targetPosition=angle, force=99)
for _ in range(5):
    pybullet.stepSimulation()
found = np.array(pybullet.getJointState(body, 1)[2])
rest = turn.T @ (moment - np.cross(turn @ ARM, force)) - [0, torque, 0]  # about the center of mass, without the motor's
print(f"PyBullet, force and moment: {np.round(found, 3)}")
assert np.abs(found - np.concatenate([turn.T @ force, rest])).max() < 1e-2
PY
