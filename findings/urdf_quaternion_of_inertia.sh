#!/usr/bin/env bash
# URDF 1.1: the quaternion of an <origin> turns an inertia in Pinocchio 4.1.0, and not in MuJoCo 4.0.0 and Drake 1.51.1.
#
# The reference parser, urdfdom, reads quat_xyzw from version 1.1 of the format on, and Pinocchio uses it. MuJoCo and
# Drake leave the attribute out, whatever the version, and take the identity: the same file has other moments of inertia
# there. MuJoCo says nothing; Drake says that it ignores the version, and nothing of the quaternion. Output seen: "torque for 1 rad/s^2: Pinocchio 0.1, MuJoCo 0.2, Drake 0.2" for moments of
# 0.1, 0.2, 0.25 kg m^2 about x, y, z that the quaternion turns by 90 degrees about z, and a joint about y. Exits with 1
# if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "mujoco==4.0.0" "drake==1.51.1" numpy
"$folder/venv/bin/python" - "$folder" <<'PY'
import pathlib
import sys

import mujoco
import numpy as np
import pinocchio
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

path = str(pathlib.Path(sys.argv[1]) / "turned.urdf")
turned = 'quat_xyzw="0 0 0.7071067811865476 0.7071067811865476"'
pathlib.Path(path).write_text(
    f'<robot name="r" version="1.1"><link name="base"/><link name="l"><inertial><origin xyz="0 0 0" {turned}/>'
    '<mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="j" type="continuous"><parent link="base"/><child link="l"/><axis xyz="0 1 0"/></joint></robot>'
)
model = pinocchio.buildModelFromUrdf(path)
ours = pinocchio.rnea(model, model.createData(), pinocchio.neutral(model), np.zeros(1), np.ones(1))[0]
theirs = mujoco.MjModel.from_xml_path(path)
data = mujoco.MjData(theirs)
data.qacc[:] = 1.0
mujoco.mj_inverse(theirs, data)
plant = MultibodyPlant(0.0)
Parser(plant).AddModels(path)
plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
plant.Finalize()
drake = plant.CalcInverseDynamics(plant.CreateDefaultContext(), np.ones(1), MultibodyForces(plant))[0]
found = [round(float(x), 12) for x in (ours, data.qfrc_inverse[0], drake)]
print("torque for 1 rad/s^2: Pinocchio {:g}, MuJoCo {:g}, Drake {:g}".format(*found))
assert found == [0.1, 0.2, 0.2], "they agree now"
PY
