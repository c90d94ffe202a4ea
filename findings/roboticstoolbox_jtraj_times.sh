#!/usr/bin/env bash
# roboticstoolbox-python 1.5.0: jtraj over the times 1 s to 2 s starts in the middle of the motion.
#
# jtraj, quintic and trapezoidal take the same arguments: start, goal, and a number of steps or a vector of times. One
# would expect all three to begin at the start at the first time. quintic and trapezoidal do; jtraj divides the times by
# the last one, so that the motion begins at t = 0, whatever the vector says: at its first row the joint stands at 0.5
# at full speed. There is no message. With a number of steps their speeds differ too: quintic has them per step, jtraj
# per motion, so that its speeds are ten times larger for the same eleven positions. Output seen: "first position: jtraj
# 0.5, quintic 0, trapezoidal 0; peak speed of 11 steps: jtraj 1.875, quintic 0.1875". Exits with 1 if that is no longer
# so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "roboticstoolbox-python==1.5.0" numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import roboticstoolbox

times = np.linspace(1.0, 2.0, 11)
first = [
    float(np.ravel(motion.q)[0])
    for motion in (
        roboticstoolbox.jtraj([0.0], [1.0], times),
        roboticstoolbox.quintic(0.0, 1.0, times),
        roboticstoolbox.trapezoidal(0.0, 1.0, times),
    )
]
of_joints, of_one = roboticstoolbox.jtraj([0.0], [1.0], 11), roboticstoolbox.quintic(0.0, 1.0, 11)
peaks = float(np.max(of_joints.qd)), float(np.max(of_one.qd))
print("roboticstoolbox", roboticstoolbox.__version__)
print("first position: jtraj {:.4g}, quintic {:.4g}, trapezoidal {:.4g};".format(*first), end=" ")
print("peak speed of 11 steps: jtraj {:.4g}, quintic {:.4g}".format(*peaks))
assert np.allclose(np.ravel(of_joints.q), np.ravel(of_one.q)), "the positions differ"
assert np.allclose(first, [0.5, 0.0, 0.0]), "jtraj begins at the first time now"
assert np.allclose(peaks, [1.875, 0.1875]), "the speeds changed"
PY
