#!/usr/bin/env bash
# ManipulaPy 1.4.2: the mass matrix of a URDF has m d^2 of every link twice; masses behind fixed joints do not count.
#
# URDFToSerialManipulator reads a robot, and its dynamics gives mass matrix and torques. One would expect the moment
# about a joint of a link of 2 kg, 0.3 m away, I + m d^2 = 0.38 kg m^2. It is I + 2 m d^2 = 0.56; gravity is right, so a
# robot holds still and moves with other torques. A tool of 0.5 kg at a fixed joint adds nothing to either, although the
# forward kinematics ends at the tool. There is no message. Output seen: "inertia 0.56 for 0.38 kg m^2, weight 5.886 for
# 5.886 N m; with a tool: inertia 0.56 for 0.425 kg m^2, weight 5.886 for 7.357 N m". Exits with 1 if that is no longer
# so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "ManipulaPy==1.4.2" numpy
cd "$folder"
MANIPULAPY_QUIET=1 "$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata
import pathlib

import numpy as np
from ManipulaPy.urdf_processor import URDFToSerialManipulator

MASS, ARM, TOOL, AT, GRAVITY = 2.0, 0.3, 0.5, 0.3, 9.81
LINK = """<link name="{}"><inertial><origin xyz="{} 0 0" rpy="0 0 0"/><mass value="{}"/>
<inertia ixx="{m}" iyy="{m}" izz="{m}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
HINGE = """<link name="base"/><joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""
FLANGE = """<joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.3 0 0"/></joint>"""


def told(links):
    pathlib.Path("arm.urdf").write_text(f'<robot name="arm">{HINGE}{links}</robot>')
    dynamics = URDFToSerialManipulator("arm.urdf").dynamics
    return dynamics.mass_matrix(np.zeros(1)).item(), -np.asarray(dynamics.gravity_forces(np.zeros(1))).item()


arm, tool = LINK.format("arm", ARM, MASS, m=0.2), LINK.format("tool", 0, TOOL, m=0.0)
inertia, weight = 0.2 + MASS * ARM**2, MASS * ARM * GRAVITY
print("ManipulaPy", importlib.metadata.version("ManipulaPy"))
for name, links, extra in (("alone", arm, 0.0), ("with a tool", arm + FLANGE + tool, TOOL)):
    found, pull = told(links)
    right, load = inertia + extra * AT**2, weight + extra * AT * GRAVITY
    print(f"{name}: inertia {found:.4g} for {right:.4g} kg m^2, weight {pull:.4g} for {load:.4g} N m")
    assert np.isclose(found, inertia + MASS * ARM**2), "the inertia is another now"
    assert np.isclose(pull, weight), "the tool has a weight now"
PY
