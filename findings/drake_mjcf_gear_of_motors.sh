#!/usr/bin/env bash
# Drake 1.51.1: the `gear` of a motor of MJCF does not multiply its force; an input of 1 is 1 N m, in MuJoCo 50 N m.
#
# In MuJoCo the force at the joint is the gear times the control, and its limit the gear times that of `ctrlrange`. One
# would expect the parser to read the same motor, or to warn. Drake keeps the number as default_gear_ratio of an actuator
# whose input is the torque at the joint, and takes the range of the control for the effort limit: a policy or a
# controller made for one has 1/50 of its torque in the other. There is no message. Output seen: "gear 50, control 1:
# MuJoCo 50 N m, Drake 1 N m; ctrlrange 2: MuJoCo 100 N m, Drake 2 N m; messages: 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "drake==1.51.1" "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata
import logging

import mujoco
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

ARM = """<mujoco model="arm"><option gravity="0 0 0"/><worldbody><body name="b"><joint name="j" axis="0 1 0"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.1 0.2 0.25"/></body></worldbody>
<actuator><motor name="m" joint="j" gear="50" ctrllimited="true" ctrlrange="-2 2"/></actuator></mujoco>"""
told = []
handler = logging.Handler()
handler.emit = lambda record: told.append(record.getMessage())
logging.getLogger("drake").addHandler(handler)
model = mujoco.MjModel.from_xml_string(ARM)
data = mujoco.MjData(model)


def of_mujoco(control):
    data.ctrl[:] = control
    mujoco.mj_forward(model, data)
    return float(data.qfrc_actuator[0])


plant = MultibodyPlant(0.0)
Parser(plant).AddModelsFromString(ARM, "xml")
plant.Finalize()
context = plant.CreateDefaultContext()
plant.get_actuation_input_port().FixValue(context, [1.0])
found = float(plant.get_generalized_acceleration_output_port().Eval(context)[0]) * 0.2
motor = plant.GetJointActuatorByName("m")
print("drake", importlib.metadata.version("drake"), "mujoco", mujoco.__version__)
print(f"gear {motor.default_gear_ratio():g}, control 1: MuJoCo {of_mujoco(1.0):g} N m, Drake {found:.6g} N m")
print(f"ctrlrange 2: MuJoCo {of_mujoco(9.0):g} N m, Drake {motor.effort_limit():g} N m; messages: {len(told)}")
assert (of_mujoco(1.0), of_mujoco(9.0)) == (50.0, 100.0), "MuJoCo counts the gear otherwise"
assert abs(found - 1.0) < 1e-12 and motor.effort_limit() == 2.0, "the gear counts in Drake now"
assert not told, "there is a message now"
PY
