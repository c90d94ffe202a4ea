#!/usr/bin/env bash
# MuJoCo 4.0.0: the armature of a tendon along joints of different branches does not couple them.
#
# By the reference, a tendon with armature m adds the kinetic energy m v^2 / 2, v the rate of its length. Two carts of
# 1 kg on their own slides, a tendon of length x - 2 y with armature 3: the mass matrix is [[1 + 3, -6], [-6, 1 + 12]],
# and a force of 1 N on the first gives 13/16 and 6/16 m/s^2. MuJoCo has the terms of its mass matrix that a tree needs,
# and leaves out those between branches, in forward and inverse dynamics and in `mj_fullM`: 1/4 and 0 m/s^2. Where one
# joint carries the other, all terms are there. There is no message. Output seen: "two carts: 0.25 0; by the kinetic
# energy: 0.8125 0.375; one cart on the other: as by the kinetic energy". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" "numpy<3"
cd "$folder"
"$folder/venv/bin/python" - <<'PY' > "$folder/output" 2>&1 || { cat "$folder/output"; exit 1; }
import mujoco
import numpy as np

CART = '<body><joint name="{}" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{}</body>'
TENDON = '<tendon><fixed armature="3"><joint joint="x" coef="1"/><joint joint="y" coef="-2"/></fixed></tendon>'


def accelerations(bodies):
    text = f'<mujoco><option gravity="0 0 0"/><worldbody>{bodies}</worldbody>{TENDON}</mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qfrc_applied[:] = [1, 0]
    mujoco.mj_forward(model, data)
    return data.qacc.copy()


tendon = 3 * np.outer([1, -2], [1, -2])
side_by_side = accelerations(CART.format("x", "") + CART.format("y", ""))
energy = np.linalg.solve(np.eye(2) + tendon, [1, 0])
print("mujoco", mujoco.__version__)
print(f"two carts: {side_by_side[0]:g} {side_by_side[1]:g}; by the kinetic energy: {energy[0]:g} {energy[1]:g}")
stacked = accelerations(CART.format("x", CART.format("y", "")))
assert np.allclose(stacked, np.linalg.solve(np.array([[2, 1], [1, 1]]) + tendon, [1, 0])), "one cart on the other differs"
print("one cart on the other: as by the kinetic energy")
assert np.allclose(side_by_side, [0.25, 0]), "the branches are coupled now"
PY
cat "$folder/output"
if grep -qi warning "$folder/output"; then echo "there is a message now"; exit 1; fi
