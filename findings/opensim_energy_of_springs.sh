#!/usr/bin/env bash
# OpenSim 4.6: the potential energy of a BushingForce is twice that of its springs; other springs have none at all.
#
# calcPotentialEnergy of a model, and the output potential_energy of each force, are what an energy balance is made of.
# One would expect the energy whose negative derivative is the force, k x^2 / 2 of a linear spring. PointToPointSpring
# and CoordinateLimitForce have it. BushingForce has k x^2, for slides and turns; SpringGeneralizedForce, PathSpring,
# ExpressionBasedBushingForce and FunctionBasedBushingForce have 0, although all of them push. There is no message. That
# several have none is known to the project; the reference of calcPotentialEnergy does not say so. Output seen at 0.3 m:
# "PointToPointSpring: force -30 N, energy 4.5 J; BushingForce: -30 N, 9 J; the others: -30 N, 0 J". Exits with 1 if
# that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "opensim==4.6" "numpy<3"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
import opensim as osim

osim.Logger.setLevelString("Off")
STIFFNESS, AT, ZERO = 100.0, 0.3, osim.Vec3(0)


def of_bushing(kind):
    def made(ground, body):
        stiffness, none = osim.Vec3(STIFFNESS), osim.Vec3(0)
        if kind is osim.BushingForce:
            return kind("spring", ground, body, stiffness, none, none, none)
        return kind("spring", ground, ZERO, ZERO, body, ZERO, ZERO, stiffness, none, none, none)

    return made


def between_points(ground, body):
    return osim.PointToPointSpring(ground, osim.Vec3(-1, 0, 0), body, ZERO, STIFFNESS, 1.0)


def along_coordinate(ground, body):
    spring = osim.SpringGeneralizedForce("x")
    spring.setStiffness(STIFFNESS)
    spring.setRestLength(0.0)
    return spring


def along_path(ground, body):
    spring = osim.PathSpring("spring", 1.0, STIFFNESS, 0.0)
    spring.updGeometryPath().appendNewPathPoint("from", ground, osim.Vec3(-1, 0, 0))
    spring.updGeometryPath().appendNewPathPoint("to", body, ZERO)
    return spring


def seen(made):
    """Force along x, N, and potential energy, J, of a slider of 2 kg, 0.3 m from where the spring is slack."""
    model = osim.Model()
    model.setGravity(ZERO)
    ground, body = model.getGround(), osim.Body("body", 2.0, ZERO, osim.Inertia(1, 1, 1))
    model.addBody(body)
    joint = osim.SliderJoint("joint", ground, ZERO, ZERO, body, ZERO, ZERO)
    model.addJoint(joint)
    joint.updCoordinate().setName("x")
    model.addForce(made(ground, body))
    model.finalizeConnections()
    state = model.initSystem()
    coordinate = model.getCoordinateSet().get("x")
    coordinate.setValue(state, AT, False)
    model.realizeAcceleration(state)
    return 2.0 * coordinate.getAccelerationValue(state), model.calcPotentialEnergy(state)


print("opensim", importlib.metadata.version("opensim"))
right = STIFFNESS * AT**2 / 2
for name, made, energy in (
    ("PointToPointSpring", between_points, right),
    ("BushingForce", of_bushing(osim.BushingForce), 2 * right),
    ("SpringGeneralizedForce", along_coordinate, 0.0),
    ("PathSpring", along_path, 0.0),
    ("ExpressionBasedBushingForce", of_bushing(osim.ExpressionBasedBushingForce), 0.0),
    ("FunctionBasedBushingForce", of_bushing(osim.FunctionBasedBushingForce), 0.0),
):
    force, found = seen(made)
    print(f"{name}: force {force:.4g} N, energy {found:.4g} J")
    assert np.isclose(force, -STIFFNESS * AT), "the force is another"
    assert np.isclose(found, energy), f"the energy of a {name} is no longer {energy} J"
PY
