#!/usr/bin/env bash
# PyBullet 3.2.7: a body falls at most 15.2 m/s by default: the damping of 0.04 is a drag that grows with the square.
#
# linearDamping of changeDynamics is 0.04 by default. One would expect a rate of 0.04 1/s: 9.62 m/s after a second of
# free fall, in place of 9.81 m/s, and some 245 m/s in the end. The acceleration is -0.04 v (1 + |v|) instead: 8.55 m/s
# after a second, 15.2 m/s in the end, the same for every mass. Output seen: "after 1 s 8.55 m/s, after 10 s 15.17 m/s,
# without damping 9.81 m/s". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pybullet==3.2.7" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
import pybullet

pybullet.connect(pybullet.DIRECT)
pybullet.setGravity(0, 0, -9.81)
pybullet.setTimeStep(1e-3)


def falls(mass, seconds, **dynamics):
    body = pybullet.createMultiBody(mass, basePosition=[0, 0, 1000])
    pybullet.changeDynamics(body, -1, **dynamics)
    for _ in range(1000 * seconds):
        pybullet.stepSimulation()
    speed = -pybullet.getBaseVelocity(body)[0][2]
    pybullet.removeBody(body)
    return speed


found = falls(1.0, 1), falls(1.0, 10), falls(1.0, 1, linearDamping=0.0)
print("pybullet", importlib.metadata.version("pybullet"))
print("after 1 s {:.2f} m/s, after 10 s {:.2f} m/s, without damping {:.2f} m/s".format(*found))
speeds = np.zeros(10001)
for k in range(10000):
    speeds[k + 1] = speeds[k] + 1e-3 * (9.81 - 0.04 * speeds[k] * (1 + speeds[k]))
assert abs(found[2] - 9.81) < 1e-6
assert abs(falls(10.0, 1) - found[0]) < 1e-9
assert np.allclose(found[:2], speeds[[1000, 10000]], atol=1e-3), "the drag changed"
PY
