#!/usr/bin/env bash
# DART (dartpy 6.20.0): accelerations of computeForwardDynamics depend on the time step where joints have springs or
# dampers.
#
# getAccelerations after computeForwardDynamics is the acceleration of a state. One would expect M a = forces of that
# state. Springs and dampers of joints are taken as an implicit step would, at the end of a step that nobody takes:
# (-k (x + h v - rest) - c v - m g) / (m + c h + k h^2). With the default of 1 ms a slider of 2 kg gets -23.06 for
# -23 m/s^2, with 0.1 s -20 m/s^2. getMassMatrix is m; getAugMassMatrix has the rest. The reference of the function says
# nothing of it. Output seen: "time step 0.0001: -23.0065, 0.001: -23.0643, 0.01: -23.5294, 0.1: -20, for -23 m/s^2".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "dartpy==6.20.0" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import dartpy
import numpy as np

MASS, STIFFNESS, DAMPING, REST, GRAVITY, POSITION, SPEED = 2.0, 100.0, 3.0, 0.1, 10.0, 0.3, 2.0


def acceleration(step, stiffness=STIFFNESS, damping=DAMPING):
    skeleton = dartpy.dynamics.Skeleton()
    joint, body = skeleton.createPrismaticJointAndBodyNodePair()
    body.setMass(MASS)
    joint.setAxis([0.0, 0.0, 1.0])
    joint.setSpringStiffness(0, stiffness)
    joint.setRestPosition(0, REST)
    joint.setDampingCoefficient(0, damping)
    skeleton.setGravity([0.0, 0.0, -GRAVITY])
    skeleton.setTimeStep(step)
    skeleton.setPositions([POSITION])
    skeleton.setVelocities([SPEED])
    skeleton.computeForwardDynamics()
    assert np.isclose(skeleton.getMassMatrix()[0, 0], MASS)
    return skeleton.getAccelerations()[0]


right = (-STIFFNESS * (POSITION - REST) - DAMPING * SPEED - MASS * GRAVITY) / MASS
print("dartpy", importlib.metadata.version("dartpy"))
for step in (1e-4, 1e-3, 1e-2, 1e-1):
    found = acceleration(step)
    at_the_end = -STIFFNESS * (POSITION + step * SPEED - REST) - DAMPING * SPEED - MASS * GRAVITY
    print(f"time step {step:g}: {found:.6g} for {right:g} m/s^2")
    assert np.isclose(found, at_the_end / (MASS + DAMPING * step + STIFFNESS * step**2), rtol=1e-12)
    assert abs(found - right) > 5e-3, "it is the acceleration of the state now"
    assert np.isclose(acceleration(step, 0.0, 0.0), -GRAVITY, rtol=1e-12), "it depends on the step without springs"
assert dartpy.simulation.World().getTimeStep() == 1e-3, "the default is another"
PY
