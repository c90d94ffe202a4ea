#!/usr/bin/env bash
# MuJoCo 4.0.0: where a file has its angles in degrees, a servo of a hinge, its keyframes and equalities are in radians.
#
# Angles of MJCF are in degrees unless <compiler angle="radian"/> says otherwise. One would expect this of all angles of
# a joint, or of none. The range, ref and springref of a hinge are converted; the ctrlrange of a position servo at it,
# qpos of a keyframe, the offset of an equality of joints, and the range of a tendon that is one joint are not, since a
# number there may as well be a force or a length: range="-90 90" is a quarter turn, ctrlrange="-90 90" fourteen turns,
# either way. There is no message. inheritrange="1" takes the range of the joint. Output seen: "range -90 90: 1.571 rad,
# ctrlrange -90 90: 90 rad, inheritrange: 1.571 rad; keyframe 30: 30 rad; offset 30: 30 rad; tendon -90 90: 90 rad".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import mujoco
import numpy as np

MJCF = """<mujoco><worldbody>
<body><joint name="a" type="hinge" range="-90 90" ref="30" stiffness="1" springref="30"/><geom size=".1"/></body>
<body><joint name="b" type="hinge"/><geom size=".1"/></body>
</worldbody>
<tendon><fixed name="t" range="-90 90"><joint joint="a" coef="1"/></fixed></tendon>
<equality><joint joint1="b" joint2="a" polycoef="30 1 0 0 0"/></equality>
<actuator><position joint="a" ctrlrange="-90 90"/><position joint="a" inheritrange="1"/></actuator>
<keyframe><key qpos="30 0"/></keyframe></mujoco>"""
model = mujoco.MjModel.from_xml_string(MJCF)
joint, (servo, inherited) = model.jnt_range[0, 1], model.actuator_ctrlrange[:, 1]
key, offset, tendon = model.key_qpos[0, 0], model.eq_data[0, 0], model.tendon_range[0, 1]

print("mujoco", mujoco.__version__)
print(f"range -90 90: {joint:.4g} rad, ctrlrange -90 90: {servo:.4g} rad, inheritrange: {inherited:.4g} rad;", end=" ")
print(f"keyframe 30: {key:.4g} rad; offset 30: {offset:.4g} rad; tendon -90 90: {tendon:.4g} rad")
assert np.allclose([joint, inherited], np.pi / 2)
assert np.allclose([model.qpos0[0], model.qpos_spring[0]], np.pi / 6)
assert [servo, key, offset, tendon] == [90, 30, 30, 90], "they are converted"
PY
