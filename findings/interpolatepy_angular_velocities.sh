#!/usr/bin/env bash
# InterpolatePy 3.3.2: angular velocities are along fixed axes where its documentation says those of the body, and those
# of LogQuaternionInterpolation can belong to another motion.
#
# The protocol QuaternionTrajectory says that evaluate_velocity of SquadC2, QuaternionSpline and
# ShootingQuaternionInterpolation is the angular velocity of the body, and get_physical_kinematics of the logarithmic
# interpolators the angular velocity of their motion. One would expect one set of axes, and the motion that evaluate
# returns. SquadC2 and QuaternionSpline give components along fixed axes, ShootingQuaternionInterpolation along those of
# the body. LogQuaternionInterpolation evaluates its spline in C++ and its angular velocity in Python, by another spline
# if keyframes are far apart: of one set of five, it is off by half of itself. There is no message. Output seen, parts
# of the velocity: "SquadC2 off by 6e-10 along fixed axes, 1.2 along those of the body; QuaternionSpline 2e-10, 1.1;
# ShootingQuaternionInterpolation 1.2, 1e-10; LogQuaternionInterpolation 0.48, 1.2". Exits with 1 if that is no longer
# so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "InterpolatePy==3.3.2" numpy scipy
"$folder/venv/bin/python" - <<'PY'
import interpolatepy
import numpy as np
from scipy.spatial.transform import Rotation

TIMES = [0.0, 1.0, 2.0, 3.0, 4.0]
KEYFRAMES = Rotation.random(5, random_state=1).as_quat()
STEP = 1e-5


def rotation(quaternion):
    return Rotation.from_quat([quaternion.x, quaternion.y, quaternion.z, quaternion.w])


def turning(trajectory, time):
    """Angular velocity by differences, along fixed axes and along those of the body."""
    before, after = rotation(trajectory.evaluate(time - STEP)), rotation(trajectory.evaluate(time + STEP))
    return (after * before.inv()).as_rotvec() / (2 * STEP), (before.inv() * after).as_rotvec() / (2 * STEP)


def off(kind, velocity):
    trajectory = kind(TIMES, [interpolatepy.Quaternion(q[3], *q[:3]) for q in KEYFRAMES])
    errors = []
    for time in (0.3, 1.6, 2.4):
        fixed, body = turning(trajectory, time)
        told = np.asarray(velocity(trajectory, time))
        errors.append([np.abs(told - fixed).max(), np.abs(told - body).max()] / np.linalg.norm(fixed))
    worst = np.max(errors, axis=0)
    print(f"{kind.__name__} off by {worst[0]:.2g} along fixed axes, {worst[1]:.2g} along those of the body")
    return worst


print("InterpolatePy", interpolatepy.__version__)
assert interpolatepy.HAS_CPP
sample = interpolatepy.Quaternion(0.5, 0.5, -0.5, 0.5)
assert np.allclose(sample.to_rotation_matrix(), rotation(sample).as_matrix())
for kind in (interpolatepy.SquadC2, interpolatepy.QuaternionSpline):
    along_fixed, along_body = off(kind, lambda trajectory, time: trajectory.evaluate_velocity(time))
    assert along_fixed < 1e-3 and along_body > 0.3, "it is along the axes of the body now"
along_fixed, along_body = off(
    interpolatepy.ShootingQuaternionInterpolation, lambda trajectory, time: trajectory.evaluate_velocity(time)
)
assert along_body < 1e-3 and along_fixed > 0.3
wrong = off(
    interpolatepy.LogQuaternionInterpolation, lambda trajectory, time: trajectory.get_physical_kinematics(time)[0]
)
assert min(wrong) > 0.1, "it is that of the motion now"
PY
