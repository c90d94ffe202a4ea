#!/usr/bin/env bash
# SAPIEN 3.0.3: every joint of a URDF has a friction of 0.05, whatever <dynamics friction> says; its damping is read.
#
# One would expect the friction of the file, and none where it says 0 or nothing. A wheel of 0.1 kg m^2 at 1 rad/s stops
# within 0.1 s, with friction 0, 0.2 or 2 in the file alike; after set_friction(0) it turns on. There is no message.
# Output seen: "friction 2 in the file: 0.05 in the joint; after 1 s: 0 rad/s; with set_friction(0): 1.0 rad/s". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "sapien==3.0.3" numpy
"$folder/venv/bin/python" -W ignore - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import sapien

WHEEL = """<robot name="r"><link name="base"/><link name="wheel"><inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1"
izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous"><parent link="base"/>
<child link="wheel"/><axis xyz="0 0 1"/><dynamics damping="{}" friction="{}"/></joint></robot>"""


def seen(damping, friction, own=None):
    path = pathlib.Path(sys.argv[1]) / "wheel.urdf"
    path.write_text(WHEEL.format(damping, friction))
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    scene.set_timestep(0.001)
    loader = scene.create_urdf_loader()
    loader.fix_root_link = True
    robot = loader.load(str(path))
    (joint,) = robot.get_active_joints()
    for link in robot.get_links():
        link.set_angular_damping(0.0)
    if own is not None:
        joint.set_friction(own)
    robot.set_qvel([1.0])
    for _ in range(1000):
        scene.step()
    return round(float(joint.friction), 6), round(float(joint.damping), 6), round(float(robot.get_qvel()[0]), 3)


print("sapien", importlib.metadata.version("sapien"))
for friction in (0, 0.2, 2):
    of_joint, _, speed = seen(0, friction)
    print(f"friction {friction} in the file: {of_joint} in the joint; after 1 s: {abs(speed):g} rad/s")
    assert of_joint == 0.05 and abs(speed) < 1e-3, "the friction of the file counts now"
print("with set_friction(0):", seen(0, 0, own=0.0)[2], "rad/s")
assert seen(0, 0, own=0.0)[2] == 1.0, "something else slows it down"
assert seen(0.5, 0)[1] == 0.5, "the damping of the file is not read"
PY
