#!/usr/bin/env bash
# numpy-quaternion 2024.0.13 and quaternionic 1.0.18: the angular velocity of a steady turn is 0 where the sign of its
# quaternions changes.
#
# q and -q are one rotation, and logs and conversions from matrices change from one to the other:
# as_quat(canonical=True) of SciPy keeps the scalar part positive. One would expect angular_velocity of a set of
# quaternions, which are documented as rotations, to be that of the rotations; slerp of numpy-quaternion takes the
# nearer sign. The samples are interpolated as numbers, through the jump: of a turn of 1 rad/s the velocity at the jump
# is 0, and 1.6 rad/s beside it, small enough to pass for a motion, with errors above 1 % over six samples to either
# side. There is no message. unflip_rotors, called before, cures it. Output seen: "numpy-quaternion 0 to 1.61 rad/s,
# quaternionic 0 to 1.61 rad/s, after unflip_rotors 1 to 1". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "numpy-quaternion==2024.0.13" "quaternionic==1.0.18" \
    "scipy==1.17.1" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
import quaternion
import quaternionic
from scipy.spatial.transform import Rotation

times = np.linspace(0.0, 6.0, 601)
samples = Rotation.from_rotvec(np.outer(times, [0.0, 0.0, 1.0])).as_quat(canonical=True, scalar_first=True)
of_numpy = quaternion.angular_velocity(quaternion.as_quat_array(samples), times)[:, 2]
of_quaternionic = quaternionic.array(samples).to_angular_velocity(times)[:, 2]
cured = quaternion.angular_velocity(quaternion.unflip_rotors(quaternion.as_quat_array(samples)), times)[:, 2]
for name in ("numpy-quaternion", "quaternionic"):
    print(name, importlib.metadata.version(name), end=" ")
print()
ranges = [np.round((v.min(), v.max()), 2) + 0.0 for v in (of_numpy, of_quaternionic, cured)]
texts = ["{:g} to {:g}".format(*pair) for pair in ranges]
print("numpy-quaternion {} rad/s, quaternionic {} rad/s, after unflip_rotors {}".format(*texts))
assert np.allclose(cured, 1.0, atol=1e-6)
print("samples with an error above 1 %:", int((abs(of_numpy - 1.0) > 0.01).sum()))
for found in ranges[:2]:
    assert abs(found[0]) < 0.5 and found[1] > 1.5, "the sign does not matter now"
PY
