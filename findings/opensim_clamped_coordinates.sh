#!/usr/bin/env bash
# OpenSim 4.6: a coordinate that is clamped to its range leaves it in a simulation.
#
# The element <clamped> of a coordinate says, in its own words, whether its values should be limited to the range. One
# would expect a stop at the ends of the range, as for the limits of joints in MuJoCo, or an error. A value that is set
# is moved into the range; a simulation goes through it, without a message: a pendulum that is clamped to 0.5 rad either
# way swings to -3.64 rad. A stop is a force of its own, CoordinateLimitForce. Output seen: "set to 0.9: 0.5; while it
# swings -3.64 to 0.5, range -0.5 to 0.5". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "opensim==4.6" "numpy<3"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import opensim

opensim.Logger.setLevelString("Off")
model = opensim.Model()
body = opensim.Body("body", 2.0, opensim.Vec3(0.3, 0, 0), opensim.Inertia(0.1, 0.2, 0.25))
model.addBody(body)
zero = opensim.Vec3(0)
joint = opensim.PinJoint("joint", model.getGround(), zero, zero, body, zero, zero)
coordinate = joint.updCoordinate()
coordinate.setName("angle")
coordinate.setRangeMin(-0.5)
coordinate.setRangeMax(0.5)
coordinate.set_clamped(True)
model.addJoint(joint)
state = model.initSystem()
coordinate = model.getCoordinateSet().get(0)
coordinate.setValue(state, 0.9)
start = coordinate.getValue(state)
manager = opensim.Manager(model)
manager.initialize(state)
angles = [coordinate.getValue(manager.integrate(0.05 * (count + 1))) for count in range(60)]
print("opensim", importlib.metadata.version("opensim"))
print(f"set to 0.9: {start:g}; while it swings {min(angles):.3g} to {max([start, *angles]):.3g}, range -0.5 to 0.5")
assert coordinate.getClamped(state) and start == 0.5
assert min(angles) < -1, "it stops at the end of its range now"
PY
