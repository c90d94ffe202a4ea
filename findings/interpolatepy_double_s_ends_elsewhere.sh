#!/usr/bin/env bash
# InterpolatePy 3.3.2: a DoubleSTrajectory can end elsewhere, or not move at all, where it is short beside its speeds.
#
# DoubleSTrajectory joins two positions with given speeds within limits of speed, acceleration and jerk, and refuses
# speeds beyond the limit. Of two states that are too near to each other for that without a turning point one would
# expect the motion that overshoots, as ruckig 0.19.4 finds it, or an error. From 0 m at 0.9 m/s to 0.2 m at rest, it goes
# on at 0.9 m/s to 0.4 m; from rest to 0.1 m at 0.9 m/s, it stays at 0 m. There is no message. Output seen: "to 0.2 m at
# 0 m/s: InterpolatePy 0.4 m at 0.9 m/s, ruckig 0.2 m at 0 m/s; to 0.1 m at 0.9 m/s: InterpolatePy 0 m at 0 m/s, ruckig
# 0.1 m at 0.9 m/s". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "InterpolatePy==3.3.2" "ruckig==0.19.4" numpy
"$folder/venv/bin/python" - <<'PY'
import interpolatepy
import ruckig

SPEED, ACCELERATION, JERK = 1.0, 2.0, 3.0


def end_of_double_s(position, start_speed, end_speed):
    states = interpolatepy.StateParams(0.0, position, start_speed, end_speed)
    motion = interpolatepy.DoubleSTrajectory(states, interpolatepy.TrajectoryBounds(SPEED, ACCELERATION, JERK))
    duration = motion.get_duration()
    return float(motion.evaluate(duration)), float(motion.evaluate_velocity(duration))


def end_of_ruckig(position, start_speed, end_speed):
    states = ruckig.InputParameter(1)
    states.current_position, states.target_position = [0.0], [position]
    states.current_velocity, states.target_velocity = [start_speed], [end_speed]
    states.max_velocity, states.max_acceleration, states.max_jerk = [SPEED], [ACCELERATION], [JERK]
    motion = ruckig.Trajectory(1)
    assert ruckig.Ruckig(1).calculate(states, motion) == ruckig.Result.Working
    place, speed, _ = motion.at_time(motion.duration)
    return place[0], speed[0]


print("InterpolatePy", interpolatepy.__version__, "ruckig", ruckig.__version__)
for position, start_speed, end_speed, seen in ((0.2, 0.9, 0.0, (0.4, 0.9)), (0.1, 0.0, 0.9, (0.0, 0.0))):
    found, right = (end(position, start_speed, end_speed) for end in (end_of_double_s, end_of_ruckig))
    print(f"to {position:g} m at {end_speed:g} m/s: InterpolatePy {found[0]:.3g} m at {found[1]:.3g} m/s,", end=" ")
    print(f"ruckig {right[0]:.3g} m at {abs(round(right[1], 9)):.3g} m/s")
    assert abs(right[0] - position) < 1e-9 and abs(right[1] - end_speed) < 1e-9
    assert abs(found[0] - seen[0]) < 1e-3 and abs(found[1] - seen[1]) < 1e-3, "it ends elsewhere now"
long = end_of_double_s(5.0, 0.9, 0.0)
assert abs(long[0] - 5) < 1e-3 and abs(long[1]) < 1e-6
PY
