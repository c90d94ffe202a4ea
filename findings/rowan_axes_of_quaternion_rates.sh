#!/usr/bin/env bash
# rowan 1.3.2 and AHRS 0.4.0: functions of one package take the angular velocity along other axes than their neighbors.
#
# rowan.calculus has derivative(q, v) and integrate(q, v, dt); the documentation of both writes v before q, an angular
# velocity along fixed axes. One would expect a short step of integrate to be the derivative times the step. derivative
# multiplies in the other order, by axes that turn with the body: for a body on its side they turn about two
# perpendicular axes. In AHRS, Quaternion.ode(w) is along fixed axes, while angular_velocities and AngularRate are along
# those of the body, as a gyroscope. None says which; at the identity, and about the axis of the rotation, all are the
# same. Output seen for v = 0 0 1 and a body turned by 90 degrees about x: "rowan: derivative about 0 -1 0, rowan:
# integrate about 0 0 1, AHRS: ode about 0 0 1, AHRS: AngularRate about 0 -1 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "rowan==1.3.2" "ahrs==0.4.0" numpy scipy
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import ahrs
import numpy as np
import rowan
from scipy.spatial.transform import Rotation

STEP = 1e-4
side = Rotation.from_rotvec([np.pi / 2, 0, 0])
q, v = side.as_quat(scalar_first=True), np.array([0.0, 0.0, 1.0])


def turns_about(rate):
    """Angular velocity along fixed axes: twice the product of the rate of q and the conjugate of q."""
    return 2 * (q[0] * rate[1:] - rate[0] * q[1:] - np.cross(rate[1:], q[1:]))


step = ahrs.filters.AngularRate(gyr=np.tile(v, (2, 1)), q0=q, Dt=STEP, method="closed").Q
found = {
    "rowan: derivative": rowan.calculus.derivative(q, v),
    "rowan: integrate": (rowan.calculus.integrate(q, v, STEP) - q) / STEP,
    "AHRS: ode": ahrs.Quaternion(q).ode(v),
    "AHRS: AngularRate": (step[1] - step[0]) / STEP,
}
found = {name: np.round(turns_about(rate), 3) + 0.0 for name, rate in found.items()}
print({name: importlib.metadata.version(name) for name in ("rowan", "ahrs")})
print(", ".join("{} about {:g} {:g} {:g}".format(name, *axis) for name, axis in found.items()))
turning = (Rotation.from_rotvec(STEP * v) * side, side * Rotation.from_rotvec(STEP * v))
fixed, body = ((turn * side.inv()).as_rotvec() / STEP for turn in turning)
for name, axis in zip(found, (body, fixed, fixed, body), strict=True):
    assert np.allclose(found[name], axis, atol=1e-3), name
twice = ahrs.QuaternionArray([rotation.as_quat(scalar_first=True) for rotation in (side, turning[0])])
assert np.allclose(side.apply(twice.angular_velocities(STEP)[0]), v, atol=1e-3), "angular_velocities changed"
PY
