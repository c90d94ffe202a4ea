#!/usr/bin/env bash
# MuJoCo 4.0.0 takes a center of mass that is nearer than 1e-6 m to the origin of its body for the origin itself.
#
# body_sameframe and body_simple are then 1, and body_ipos, which still holds the offset, is not used: the weight of
# 1000 kg at 0.9e-6 m has no moment, at 1.1e-6 m it has all of it. Meshes, whose vertices are kept in single precision,
# have such offsets (2.4e-9 m in mjx/test_data/convex.xml of MuJoCo's repository): torques differ by 1e-9 of their size
# from those of the inertias that the compiled model holds. Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import mujoco

print("mujoco", mujoco.__version__)
for offset, counts in ((0.9e-6, False), (1.1e-6, True)):
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><freejoint/><inertial pos="{offset} 0 0" mass="1000" diaginertia="1 1 1"/>'
        '<geom size="1"/></body></worldbody></mujoco>'
    )
    state = mujoco.MjData(model)
    mujoco.mj_inverse(model, state)
    moment, held = state.qfrc_inverse[4], -1000 * 9.81 * offset
    print(f"offset {offset} m, body_ipos {model.body_ipos[1, 0]}, sameframe {model.body_sameframe[1]}: "
          f"moment {moment:.6g} of {held:.6g} N m")
    assert model.body_ipos[1, 0] == offset
    assert abs(moment - (held if counts else 0.0)) < 1e-6, "the center of mass counts otherwise now"
PY
