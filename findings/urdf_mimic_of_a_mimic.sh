#!/usr/bin/env bash
# URDF: a joint that follows a follower stays where it is in urchin 0.0.30, compas_robots 1.0.1 and yourdfpy 0.0.60;
# pytransform3d 3.17.0 has no joint follow another.
#
# <mimic> names any joint of the robot, also one that has a <mimic> itself, as the last phalanx of a finger. One would
# expect 2 (3 * 0.5 + 0.1) + 0.01 = 3.21 m for a slide with multiplier 2 and offset 0.01 that follows one with 3 and 0.1
# that follows a joint at 0.5; the ties of MuJoCo 4.0.0 hold there. urchin and compas_robots leave the slide at 0,
# without its offset and without a message; yourdfpy leaves it at its offset, and says so. pytransform3d leaves the first
# follower at 0, too, without a message. Output seen: "urchin 1.6 0, compas_robots 1.6 0, yourdfpy 1.6 0.01, pytransform3d 0 0; ties
# of MuJoCo at 1.6 3.21 off by 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "urchin==0.0.30" "compas_robots==1.0.1" "yourdfpy==0.0.60" \
    "pytransform3d==3.17.0" "mujoco==4.0.0" lxml numpy
"$folder/venv/bin/python" -W ignore - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import mujoco
import numpy as np
import urchin
import yourdfpy
from compas_robots import RobotModel
from pytransform3d.urdf import UrdfTransformManager

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def slide(name, more=""):
    return (
        f'<link name="{name}">{INERTIAL}</link><joint name="to_{name}" type="prismatic"><parent link="base"/>'
        f'<child link="{name}"/><axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="9" velocity="9"/>{more}</joint>'
    )


text = '<robot name="r"><link name="base"/>' + slide("a")
text += slide("b", '<mimic joint="to_a" multiplier="3" offset="0.1"/>')
text += slide("c", '<mimic joint="to_b" multiplier="2" offset="0.01"/>') + "</robot>"
path = pathlib.Path(sys.argv[1]) / "fingers.urdf"
path.write_text(text)

poses = urchin.URDF.load(str(path)).link_fk({"to_a": 0.5}, use_names=True)
found = {"urchin": [poses[link][2, 3] for link in "bc"]}
model = RobotModel.from_urdf_string(text)
configuration = model.zero_configuration()
configuration["to_a"] = 0.5
found["compas_robots"] = [model.forward_kinematics(configuration, link_name=link).point.z for link in "bc"]
robot = yourdfpy.URDF.load(str(path))
robot.update_cfg({"to_a": 0.5})
found["yourdfpy"] = [robot.get_transform(link, "base")[2, 3] for link in "bc"]
manager = UrdfTransformManager()
manager.load_urdf(text)
manager.set_joint("to_a", 0.5)
found["pytransform3d"] = [manager.get_transform(link, "base")[2, 3] for link in "bc"]
compiled = mujoco.MjModel.from_xml_path(str(path))
state = mujoco.MjData(compiled)
state.qpos[:] = 0.5, 1.6, 3.21
mujoco.mj_forward(compiled, state)
names = ("urchin", "compas_robots", "yourdfpy", "pytransform3d", "mujoco")
print({name: importlib.metadata.version(name) for name in names})
print(", ".join("{} {:g} {:g}".format(name, *values) for name, values in found.items()), end="; ")
print("ties of MuJoCo at 1.6 3.21 off by {:.0f}".format(np.abs(state.efc_pos).max()))
assert state.nefc == 2 and np.abs(state.efc_pos).max() < 1e-12
assert np.allclose(found["urchin"], [1.6, 0]) and np.allclose(found["compas_robots"], [1.6, 0]), "chains are followed"
assert np.allclose(found["yourdfpy"], [1.6, 0.01]) and np.allclose(found["pytransform3d"], 0), "it changed"
PY
