#!/usr/bin/env bash
# Exudyn 1.13.6: the sensor TorqueLocal of a hinge gives its two torques in each other's place, one with the other sign.
#
# ForceLocal of ObjectJointRevoluteZ and ObjectJointGeneric is the load that the joint carries, in the axes of its
# marker. One would expect the same of TorqueLocal. For a body at rest with the torque (1, 2, 0) N m and a hinge about z
# whose axes are those of the world, TorqueLocal is (-2, 1, 0), in both joints. With all turns of a generic joint locked
# and the torque (1, 2, 4), it is (1, -2, -4). Output seen: "force 5 6 7, torque of the hinge -2 1 0, of the joint
# without turns 1 -2 -4". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "exudyn==1.13.6" numpy
cd "$folder"
"$folder/venv/bin/python" -W ignore - <<'PY'
import exudyn as exu
import numpy as np
from exudyn.utilities import (
    MarkerBodyRigid,
    ObjectJointGeneric,
    ObjectJointRevoluteZ,
    RigidBodyInertia,
    SensorObject,
)


def seen(joint, torque):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.CreateGround()
    body = mbs.CreateRigidBody(inertia=RigidBodyInertia(1, np.diag([1.0, 2.0, 3.0])))
    markers = [mbs.AddMarker(MarkerBodyRigid(bodyNumber=number)) for number in (ground, body)]
    number = mbs.AddObject(joint(markers))
    mbs.CreateForce(bodyNumber=body, loadVector=[5.0, 6.0, 7.0])
    mbs.CreateTorque(bodyNumber=body, loadVector=torque)
    sensors = [
        mbs.AddSensor(SensorObject(objectNumber=number, outputVariableType=kind, storeInternal=True))
        for kind in (exu.OutputVariableType.ForceLocal, exu.OutputVariableType.TorqueLocal)
    ]
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = 100, 0.1
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    mbs.SolveDynamic(settings)
    return [np.round(mbs.GetSensorValues(sensor), 6) + 0.0 for sensor in sensors]


hinge = seen(lambda markers: ObjectJointRevoluteZ(markerNumbers=markers), [1.0, 2.0, 0.0])
same = seen(lambda markers: ObjectJointGeneric(markerNumbers=markers, constrainedAxes=[1] * 5 + [0]), [1.0, 2.0, 0.0])
locked = seen(lambda markers: ObjectJointGeneric(markerNumbers=markers, constrainedAxes=[1] * 6), [1.0, 2.0, 4.0])
texts = [" ".join(f"{x:g}" for x in values) for values in (hinge[0], hinge[1], locked[1])]
print("exudyn", exu.__version__)
print("force {}, torque of the hinge {}, of the joint without turns {}".format(*texts))
for force, torque in (hinge, same):
    assert np.allclose(force, [5.0, 6.0, 7.0]) and np.allclose(torque, [-2.0, 1.0, 0.0]), "the torques changed"
assert np.allclose(locked[0], [5.0, 6.0, 7.0]) and np.allclose(locked[1], [1.0, -2.0, -4.0]), "the torques changed"
PY
