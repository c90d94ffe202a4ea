#!/usr/bin/env bash
# urdf2mjcf 0.2.39: the MJCF file has another mass of the base, and no damping, friction, mimic and effort limits.
#
# MuJoCo 4.0.0 reads a URDF with all of these. One would expect a converter of the file to keep them, or to say what it
# leaves out, as it says of products of inertia. The <inertial> of the first link is dropped, so that MuJoCo makes a
# mass of its collision shape and the density of water: 1000 kg for 1 kg. Joints have no damping, no friction and no
# limit of effort, and a follower is free. There is no message of these. Output seen: "base: URDF 1 kg, MJCF 1000 kg;
# damping 0.5, 0; friction 0.2, 0; ties 1, 0; joints with a limit of effort 2, 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "urdf2mjcf==0.2.39" "mujoco==4.0.0" numpy
cat > "$folder/arm.urdf" <<'URDF'
<robot name="r"><link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="a"><inertial><origin xyz="0.3 0 0"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><origin xyz="0.2 0 0"/><mass value="1.5"/>
<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="i" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="2" effort="10" velocity="4"/><dynamics damping="0.5" friction="0.2"/></joint>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="20" velocity="1"/><mimic joint="i" multiplier="-2" offset="0.3"/></joint></robot>
URDF
"$folder/venv/bin/urdf2mjcf" "$folder/arm.urdf" --output "$folder/arm.xml" > "$folder/messages" 2>&1
"$folder/venv/bin/python" - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import mujoco

folder = pathlib.Path(sys.argv[1])
floating = mujoco.MjSpec.from_file(str(folder / "arm.urdf"))
floating.compiler.fusestatic = False
urdf, mjcf = floating.compile(), mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))


def facts(model):
    limits = model.jnt_actfrclimited.sum() + model.actuator_forcelimited.sum() + model.actuator_ctrllimited.sum()
    return model.body("base").mass[0], model.dof_damping.max(), model.dof_frictionloss.max(), model.neq, limits


theirs, ours = facts(mjcf), facts(urdf)
print("urdf2mjcf", importlib.metadata.version("urdf2mjcf"))
names = ("damping {:g}, {:g}", "friction {:g}, {:g}", "ties {}, {}", "joints with a limit of effort {}, {}")
rest = "; ".join(name.format(*pair) for name, *pair in zip(names, ours[1:], theirs[1:], strict=True))
print(f"base: URDF {ours[0]:g} kg, MJCF {theirs[0]:g} kg; {rest}")
told = (folder / "messages").read_text().lower()
assert not any(word in told for word in ("damping", "mimic", "mass", "effort")), told
assert ours == (1.0, 0.5, 0.2, 1, 2), ours
assert theirs == (1000.0, 0.0, 0.0, 0, 0), "more is converted now"
assert [mjcf.body(name).mass[0] for name in "ab"] == [2.0, 1.5]
PY
