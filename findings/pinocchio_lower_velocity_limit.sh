#!/usr/bin/env bash
# Pinocchio 4.1.0: a joint of a URDF with velocity="2" gets a lower velocity limit of +2 rad/s, not -2.
#
# <limit velocity> of URDF is the largest speed in either direction. A model of Pinocchio has a lower and an upper
# velocity limit, as it has lower and upper effort limits. One would expect -2 and 2; effort="3" becomes -3 and 3. Both
# velocity limits are 2: the range holds a single number, and at rest the joint is outside of it. Output seen: "velocity
# 2 to 2, effort -3 to 3". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0"
"$folder/venv/bin/python" - <<'PY'
import pinocchio

model = pinocchio.buildModelFromXML(
    '<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="3" velocity="2"/></joint></robot>'
)
speed = model.lowerVelocityLimit[0], model.upperVelocityLimit[0]
effort = model.lowerEffortLimit[0], model.upperEffortLimit[0]
print("pinocchio", pinocchio.__version__)
print("velocity {:g} to {:g}, effort {:g} to {:g}".format(*speed, *effort))
assert effort == (-3.0, 3.0)
assert speed == (2.0, 2.0), "the lower velocity limit changed"
PY
