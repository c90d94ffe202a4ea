#!/usr/bin/env bash
# Pinocchio 4.1.0: model.rotorInertia and model.rotorGearRatio change no torque and no mass matrix.
#
# A model has both, and `armature` beside them. One would expect a rotor of 1e-3 kg m^2 behind a gear of 100 to add 10 kg
# m^2 to the diagonal of crba and to rnea, as drake:rotor_inertia and drake:gear_ratio do in Drake. No algorithm reads
# them: only `armature` counts, which the caller must set to rotorInertia * rotorGearRatio**2. There is no message.
# Output seen: "crba 0.2; with rotor and gear 0.2; with their armature 10.2". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" numpy
"$folder/venv/bin/python" - <<'PY'
import numpy as np
import pinocchio

model = pinocchio.Model()
joint = model.addJoint(0, pinocchio.JointModelRY(), pinocchio.SE3.Identity(), "j")
model.appendBodyToJoint(joint, pinocchio.Inertia(2.0, np.zeros(3), np.diag([0.1, 0.2, 0.25])), pinocchio.SE3.Identity())
model.gravity.linear = np.zeros(3)
still, one = np.zeros(1), np.ones(1)


def seen():
    data = model.createData()
    values = [
        pinocchio.crba(model, data, still)[0, 0],
        pinocchio.rnea(model, data, still, still, one)[0],
        1 / pinocchio.aba(model, data, still, still, one)[0],
        2 * pinocchio.computeKineticEnergy(model, data, still, one),
    ]
    assert np.allclose(values, values[0]), values
    return values[0]


plain = seen()
model.rotorInertia, model.rotorGearRatio = np.full(1, 1e-3), np.full(1, 100.0)
geared = seen()
model.armature = model.rotorInertia * model.rotorGearRatio**2
print("pinocchio", pinocchio.__version__)
print(f"crba {plain:g}; with rotor and gear {geared:g}; with their armature {seen():g}")
assert plain == geared == 0.2, "the rotor counts now"
assert np.isclose(seen(), 10.2), "the armature counts otherwise"
PY
