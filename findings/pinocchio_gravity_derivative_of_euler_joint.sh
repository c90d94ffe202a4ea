#!/usr/bin/env bash
# Pinocchio 4.1.0: derivatives of torques are wrong for joints whose axes turn with their own coordinates.
#
# JointModelSphericalZYX (three Euler angles) and JointModelUniversal have axes that depend on their own positions. rnea
# is right for both. One would expect computeGeneralizedGravityDerivatives and computeRNEADerivatives to be its
# derivatives. They leave out how the axes change: even at rest, the derivative of the gravity torque, which is a matrix
# of second derivatives of the potential energy, comes out unsymmetric, without a message. A composite joint of RZ, RY
# and RX does the same; three joints RZ, RY, RX with bodies of no mass between them give the right matrix. Output seen:
# "SphericalZYX: gravity derivative off by 3.1, unsymmetric by 3.1". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import pinocchio as pin

BODY = pin.Inertia(1.0, np.array([0.3, 0.2, 0.1]), np.diag([0.1, 0.12, 0.15]))
ANGLES = (pin.JointModelRZ, pin.JointModelRY, pin.JointModelRX)


def seen(joints):
    model, number = pin.Model(), 0
    for k, joint in enumerate(joints):
        number = model.addJoint(number, joint, pin.SE3.Identity(), f"joint {k}")
    model.appendBodyToJoint(number, BODY, pin.SE3.Identity())
    data, q = model.createData(), np.array([0.3, 0.5, 0.7])[: model.nq]
    given = pin.computeGeneralizedGravityDerivatives(model, data, q).copy()

    def torque(place):
        return pin.rnea(model, data, place, np.zeros(model.nv), np.zeros(model.nv)).copy()

    steps = 1e-5 * np.eye(model.nv)
    differences = np.array([(torque(q + step) - torque(q - step)) / 2e-5 for step in steps]).T
    return abs(given - differences).max(), abs(given - given.T).max(), abs(differences - differences.T).max()


composite = pin.JointModelComposite(3)
for angle in ANGLES:
    composite.addJoint(angle())
print("pinocchio", pin.__version__)
for name, joints, right in (
    ("three joints", [angle() for angle in ANGLES], True),
    ("SphericalZYX", [pin.JointModelSphericalZYX()], False),
    ("Universal", [pin.JointModelUniversal(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))], False),
    ("composite", [composite], False),
):
    off, unsymmetric, of_differences = seen(joints)
    print(f"{name}: gravity derivative off by {round(off, 9):.2g}, unsymmetric by {round(unsymmetric, 9):.2g}")
    assert of_differences < 1e-6, "rnea is no gradient of an energy"
    assert (off < 1e-6) == right, f"{name}: the derivative changed"
PY
