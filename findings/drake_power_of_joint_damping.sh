#!/usr/bin/env bash
# Drake 1.51.1: the non-conservative power of a plant leaves out the damping of its joints and the motors.
#
# CalcNonConservativePower and its integral close the balance of kinetic and potential energy. One would expect the
# power of all that is not conservative. That of a LinearSpringDamper counts; the damping of a joint, which is what
# <dynamics damping> of URDF and `damping` of MJCF become, and the torque of an actuator do not, although both change
# the acceleration. There is no message, and the reference says nothing of it. Output seen for 3 N s/m at 2 m/s and a
# motor of 7 N: "joint damping: power 0 W, rate of the energy -12 W; motor: 0 W, 14 W; damper element: -12 W, -12 W".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "drake==1.51.1" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import LinearSpringDamper, PrismaticJoint, SpatialInertia

MASS, SPEED = 2.0, 2.0


def powers(damping=0.0, push=0.0, element=0.0):
    """Non-conservative power as told, and M v a + the rate of the potential energy, W."""
    plant = MultibodyPlant(0.0)
    cart = plant.AddRigidBody("cart", SpatialInertia.SolidSphereWithMass(MASS, 0.1))
    up = np.array([0.0, 0.0, 1.0])
    joint = plant.AddJoint(PrismaticJoint("joint", plant.world_frame(), cart.body_frame(), up, damping=damping))
    plant.AddJointActuator("motor", joint)
    if element:
        plant.AddForceElement(LinearSpringDamper(plant.world_body(), -up, cart, 0 * up, 1.0, 100.0, element))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joint.set_translation(context, 0.2)
    joint.set_translation_rate(context, SPEED)
    plant.get_actuation_input_port().FixValue(context, [push])
    acceleration = plant.EvalTimeDerivatives(context).CopyToVector()[1]
    rate = MASS * SPEED * acceleration - plant.CalcConservativePower(context)
    return plant.CalcNonConservativePower(context), rate


print("drake", importlib.metadata.version("drake"))
for name, arguments, told, right in (
    ("joint damping", {"damping": 3.0}, 0.0, -3.0 * SPEED**2),
    ("motor", {"push": 7.0}, 0.0, 7.0 * SPEED),
    ("damper element", {"element": 3.0}, -3.0 * SPEED**2, -3.0 * SPEED**2),
):
    power, rate = powers(**arguments)
    print(f"{name}: power {power:.4g} W, rate of the energy {rate:.4g} W")
    assert np.isclose(rate, right), "the accelerations are others"
    assert np.isclose(power, told), f"the power of the {name} is told now"
PY
