#!/usr/bin/env bash
# PlaCo 0.10.2: the torque that accelerates a body above a fixed foot is that of the foot in the air: 0.01 for 2.6 N m.
#
# torques_from_acceleration_with_fixed_frame(qdd_a, frame) is documented as the torques for an acceleration of the
# joints while the given frame is fixed. One would expect the mass that moves then to count. The mass matrix with the
# base at rest is used whatever the frame, so that a standing robot has the torques of one that hangs from its base:
# gravity goes through the fixed frame, accelerations do not. There is no message; with the base as the fixed frame they
# are right. A body of 10 kg, 0.5 m above an ankle, is upright on its foot of 0.01 kg m^2. Output seen for 1 rad/s^2:
# "foot fixed: 0.01 N m, right 2.60 N m; body fixed: 0.01 N m". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "placo==0.10.2" "pin==3.8.0" numpy
cat > "$folder/standing.urdf" <<'XML'
<robot name="standing"><link name="body"><inertial><origin xyz="0 0 0.5"/><mass value="10"/><inertia ixx="0.1" iyy="0.1"
izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="foot"><inertial><mass value="0.5"/><inertia ixx="0.01"
iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="ankle" type="revolute">
<parent link="body"/><child link="foot"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="50" velocity="2"/>
</joint></robot>
XML
"$folder/venv/bin/python" - "$folder/standing.urdf" <<'PY'
import importlib.metadata
import sys

import numpy as np
import placo


def torque(fixed, acceleration, angle=0.0):
    robot = placo.RobotWrapper(sys.argv[1], placo.Flags.ignore_collisions)
    robot.set_joint("ankle", angle)
    robot.update_kinematics()
    robot.set_T_world_frame("foot", np.eye(4))
    robot.update_kinematics()
    return robot.torques_from_acceleration_with_fixed_frame(np.array([acceleration]), fixed)[0]


right = 10 * 0.5**2 + 0.1
foot, body = torque("foot", 1.0), torque("body", 1.0)
print("placo", importlib.metadata.version("placo"))
print(f"foot fixed: {foot:.2f} N m, right {right:.2f} N m; body fixed: {body:.2f} N m")
assert abs(abs(torque("foot", 0.0, 0.3)) - 10 * 9.81 * 0.5 * np.sin(0.3)) < 1e-9, "the weight is another one"
assert abs(body - 0.01) < 1e-12, "the torque with the body fixed is another one"
assert abs(foot - 0.01) < 1e-12, "the mass above the fixed foot counts now"
PY
