#!/usr/bin/env bash
# MuJoCo 4.0.0: the sensor framelinacc of a body that stands still reads 9.81 m/s^2, that of a falling one 0.
#
# framelinvel is the rate of framepos. One would expect framelinacc, another sensor of the same frame in the axes of the
# world, to be the rate of framelinvel; the sensor that feels gravity is the accelerometer. It contains gravity too, as
# does mj_objectAcceleration: what it gives is the acceleration less that of free fall. Output seen: "standing: 9.81,
# falling: 0; rate of framelinvel of the falling body: -9.81". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import mujoco
import numpy as np

model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><body name="standing" pos="0 0 1"><geom size="0.1"/></body>'
    '<body name="falling" pos="0 0 9"><freejoint/><geom size="0.1"/></body></worldbody><sensor>'
    '<framelinacc objtype="body" objname="standing"/><framelinacc objtype="body" objname="falling"/>'
    '<framelinvel objtype="body" objname="falling"/></sensor></mujoco>'
)
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
mujoco.mj_forward(model, data)
standing, falling, speed = data.sensordata.reshape(3, 3)[:, 2]
rate = speed / model.opt.timestep
of_function = np.zeros(6)
mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_BODY, model.body("standing").id, of_function, 0)
print("mujoco", mujoco.__version__)
print(f"standing: {standing:g}, falling: {falling:g}; rate of framelinvel of the falling body: {rate:g}")
assert abs(rate + 9.81) < 1e-9
assert abs(of_function[5] - standing) < 1e-12
assert abs(standing - 9.81) < 1e-9 and abs(falling) < 1e-9, "framelinacc is an acceleration now"
PY
