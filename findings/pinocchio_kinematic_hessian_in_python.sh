#!/usr/bin/env bash
# Pinocchio 4.1.0: getJointKinematicHessian has the right shape in Python, and its numbers in other places.
#
# It is the derivative of the Jacobian (6, nv) of a joint by the nv coordinates, an array (6, nv, nv). One would expect
# hessian[:, i, j] to be the derivative of column i by coordinate j, or of column j by coordinate i. The numbers of the
# tensor, which C++ keeps with the first index fastest, are in an array that NumPy reads with the last one fastest: every
# entry is right, in another place, for any number of joints. numpy.reshape(hessian.ravel(), hessian.shape, order="F")
# is the Hessian. Output seen for an arm of 4 joints: "LOCAL: largest error 1.09, in the order of Fortran 0". Exits with 1 if
# that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import pinocchio as pin

model = pin.Model()
for index, joint in enumerate((pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelRX(), pin.JointModelRY())):
    last = model.addJoint(index, joint, pin.SE3(np.eye(3), np.array([0.3, 0.1, 0.2])), f"joint {index}")
angles, step = np.array([0.3, 0.5, 0.7, -0.4]), 1e-6


def jacobian(q, reference):
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    return pin.getJointJacobian(model, data, last, reference)


print("pinocchio", pin.__version__)
for reference in (pin.LOCAL, pin.WORLD, pin.LOCAL_WORLD_ALIGNED):
    data = model.createData()
    pin.computeJointKinematicHessians(model, data, angles)
    hessian = pin.getJointKinematicHessian(model, data, last, reference)
    columns = [(jacobian(angles + e, reference) - jacobian(angles - e, reference)) / (2 * step) for e in step * np.eye(4)]
    right = np.stack(columns, axis=-1)
    as_read = min(np.abs(hessian - right).max(), np.abs(np.swapaxes(hessian, 1, 2) - right).max())
    reordered = np.abs(np.reshape(hessian.ravel(), hessian.shape, order="F") - right).max()
    print(f"{reference}: largest error {as_read:.3g}, in the order of Fortran {round(reordered, 6):g}")
    assert hessian.shape == right.shape == (6, 4, 4)
    assert as_read > 0.5, "the Hessian is in place now"
    assert reordered < 1e-8
PY
