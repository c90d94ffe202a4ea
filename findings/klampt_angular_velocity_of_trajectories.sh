#!/usr/bin/env bash
# Klampt 0.10.1.post1: the angular velocity of an SO3Trajectory is along neither the fixed axes nor those of the body.
#
# deriv_angvel of SO3Trajectory and deriv_screw of SE3Trajectory are the angular velocity of a motion whose rotations
# eval gives. One would expect the fixed axes, in which Klampt has all its angular velocities (its documentation says
# so of this space), or else those of the body. The rotation between two milestones is along the fixed axes, and is
# turned once more by the orientation: for a body that lies on its side and turns about the vertical, the angular
# velocity comes out horizontal, and its direction turns with the body. It is right where the orientation itself is a
# turn about the same axis, as in examples that begin at the identity. Output seen for a steady turn of 1 rad/s about z:
# "at 0 s deriv_angvel 0 -1 0, at 1 s 0.84 -0.54 0; deriv_screw 0 -1 0; by differences 0 0 1". Exits with 1 if that is
# no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "Klampt==0.10.1.post1" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
from klampt.math import so3
from klampt.model.trajectory import SE3Trajectory, SO3Trajectory

side = so3.from_axis_angle(([1, 0, 0], np.pi / 2))
times = [0.0, 1.0, 2.0]
turns = [so3.mul(so3.from_axis_angle(([0, 0, 1], t)), side) for t in times]
motion = SO3Trajectory(times, turns)
screws = SE3Trajectory(times, [(turn, [0, 0, 0]) for turn in turns])


def by_differences(t, step=1e-6):
    before, now, after = (np.array(so3.matrix(motion.eval(s))) for s in (t - step, t, t + step))
    cross = (after - before) / (2 * step) @ now.T
    return np.array([cross[2, 1], cross[0, 2], cross[1, 0]])


start, later = 1e-5, 1.0 - 1e-5
found = [motion.deriv_angvel(start), motion.deriv_angvel(later), screws.deriv_screw(start)[:3], by_differences(start)]
print("Klampt", importlib.metadata.version("Klampt"))
texts = [" ".join(f"{x:g}" for x in np.round(values, 2) + 0.0) for values in found]
print("at 0 s deriv_angvel {}, at 1 s {}; deriv_screw {}; by differences {}".format(*texts))
assert np.allclose(found[3], [0, 0, 1], atol=1e-6) and np.allclose(by_differences(later), [0, 0, 1], atol=1e-6)
assert np.allclose(found[0], [0, -1, 0], atol=1e-4) and np.allclose(found[2], [0, -1, 0], atol=1e-4), "it changed"
assert np.allclose(found[1], [np.sin(1), -np.cos(1), 0], atol=1e-4), "it changed"
upright = SO3Trajectory([0.0, 1.0], [so3.identity(), so3.from_axis_angle(([0, 0, 1], 1.0))])
assert np.allclose(upright.deriv_angvel(0.5), [0, 0, 1], atol=1e-6)
PY
