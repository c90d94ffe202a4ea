#!/usr/bin/env bash
# Drake 1.51.1: `armature` of a joint of MJCF counts only where a <motor> or <position> drives the joint.
#
# In MuJoCo it is a property of the joint: its inertia counts with and without actuators. One would expect the parser to
# add it to the joint, or to warn, as it warns of stiffness, springref and frictionloss. Where an actuator is there, it
# becomes that of a rotor; without one it is left out, without a message: the same arm needs 0.08 for 0.28 N m.
# So the published humanoids of dm_control and MuJoCo, some of whose joints have no motor, differ by some percent.
# Output seen: "with a motor: MuJoCo 0.28 N m, Drake 0.28 N m; without: MuJoCo 0.28 N m, Drake 0.08 N m; messages: 0". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "drake==1.51.1" "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata
import logging

import mujoco
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

ARM = """<mujoco model="arm"><option gravity="0 0 0"/><worldbody><body name="b"><joint name="j" axis="0 1 0" armature="0.5"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.1 0.2 0.25"/></body></worldbody>{}</mujoco>"""
MOTOR = '<actuator><motor name="m" joint="j"/></actuator>'
ACCELERATION = np.array([0.4])
told = []
handler = logging.Handler()
handler.emit = lambda record: told.append(record.getMessage())
logging.getLogger("drake").addHandler(handler)


def torques(text):
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qacc[:] = ACCELERATION
    mujoco.mj_inverse(model, data)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, "xml")
    plant.Finalize()
    torque = plant.CalcInverseDynamics(plant.CreateDefaultContext(), ACCELERATION, MultibodyForces(plant))
    return data.qfrc_inverse[0], torque[0]


print("drake", importlib.metadata.version("drake"), "mujoco", mujoco.__version__)
with_motor, without = torques(ARM.format(MOTOR)), torques(ARM.format(""))
for words, (theirs, found) in (("with a motor", with_motor), ("without", without)):
    print(f"{words}: MuJoCo {theirs:.4g} N m, Drake {found:.4g} N m")
print("messages:", len(told))
assert np.allclose(with_motor, 0.7 * 0.4) and np.isclose(without[0], 0.7 * 0.4), "MuJoCo or the motor count otherwise"
assert np.isclose(without[1], 0.2 * 0.4), "the armature counts without a motor now"
assert not told, "there is a message now"
PY
