#!/usr/bin/env bash
# Pinocchio 4.1.0: buildModelFromMJCF limits a joint that has a range and limited="false".
#
# In MuJoCo `limited` decides whether the range counts; files keep a range that is switched off. One would expect a joint
# without limits. Pinocchio takes the range all the same, without a message: random configurations, samples of planners
# and solvers of inverse kinematics stay within it. Output seen: "limited false: MuJoCo False, Pinocchio -0.5 to 0.5 rad".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "mujoco==4.0.0" numpy
cat > "$folder/arm.xml" <<'XML'
<mujoco><compiler angle="radian"/><worldbody><body name="arm"><joint name="j" axis="0 1 0" range="-0.5 0.5"
limited="false"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>
XML
"$folder/venv/bin/python" - "$folder/arm.xml" <<'PY'
import sys

import mujoco
import pinocchio

path = sys.argv[1]
theirs, model = mujoco.MjModel.from_xml_path(path), pinocchio.buildModelFromMJCF(path)
limited, lower, upper = theirs.jnt_limited[0], model.lowerPositionLimit[0], model.upperPositionLimit[0]
print("pinocchio", pinocchio.__version__, "mujoco", mujoco.__version__)
print(f"limited false: MuJoCo {limited}, Pinocchio {lower:g} to {upper:g} rad")
assert limited == 0, "MuJoCo limits the joint"
assert (lower, upper) == (-0.5, 0.5), "Pinocchio does not limit the joint now"
PY
