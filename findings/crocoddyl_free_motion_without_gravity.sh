#!/usr/bin/env bash
# crocoddyl 3.2.1 with Pinocchio 4.1.0: free forward dynamics leave out gravity.
#
# pip takes Pinocchio 4.1.0 for crocoddyl, which names no version of it. One would expect the acceleration of
# DifferentialActionModelFreeFwdDynamics to be that of pinocchio.aba, as it is with Pinocchio 4.0.0, or a refusal to
# load. A pendulum that is let go stays where it is, and its optimal controls need not carry it. There is no message.
# DifferentialActionModelContactFwdDynamics, quasiStatic, and the same class with any armature of its own count gravity.
# Output seen: "Pinocchio 4.0.0: 14.8 of 14.8 rad/s^2; 4.1.0: 0 of 14.8 rad/s^2, with an armature of 1e-12: 14.8". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for version in 4.0.0 4.1.0; do
    python3 -m venv "$folder/$version"
    "$folder/$version/bin/python" -m pip install --quiet "crocoddyl==3.2.1" "pin==$version" numpy
    "$folder/$version/bin/python" - <<'PY'
import crocoddyl
import numpy as np
import pinocchio as pin

model = pin.Model()
model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "pivot")
model.appendBodyToJoint(1, pin.Inertia(2.0, np.array([0.3, 0, 0]), np.diag([0.1, 0.2, 0.25])), pin.SE3.Identity())
angle, rest = np.array([0.3]), np.zeros(1)
right = 2 * 9.81 * 0.3 * np.cos(0.3) / (0.2 + 2 * 0.3**2)
assert np.allclose(pin.aba(model, model.createData(), angle, rest, rest), right)


def acceleration(armature=None):
    state = crocoddyl.StateMultibody(model)
    dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(
        state, crocoddyl.ActuationModelFull(state), crocoddyl.CostModelSum(state)
    )
    if armature is not None:
        dynamics.armature = np.array([armature])
    data = dynamics.createData()
    dynamics.calc(data, np.concatenate([angle, rest]), rest)
    return float(data.xout[0])


seen = acceleration(), acceleration(1e-12)
print(f"crocoddyl {crocoddyl.__version__}, Pinocchio {pin.__version__}:", end=" ")
print(f"{round(seen[0], 6):.3g} of {right:.3g} rad/s^2, with an armature of 1e-12: {seen[1]:.3g}")
assert abs(seen[1] - right) < 1e-6
if pin.__version__ == "4.0.0":
    assert abs(seen[0] - right) < 1e-6
else:
    assert abs(seen[0]) < 1e-6, "gravity counts now"
PY
done
