#!/usr/bin/env bash
# OpenSim 4.6: the speed of a coordinate of a BallJoint or FreeJoint is not the rate of its value.
#
# A coordinate has a value and a speed; results have both as columns, /jointset/NAME/COORDINATE/value and .../speed. One
# would expect the speed to be the derivative of the value, as it is for a GimbalJoint with the same three angles. For
# BallJoint and FreeJoint the speeds of the three rotations are the components of the angular velocity along the axes of
# the parent, while the values are Euler angles x-y'-z''. getStateVariableDerivativeValue of ".../value" returns the
# speed, too, and not the rate. There is no message. Output seen: "BallJoint: speeds 0.5 0.6 0.7, derivatives of the
# values as told 0.5 0.6 0.7, rates of the values 0.232 0.78 0.56, angular velocity 0.5 0.6 0.7; GimbalJoint: rates of
# the values 0.5 0.6 0.7". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "opensim==4.6" "numpy<3"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
import opensim

opensim.Logger.setLevelString("Off")
SPEEDS, STEP = np.array([0.5, 0.6, 0.7]), 1e-4


def seen(kind):
    model = opensim.Model()
    model.setGravity(opensim.Vec3(0))
    body = opensim.Body("body", 2.0, opensim.Vec3(0), opensim.Inertia(1, 1, 1))
    model.addBody(body)
    zero = opensim.Vec3(0)
    joint = kind("joint", model.getGround(), zero, zero, body, zero, zero)
    model.addJoint(joint)
    state = model.initSystem()
    rotations = [joint.get_coordinates(index) for index in range(3)]
    for coordinate, angle, speed in zip(rotations, (0.3, 0.5, 0.7), SPEEDS):
        coordinate.setValue(state, angle, False)
        coordinate.setSpeedValue(state, float(speed))
    model.realizeAcceleration(state)
    names = [coordinate.getName() for coordinate in rotations]
    told = [model.getStateVariableDerivativeValue(state, f"/jointset/joint/{name}/value") for name in names]
    turning = body.getAngularVelocityInGround(state)
    before = np.array([coordinate.getValue(state) for coordinate in rotations])
    manager = opensim.Manager(model)
    manager.setIntegratorAccuracy(1e-12)
    state.setTime(0)
    manager.initialize(state)
    later = manager.integrate(STEP)
    rates = (np.array([coordinate.getValue(later) for coordinate in rotations]) - before) / STEP
    return np.array(told), rates, np.array([turning.get(index) for index in range(3)])


print("opensim", importlib.metadata.version("opensim"))
for kind in (opensim.BallJoint, opensim.FreeJoint, opensim.GimbalJoint):
    told, rates, turning = seen(kind)
    print(f"{kind.__name__}: derivatives of the values as told {told}, rates of the values {rates.round(3)},")
    print("   angular velocity", turning.round(3))
    assert np.allclose(told, SPEEDS), "the derivative of a value is no longer its speed"
    if kind is opensim.GimbalJoint:
        assert np.allclose(rates, SPEEDS, atol=1e-3)
    else:
        assert np.abs(rates - SPEEDS).max() > 0.1, "the speeds are the rates of the values now"
        assert np.allclose(turning, SPEEDS)
PY
