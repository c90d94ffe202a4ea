#!/usr/bin/env bash
# rigid-body-motion 0.9.3: with mode="rotation_vector", the angular velocity of a steady turn is not steady.
#
# estimate_angular_velocity and lookup_angular_velocity take the angular velocity of recorded rotations "from the
# quaternion derivative" or "from the gradient of the axis-angle representation". One would expect two estimates of one
# thing, as for rotations about one axis. The second is the rate of the rotation vector, which is no angular velocity
# once the axis changes, neither along the axes of the body nor along fixed ones, and no filter or finer sampling helps.
# There is no message. Output seen for a body that turns steadily at (0.3, 0.2, 0.9) rad/s about its own axes and begins
# turned: "by quaternions 0.300 0.200 0.900, by rotation vectors 0.268 -0.014 0.941 after 1 s and 0.182 -0.036 0.966
# after 2 s; without a turn at the start 0.300 0.200 0.900". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "rigid-body-motion==0.9.3" \
  "numpy==2.2.6" "scipy==1.17.1" xarray matplotlib
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
from rigid_body_motion import estimate_angular_velocity
from scipy.spatial.transform import Rotation

TIMES, RATE = np.arange(0, 3, 1e-3), np.array([0.3, 0.2, 0.9])


def estimates(start, mode):
    """Angular velocities after 1 s and 2 s, rad/s, of a body that turns steadily about its own axes."""
    rotations = Rotation.from_rotvec(start) * Rotation.from_rotvec(TIMES[:, None] * RATE)
    quaternions = rotations.as_quat()[:, [3, 0, 1, 2]]
    return estimate_angular_velocity(quaternions, timestamps=TIMES, mode=mode)[[1000, 2000]]


def words(values):
    return " ".join(f"{x:.3f}" for x in values)


START, NONE = [0.5, 0.1, 0.2], [0.0, 0.0, 0.0]
right, found = estimates(START, "quaternion"), estimates(START, "rotation_vector")
along_fixed_axes = Rotation.from_rotvec(START).apply(RATE)
print("rigid-body-motion", importlib.metadata.version("rigid-body-motion"))
print(f"by quaternions {words(right[0])}, by rotation vectors {words(found[0])} after 1 s", end=" ")
print(f"and {words(found[1])} after 2 s;", end=" ")
print(f"without a turn at the start {words(estimates(NONE, 'rotation_vector')[0])}")
assert np.allclose(right, RATE, atol=1e-5), "the estimate by quaternions changed"
assert np.allclose(estimates(NONE, "rotation_vector"), RATE, atol=1e-5), "about one axis the estimate is another"
for axes in (RATE, along_fixed_axes):
    assert np.linalg.norm(found - axes, axis=1).min() > 0.1, "the estimate is an angular velocity now"
PY
