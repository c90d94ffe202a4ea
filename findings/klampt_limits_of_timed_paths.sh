#!/usr/bin/env bash
# Klampt 0.10.1.post1: path_to_trajectory with limits of 1 m/s and 2 m/s^2 returns a motion that starts at 2 m/s.
#
# By default (velocities="auto", timing="limited") it times a path within vmax and amax, from rest to rest. One would
# expect a straight way of 2 m to take at least 2.5 s, and peaks near the limits. It takes 2 s, in pieces of 20 ms, at
# whose ends the speed is 2 m/s, at the start and at the end, too, though the points between them are those of 1 m/s at
# most. Within each piece the speed swings, with accelerations that grow as the pieces get shorter. There is no message;
# a controller that is fed by deriv gets these speeds. Output seen: "2.00 s, speed at the start 2 m/s, at most 1.99 m/s,
# acceleration up to 294 m/s^2; by points 20 ms apart at most 1.00 m/s". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "Klampt==0.10.1.post1" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import numpy as np
from klampt.model.trajectory import path_to_trajectory

motion = path_to_trajectory([[0.0], [2.0]], vmax=[1.0], amax=[2.0])
end = motion.endTime()
times = np.linspace(0, end, 20001)
places = np.array([motion.eval(t)[0] for t in times])
speeds = np.gradient(places, times)
largest = np.abs(np.gradient(speeds, times)).max()
start = motion.deriv(1e-9)[0]
points = np.diff([motion.eval(t)[0] for t in motion.times]) / np.diff(motion.times)
print("Klampt", importlib.metadata.version("Klampt"))
print(f"{end:.2f} s, speed at the start {start:.3g} m/s, at most {speeds.max():.3g} m/s, ", end="")
print(f"acceleration up to {largest:.0f} m/s^2; by points ", end="")
print(f"{1e3 * end / len(points):.0f} ms apart at most {points.max():.2f} m/s")
assert points.max() < 1.01
assert np.isclose(places[-1], 2.0) and end < 2.5
assert start > 1.5 and speeds.max() > 1.5 and largest > 100, "the limits are kept now"
PY
