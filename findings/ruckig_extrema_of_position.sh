#!/usr/bin/env bash
# ruckig 0.19.4: position_extrema of a motion that turns back is not where it turns: -0.187 m for -0.347 m.
#
# A motion of limited jerk that starts with a speed away from its target overshoots. position_extrema of the trajectory
# has its least and largest position and their instants, to check a workspace after the calculation. One would expect
# the position of the turn. Where the turn is within a phase of constant acceleration, it is a position at an end of a
# phase instead: from -1 m/s to a goal at 1 m, within 1 m/s, 2 m/s^2 and 10 m/s^3, the least position is -0.3467 m
# after 0.6 s, and position_extrema has -0.1867 m after 0.2 s, where the speed is still -0.8 m/s. With 0.5 m/s^2 it is
# -0.062 m for -1.025 m. There is no message. Output seen: "least position -0.3467 m after 0.6 s, by position_extrema
# -0.1867 m after 0.2 s, at -0.8 m/s". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "ruckig==0.19.4" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import numpy as np
import ruckig


def plan(speed, acceleration):
    task, motion = ruckig.InputParameter(1), ruckig.Trajectory(1)
    task.current_position, task.target_position, task.current_velocity = [0.0], [1.0], [speed]
    task.max_velocity, task.max_acceleration, task.max_jerk = [1.0], [acceleration], [10.0]
    ruckig.Ruckig(1).calculate(task, motion)
    return motion


print("ruckig", importlib.metadata.version("ruckig"))
for speed, limit in ((-1.0, 2.0), (-1.0, 0.5), (-0.5, 2.0)):
    motion = plan(speed, limit)
    times = np.linspace(0, motion.duration, 10001)
    positions = np.array([motion.at_time(time)[0][0] for time in times])
    least, told = positions.min(), motion.position_extrema[0]
    still = motion.at_time(told.t_min)[1][0]
    print(
        f"start at {speed} m/s, {limit} m/s^2: least position {least:.4f} m after {times[positions.argmin()]:.3g} s, "
        f"by position_extrema {told.min:.4f} m after {told.t_min:.3g} s, at {still:.3g} m/s"
    )
    # The speed falls by the jerk for limit/10 s, then at the limit: the turn is in the phase of constant acceleration.
    ramp = limit / 10.0
    after = speed + limit * ramp / 2
    turn = speed * ramp + 10.0 * ramp**3 / 6 - after**2 / (2 * limit)
    assert np.isclose(least, turn, atol=1e-6), "the motion is not that of the closed form"
    assert told.min > least + 0.02 and abs(still) > 0.2, "position_extrema is the turn now"
# Without a turn within a phase of constant acceleration it is right.
assert np.isclose(plan(0.0, 2.0).position_extrema[0].max, 1.0)
PY
