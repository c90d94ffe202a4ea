#!/usr/bin/env bash
# urdf-to-mjcf 0.1.1: <mimic> is reversed: the leader follows; products of inertia are dropped.
#
# <mimic joint="finger" multiplier="0.5" offset="0.1"/> of "follower" means follower = 0.5 finger + 0.1. In MJCF that is
# an equality with the follower as joint1, as MuJoCo 4.0.0 makes it of the same URDF. One would expect the converter to
# write the same. It writes the leader as joint1: finger = 0.5 follower + 0.1, so that the follower turns four times as
# far; only with the multiplier 1 and the offset 0 this is the same. Of an <inertia>, the diagonal is written alone: the
# moment about a slanted axis is another. There is no message. Output seen: "finger at 0.4: follower at 0.3 rad in
# MuJoCo, 0.6 rad after conversion; product of inertia: 0.02 and 0 kg m^2". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "urdf-to-mjcf==0.1.1" "mujoco==4.0.0" numpy
cd "$folder" && mkdir made
cat > gripper.urdf <<'XML'
<robot name="gripper">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size=".1 .1 .1"/></geometry></collision>
  </link>
  <link name="left">
    <inertial><mass value="2"/><inertia ixx=".1" iyy=".2" izz=".25" ixy=".02" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="right">
    <inertial><mass value="2"/><inertia ixx=".1" iyy=".2" izz=".25" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="finger" type="revolute">
    <parent link="base"/><child link="left"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="30" velocity="3"/>
  </joint>
  <joint name="follower" type="revolute">
    <parent link="base"/><child link="right"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="30" velocity="3"/>
    <mimic joint="finger" multiplier="0.5" offset="0.1"/>
  </joint>
</robot>
XML
"$folder/venv/bin/urdf-to-mjcf" gripper.urdf -o made/converted.xml > messages.txt 2>&1
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata
import pathlib

import mujoco
import numpy as np

JOINT, BODY = mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_BODY


def equality(model):
    """Names of the joints of the one equality, and its polynomial: the first is that of the second."""
    assert model.neq == 1
    names = [mujoco.mj_id2name(model, JOINT, int(ids[0])) for ids in (model.eq_obj1id, model.eq_obj2id)]
    return names, model.eq_data[0][:2]


def product_of_inertia(model, body="left"):
    """Product xy in the frame of the link."""
    i = mujoco.mj_name2id(model, BODY, body)
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, model.body_iquat[i])
    turn = matrix.reshape(3, 3)
    return (turn @ np.diag(model.body_inertia[i]) @ turn.T)[0, 1]


read = mujoco.MjModel.from_xml_path("gripper.urdf")
converted = mujoco.MjModel.from_xml_path("made/converted.xml")
finger = 0.4
followers = []
for model in (read, converted):
    (first, _), (offset, multiplier) = equality(model)
    followers.append(offset + multiplier * finger if first == "follower" else (finger - offset) / multiplier)
products = [product_of_inertia(read), product_of_inertia(converted)]

versions = (f"{name} {importlib.metadata.version(name)}" for name in ("urdf-to-mjcf", "mujoco"))
print(*versions, sep=", ")
print(f"finger at {finger}: follower at {followers[0]:.3g} rad in MuJoCo,", end=" ")
print(f"{followers[1]:.3g} rad after conversion;", end=" ")
print(f"product of inertia: {products[0]:.3g} and {abs(products[1]):.3g} kg m^2")
messages = pathlib.Path("messages.txt").read_text().lower()
assert not any(word in messages for word in ("mimic", "inertia", "follower")), messages
assert np.isclose(followers[0], 0.3) and np.isclose(products[0], 0.02)
assert np.isclose(followers[1], 0.6), "the follower follows"
assert abs(products[1]) < 1e-9, "products of inertia are kept"
PY
