#!/usr/bin/env bash
# MuJoCo MJX 3.17.0: springs and dampers that are not linear, and armature and damping of actuators, are left out.
#
# MuJoCo 3.17.0 reads `stiffness="3 2"` (a torque of 3 x + 2 x^2), `damping="3 2"` (3 v + 2 v |v|), and a motor with
# damping or armature. mjx.put_model refuses what MJX lacks, "... not implemented"; one would expect that here, or the
# same acceleration. MJX computes with the first number alone, and without what the motor adds. There is no message.
# Output seen, in rad/s^2: "stiffness 3 2: MuJoCo 11.956, MJX 12.429; damping 3 2: 6.692, 9.271; motor: 4.517, 14.798".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==3.17.0" "mujoco-mjx==3.17.0" numpy
JAX_PLATFORMS=cpu "$folder/venv/bin/python" -W ignore - <<'PY' 2> "$folder/messages"
import jax
import mujoco
import numpy as np
from mujoco import mjx

jax.config.update("jax_enable_x64", True)
ARM = """<mujoco><worldbody><body name="b"><joint name="j" axis="0 1 0" {}/><inertial pos="0.3 0 0" mass="2"
diaginertia="0.1 0.2 0.25"/></body></worldbody>{}</mujoco>"""


def accelerations(joint="", more=""):
    model = mujoco.MjModel.from_xml_string(ARM.format(joint, more))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = 0.3, 0.7
    mujoco.mj_forward(model, data)
    theirs = mjx.forward(mjx.put_model(model), mjx.put_data(model, data))
    return float(data.qacc[0]), float(np.asarray(theirs.qacc)[0])


print("mujoco", mujoco.__version__)
linear = accelerations('stiffness="3" damping="3"')
assert np.isclose(*linear, rtol=1e-9), "linear ones differ"
for words, arguments in (
    ("stiffness 3 2", ('stiffness="3 2"', "")),
    ("damping 3 2", ('damping="3 2"', "")),
    ("motor", ("", '<actuator><motor joint="j" damping="3" armature="0.4"/></actuator>')),
):
    found, theirs = accelerations(*arguments)
    print(f"{words}: MuJoCo {found:.3f}, MJX {theirs:.3f} rad/s^2")
    alone = accelerations(arguments[0].replace(" 2", ""))[0]
    assert np.isclose(theirs, alone, rtol=1e-9) and abs(found - theirs) > 0.1, "MJX computes with it now"
PY
grep -v "Failed to import" "$folder/messages" && { echo "there is a message now"; exit 1; }
exit 0
