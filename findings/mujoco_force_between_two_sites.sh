#!/usr/bin/env bash
# MuJoCo 4.0.0: a motor between two sites, site and refsite, gives free bodies angular momentum out of nothing.
#
# An actuator with `site` and `refsite` pushes the two sites apart along an axis that turns with the second; its length
# is their distance along that axis. One would expect what a slide between two bodies does: a force and its reaction on
# one line, or a couple beside them, so that free bodies keep their angular momentum, and a velocity that is the rate of
# the length. Each force acts at its own site, the two lines are apart, and nothing carries their moment: two free
# bodies gain angular momentum from a motor between them. The velocity lacks the turning of the axis, too, so that the
# damping of a servo is that of another motion. There is no message. Output seen for 1 N along x between sites that are
# 1 m apart along y: "rate of the angular momentum -1 N m; with the body of refsite at 2 rad/s: rate of the length 2
# m/s, velocity 0 m/s". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" "numpy<3"
cd "$folder"
"$folder/venv/bin/python" - <<'PY' > "$folder/output" 2>&1 || { cat "$folder/output"; exit 1; }
import mujoco
import numpy as np

BODY = '<body pos="0 {} 0"><freejoint/><geom size="0.1" mass="1"/><site name="{}"/></body>'
ACTUATOR = '<motor site="{}" refsite="{}" gear="1 0 0 0 0 0"/>'
STEP = 1e-6


def made(actuator):
    bodies = BODY.format(0, "here") + BODY.format(1, "there")
    text = f'<option gravity="0 0 0"/><worldbody>{bodies}</worldbody><actuator>{actuator}</actuator>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{text}</mujoco>")
    return model, mujoco.MjData(model)


def rates_of_momentum(model, data):
    """Rates of the momentum and of the angular momentum about the origin, from accelerations at rest."""
    mujoco.mj_forward(model, data)
    linear, angular = np.zeros(3), np.zeros(3)
    for body in (1, 2):
        first = model.body_dofadr[body]
        force = model.body_mass[body] * data.qacc[first : first + 3]
        linear += force
        angular += np.cross(data.xipos[body], force) + model.body_inertia[body] * data.qacc[first + 3 : first + 6]
    return linear, angular


model, data = made(ACTUATOR.format("there", "here"))
data.ctrl[:] = 1.0
linear, angular = rates_of_momentum(model, data)
data.qvel[5] = 2.0
mujoco.mj_forward(model, data)
length, velocity = data.actuator_length[0], data.actuator_velocity[0]
moved = data.qpos.copy()
mujoco.mj_integratePos(model, moved, data.qvel, STEP)
data.qpos[:] = moved
mujoco.mj_forward(model, data)
rate = (data.actuator_length[0] - length) / STEP
print("mujoco", mujoco.__version__)
print(f"rate of the angular momentum {angular[2]:.3g} N m;", end=" ")
print(f"with the body of refsite at 2 rad/s: rate of the length {rate:.3g} m/s, velocity {velocity:.3g} m/s")
assert np.allclose(linear, 0), "the two forces are not opposite"
assert abs(rate - 2.0) < 1e-5, "the length is another"
assert np.allclose(angular, [0, 0, -1]), "the moment of the two forces is carried now"
assert velocity == 0, "the velocity is the rate of the length now"
PY
cat "$folder/output"
if grep -qi warning "$folder/output"; then echo "there is a message now"; exit 1; fi
