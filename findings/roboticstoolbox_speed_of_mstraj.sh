#!/usr/bin/env bash
# roboticstoolbox-python 1.5.0: mstraj with a maximum speed of 1 m/s returns a motion that reaches 1.44 m/s.
#
# mstraj joins via points by straight pieces with blends of a given time, and "qdmax: maximum speed" is an alternative
# to the times of the pieces. One would expect no axis to be faster than that. Time for the blends is added as if the
# motion lost nothing in them; where it starts and stops it has to make up for it, by more the shorter the blends are
# beside the piece: 1.31 m/s with blends of 0.3 s, 1.44 m/s with 0.1 s, on a way of 1 m without any via point. The
# velocities that it returns say so; there is no message. With tacc=0 it is 1 m/s. Output seen: "tacc 0.3: 1.31 m/s, 0.1:
# 1.44 m/s; 0: 1 m/s". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "roboticstoolbox-python==1.5.0" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
import roboticstoolbox

print("roboticstoolbox-python", importlib.metadata.version("roboticstoolbox-python"))
speeds = {}
for blend in (0.3, 0.1, 0.0):
    motion = roboticstoolbox.mstraj(np.array([[0.0], [1.0]]), dt=0.001, tacc=blend, qdmax=[1.0])
    speeds[blend] = np.abs(motion.qd).max()
    by_positions = np.abs(np.diff(motion.q[:, 0])).max() / 0.001
    print(f"tacc {blend:g}: {speeds[blend]:.3g} m/s, by its positions {by_positions:.3g} m/s")
    assert abs(by_positions - speeds[blend]) < 0.01
assert speeds[0.3] > 1.3 and speeds[0.1] > 1.4, "it keeps the maximum speed now"
assert abs(speeds[0.0] - 1) < 1e-9
PY
