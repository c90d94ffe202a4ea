#!/usr/bin/env bash
# MuJoCo 4.0.0: the velocity of an actuator at a ball joint is not the rate of its length.
#
# actuator_length and actuator_velocity, and the sensors actuatorpos and actuatorvel, are the coordinate of a
# transmission and its speed. One would expect the speed to be the rate of the length, as it is for hinges, slides and
# tendons, so that a servo damps what it holds. At a ball joint the length is gear times the rotation vector of the
# joint, the velocity gear times the angular velocity: the same at zero and for turns about one axis alone. The lever
# that turns force into torque is that of the velocity, so that no energy belongs to the force. There is no message.
# Output seen at a rotation vector of 1 1.5 0.5 and gear 1 0 0: "length 1, rate of the length 0.959, velocity 0.5".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import mujoco
import numpy as np

MODEL = """<mujoco><worldbody><body><joint name="{kind}" type="{kind}"/><geom size="0.1" pos="0.2 0 0"/></body>
</worldbody><actuator><motor joint="{kind}" gear="{gear} 0 0"/></actuator></mujoco>"""


def seen(kind, gear, position, velocity, step=1e-6):
    model = mujoco.MjModel.from_xml_string(MODEL.format(kind=kind, gear=gear))
    data = mujoco.MjData(model)
    lengths = []
    for time in (-step, step, 0.0):
        data.qpos[:], data.qvel[:] = position, velocity
        moved = data.qpos.copy()
        mujoco.mj_integratePos(model, moved, data.qvel, time)
        data.qpos[:] = moved
        mujoco.mj_forward(model, data)
        lengths.append(float(data.actuator_length[0]))
    return lengths[2], (lengths[1] - lengths[0]) / (2 * step), float(data.actuator_velocity[0])


print("mujoco", mujoco.__version__)
_, rate, speed = seen("hinge", 2, [0.7], [0.3])
assert abs(rate - speed) < 1e-6
vector = np.array([1.0, 1.5, 0.5])
angle = np.linalg.norm(vector)
quaternion = [np.cos(angle / 2), *(np.sin(angle / 2) * vector / angle)]
length, rate, speed = seen("ball", 1, quaternion, [0.5, -0.8, 0.6])
print(f"length {length:.3g}, rate of the length {rate:.3g}, velocity {speed:.3g}")
assert abs(length - 1) < 1e-9 and abs(speed - 0.5) < 1e-12
assert abs(rate - speed) > 0.1, "the velocity is the rate of the length now"
PY
