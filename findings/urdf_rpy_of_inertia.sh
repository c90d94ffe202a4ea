#!/usr/bin/env bash
# URDF: Klampt 0.10.1.post1 and urdf2webots 2025.0.0 turn the inertia of a link by the rpy of its <inertial> the other
# way, scikit-robot 0.4.7 not at all.
#
# One would expect I = R I' R^T with the rotation R of <origin rpy> from the frame of the inertia to that of the link,
# as in Pinocchio 4.1.0 and MuJoCo 4.0.0. Klampt takes R^T I' R, and so does urdf2webots, which writes robots for
# Webots; scikit-robot takes I'. A rod with 0.01 kg m^2 about its length and 1 kg m^2 across lies along x + y, about
# which its joint turns: yaw is 45 degrees. Its joint turns 0.01 kg m^2, and 1 kg m^2 if yaw is -45 degrees. Centers of
# mass are right. There is no message. Output seen: "yaw +45 deg: Pinocchio 0.01, MuJoCo 0.01, Klampt 1, scikit-robot
# 0.505, urdf2webots 1 kg m^2; yaw -45 deg: Pinocchio 1, MuJoCo 1, Klampt 0.01, scikit-robot 0.505, urdf2webots 0.01 kg
# m^2". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "klampt==0.10.1.post1" "scikit-robot==0.4.7" "mujoco==4.0.0" \
    "pin==4.1.0" "urdf2webots==2025.0.0" numpy
"$folder/venv/bin/python" -W ignore - "$folder" <<'PY'
import contextlib
import importlib.metadata
import io
import math
import pathlib
import re
import sys

import klampt
import mujoco
import numpy as np
import pinocchio
from skrobot.models.urdf import RobotModelFromURDF
from urdf2webots.importer import convertUrdfFile


def of_webots(path):
    """Return the matrix of inertia of the one link with a mass, as it is written for Webots."""
    proto = path.with_suffix(".proto")
    with contextlib.redirect_stdout(io.StringIO()):
        convertUrdfFile(input=str(path), output=str(proto))
    (numbers,) = re.findall(r"inertiaMatrix \[([^]]*)\]", proto.read_text())
    xx, yy, zz, xy, xz, yz = map(float, numbers.split())
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def about_axis(yaw):
    """Return the inertia about the axis of the joint, kg m^2, by each library."""
    path = pathlib.Path(sys.argv[1]) / "rod.urdf"
    along = math.sqrt(0.5)
    path.write_text(
        '<robot name="r"><link name="base"/><link name="rod"><inertial>'
        f'<origin xyz="0 0 0" rpy="0 0 {yaw}"/><mass value="1"/>'
        '<inertia ixx="0.01" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="revolute"><parent link="base"/><child link="rod"/><origin xyz="0 0 0"/>'
        f'<axis xyz="{along} {along} 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>'
    )
    found = {}
    model = pinocchio.buildModelFromUrdf(str(path))
    found["Pinocchio"] = pinocchio.crba(model, model.createData(), np.zeros(1))[0, 0]
    model = mujoco.MjModel.from_xml_path(str(path))
    data, matrix = mujoco.MjData(model), np.zeros((1, 1))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, matrix)
    found["MuJoCo"] = matrix[0, 0]
    world = klampt.WorldModel()
    assert world.loadFile(str(path)), "Klampt does not read the file any more"
    found["Klampt"] = world.robot(0).getMassMatrix()[-1][-1]
    robot, step = RobotModelFromURDF(urdf_file=str(path)), 0.005  # s; from rest, at 1 rad/s^2
    rest, moved = np.zeros(1), np.array([step**2 / 2])
    found["scikit-robot"] = robot.torque_vector(
        calc_statics_p=False, dt=step, av=rest, av_prev=moved, av_next=moved, gravity=np.zeros(3)
    )[0]
    axis = np.array([along, along, 0.0])
    found["urdf2webots"] = axis @ of_webots(path) @ axis
    return found


for name in ("pin", "mujoco", "klampt", "scikit-robot", "urdf2webots"):
    print(name, importlib.metadata.version(name))
ahead, back = (about_axis(sign * math.pi / 4) for sign in (1, -1))
for yaw, found in (("+45", ahead), ("-45", back)):
    print(f"yaw {yaw} deg:", ", ".join(f"{name} {value:.6g}" for name, value in found.items()), "kg m^2")
for found, right, other in ((ahead, 0.01, 1.0), (back, 1.0, 0.01)):
    expected = {"Pinocchio": right, "MuJoCo": right, "Klampt": other, "scikit-robot": 0.505, "urdf2webots": other}
    assert all(abs(found[name] - value) < 1e-6 for name, value in expected.items()), "a library reads it otherwise now"
PY
