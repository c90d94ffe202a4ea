#!/usr/bin/env bash
# gtsam 4.3.0: a CumulativeSplineTrajectory of rotations rests elsewhere than its control points, by 105 degrees here,
# and its derivative is not an angular velocity.
#
# A cumulative B-spline on a Lie group multiplies the exponentials of its weighted increments, so that a trajectory
# whose last control points are equal comes to rest there. One would expect the same of this class, whose header cites
# such a spline. It adds all increments since the first control point in one exponential: turns about different axes,
# which do not commute, take the trajectory away from all later control points, for rotations and poses. Given a window
# of time (windowStart, windowEnd), the sum begins at another control point: the same instant has another pose. The
# derivative is that of the sum, not the angular velocity. There is no message; the documentation gives the formula of
# the sum. Output seen: "at rest 104.8 degrees from the last four control points, 0.0 with a window; derivative 0.771,
# angular velocity 0.746 rad/s". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "gtsam==4.3.0" numpy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import gtsam
import numpy as np

STEP = 1e-5


def turns(angle, at_rest):
    """Rest, turns by an angle about x, then z, then y of the body, and rest."""
    points = [gtsam.Rot3(), gtsam.Rot3()]
    for turn in (gtsam.Rot3.Rx(angle), gtsam.Rot3.Rz(angle), gtsam.Rot3.Ry(angle)):
        points.append(points[-1].compose(turn))
    return points + [points[-1]] * at_rest


def spline(points):
    trajectory = gtsam.CumulativeSplineTrajectoryRot3(1.0)
    for point in points:
        trajectory.addControlPoint(point)
    return trajectory


def angle_between(a, b):
    return np.linalg.norm(gtsam.Rot3.Logmap(a.between(b)))


points = turns(1.5, at_rest=3)
trajectory = spline(points)
late, shortly_before = trajectory.sampleTrajectory(8.0), trajectory.sampleTrajectory(7.9)
error = np.degrees(angle_between(late, points[-1]))
windowed = np.degrees(angle_between(trajectory.sampleTrajectory(8.0, 8.0, 8.0), points[-1]))
assert angle_between(late, shortly_before) < 1e-12

moving, t = spline(turns(1.0, at_rest=3)), 4.5
derivative = moving.sampleTrajectoryDerivative(t, derivative=1)
before, after = moving.sampleTrajectory(t - STEP), moving.sampleTrajectory(t + STEP)
speed = angle_between(before, after) / (2 * STEP)  # the same along the axes of the body and fixed ones
given = np.linalg.norm(derivative)

print("gtsam", importlib.metadata.version("gtsam"))
print(f"at rest {error:.1f} degrees from the last four control points, {windowed:.1f} with a window;", end=" ")
print(f"derivative {given:.3f}, angular velocity {speed:.3f} rad/s")
assert windowed < 1e-6
assert error > 90, "it rests at its last control points"
assert abs(given - speed) > 0.02, "the derivative is the angular velocity"

planar = spline([gtsam.Rot3.Rz(angle) for angle in (0.0, 0.0, 1.0, 1.5, 1.5, 1.5, 1.5)])
assert angle_between(planar.sampleTrajectory(8.0), gtsam.Rot3.Rz(1.5)) < 1e-12
PY
