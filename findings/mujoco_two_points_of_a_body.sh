#!/usr/bin/env bash
# MuJoCo 4.0.0: the velocity of a body is that of its center of mass, its Jacobian that of the origin of its frame.
#
# mj_objectVelocity with mjOBJ_BODY and mj_jacBody take the same number of a body. One would expect the product of the
# Jacobian and qvel to be that velocity, as it is for a site or a geom. mjOBJ_BODY means the inertial frame, at the
# center of mass (data.xipos), and so do the sensors with objtype="body"; mj_jacBody means the frame of the body
# (data.xpos), whose velocity is mjOBJ_XBODY. The two agree only for bodies whose center of mass is at their origin.
# Output seen for one that turns about its origin: "mjOBJ_BODY 0.5, mjOBJ_XBODY 0, mj_jacBody 0, mj_jacBodyCom 0.5 m/s".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import mujoco
import numpy as np

model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><body name="arm"><joint axis="0 0 1"/><geom size="0.1" pos="0.5 0 0"/></body></worldbody>'
    '<sensor><framelinvel objtype="body" objname="arm"/></sensor></mujoco>'
)
data, arm = mujoco.MjData(model), model.body("arm").id
data.qvel[0] = 1.0
mujoco.mj_forward(model, data)
found = []
for kind in (mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_XBODY):
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, kind, arm, velocity, 0)
    found.append(velocity[4])
for function in (mujoco.mj_jacBody, mujoco.mj_jacBodyCom):
    jacobian = np.zeros((3, 1))
    function(model, data, jacobian, None, arm)
    found.append((jacobian @ data.qvel)[1])
print("mujoco", mujoco.__version__)
print("mjOBJ_BODY {:g}, mjOBJ_XBODY {:g}, mj_jacBody {:g}, mj_jacBodyCom {:g} m/s".format(*found))
assert np.allclose(data.sensordata, [0.0, 0.5, 0.0])
assert np.allclose(found, [0.5, 0.0, 0.0, 0.5]), "the functions mean other points now"
PY
