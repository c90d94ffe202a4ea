#!/usr/bin/env bash
# toppra 0.6.10: after its end, a trajectory that stops there runs back.
#
# A controller asks for instants beyond the end: by one period, or until the arm has settled. One would expect the end to
# be held, or an error, as for a path outside of its range. Both parametrizers go on with the last deceleration: of a
# motion that ends at 2 m with at most 2 m/s^2, the arm is at 1.75 m half a second later, with 1 m/s. There is no message.
# Output seen: "ParametrizeConstAccel: 2 at the end, 1.99 after 0.1 s, 1.75 after 0.5 s, at -1 m/s". Exits with 1 if that
# is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "toppra==0.6.10" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
import toppra
import toppra.algorithm
import toppra.constraint

toppra.setup_logging("ERROR")
path = toppra.SplineInterpolator([0.0, 0.5, 1.0], [[0.0], [1.0], [2.0]])
limits = [toppra.constraint.JointVelocityConstraint([[-1, 1]]), toppra.constraint.JointAccelerationConstraint([[-2, 2]])]
print("toppra", importlib.metadata.version("toppra"))
for name in ("ParametrizeSpline", "ParametrizeConstAccel"):
    motion = toppra.algorithm.TOPPRA(limits, path, parametrizer=name).compute_trajectory()
    end, soon, later = (motion(motion.duration + wait)[0] for wait in (0.0, 0.1, 0.5))
    speed = motion(motion.duration + 0.5, 1)[0]
    print(f"{name}: {end:.4g} at the end, {soon:.4g} after 0.1 s, {later:.4g} after 0.5 s, at {speed:.4g} m/s")
    assert np.isclose(end, 2.0) and abs(motion(motion.duration, 1)[0]) < 1e-6, "it does not stop at the end"
    assert np.isclose(later, 1.75, atol=1e-3) and np.isclose(speed, -1.0, atol=1e-3), "it does not run back now"
PY
