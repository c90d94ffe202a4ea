#!/usr/bin/env bash
# Pinocchio 4.1.0: buildModelFromMJCF ignores <option gravity>; the model always has 9.81 m/s^2 along -z.
#
# MJCF says gravity in <option>, and MuJoCo uses it. One would expect the parser to put it into model.gravity, or to
# say that it does not. It does neither: torques of rnea are those of a robot on Earth, without a message, also for a
# file that says 1.62 m/s^2 (the Moon) or none. Output seen: "MuJoCo 1.62, Pinocchio 9.81, rnea 9.81 N for 1 kg".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "mujoco==4.0.0" numpy
cat > "$folder/lift.xml" <<'XML'
<mujoco><option gravity="0 0 -1.62"/><worldbody><body name="cage"><joint name="rail" type="slide" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>
XML
"$folder/venv/bin/python" - "$folder/lift.xml" <<'PY'
import sys

import mujoco
import numpy as np
import pinocchio

path = sys.argv[1]
theirs, model = mujoco.MjModel.from_xml_path(path), pinocchio.buildModelFromMJCF(path)
force = pinocchio.rnea(model, model.createData(), np.zeros(1), np.zeros(1), np.zeros(1))[0]
print("pinocchio", pinocchio.__version__, "mujoco", mujoco.__version__)
print(f"MuJoCo {-theirs.opt.gravity[2]:g}, Pinocchio {-model.gravity.linear[2]:g}, rnea {force:g} N for 1 kg")
assert theirs.opt.gravity[2] == -1.62, "MuJoCo reads another gravity"
assert abs(force - 9.81) < 1e-12, "Pinocchio reads the gravity of the file now"
PY
