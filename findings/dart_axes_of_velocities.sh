#!/usr/bin/env bash
# DART (dartpy 6.20.0): velocities of a free joint are along the fixed axes, those of a ball joint along the axes of the
# body.
#
# The positions of BallJoint, and the first three of FreeJoint, are the same rotation vector. One would expect the
# velocities of both along the same axes, those of the body, as of the joints of Featherstone and Pinocchio. The ball
# joint has them there; the free joint has its angular and linear velocity along the axes of its parent, and so are the
# components of its forces. Both are consistent in themselves, so that no check of energy shows it. Output seen for v =
# 0.3 -0.2 0.9 at a turn of 0.5 0.7 -0.4: "fixed axes: ball 0.565 -0.718 0.324, free 0.300 -0.200 0.900; axes of the
# body: ball 0.300 -0.200 0.900, free -0.377 0.258 0.855". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "dartpy==6.20.0" numpy scipy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import dartpy
import numpy as np
from scipy.spatial.transform import Rotation

TURN, V, STEP = np.array([0.5, 0.7, -0.4]), np.array([0.3, -0.2, 0.9]), 1e-6


def seen(kind):
    """Angular velocity along fixed axes, as reported and by differences of the orientation."""
    skeleton = dartpy.dynamics.Skeleton("s")
    body = getattr(skeleton, f"create{kind}JointAndBodyNodePair")()[1]
    more = np.zeros(skeleton.getNumDofs() - 3)
    skeleton.setPositions(np.concatenate([TURN, more]))
    skeleton.setVelocities(np.concatenate([V, more]))
    before, reported = body.getWorldTransform().rotation().copy(), body.getAngularVelocity().copy()
    assert np.allclose(before, Rotation.from_rotvec(TURN).as_matrix())
    skeleton.integratePositions(STEP)
    moved = body.getWorldTransform().rotation() @ before.T
    assert np.allclose(Rotation.from_matrix(moved).as_rotvec() / STEP, reported, atol=1e-5)
    return reported, before.T @ reported


(ball, ball_body), (free, free_body) = seen("Ball"), seen("Free")
print("dartpy", importlib.metadata.version("dartpy"))
texts = ["{:.3f} {:.3f} {:.3f}".format(*values) for values in (ball, free, ball_body, free_body)]
print("fixed axes: ball {}, free {}; axes of the body: ball {}, free {}".format(*texts))
assert np.allclose(ball_body, V, atol=1e-9), "the axes of ball joints changed"
assert np.allclose(free, V, atol=1e-9), "the axes of free joints changed"
PY
