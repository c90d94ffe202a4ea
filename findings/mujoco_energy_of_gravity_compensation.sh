#!/usr/bin/env bash
# MuJoCo 4.0.0: the potential energy of a body with gravcomp="1" is that of its weight, which does nothing to it.
#
# `gravcomp` adds a force that carries a part of the weight of a body. One would expect the potential energy, in
# data.energy and the sensor e_potential, to be that of the forces that remain, as it has springs: the reference
# recommends the sum of the energies to judge a simulation. It has all of the weight: a body of 2 kg that glides upward
# at a steady 1 m/s gains 20 W from nowhere. There is no message; the reference gives the sum of m g h without a word on
# gravcomp. Output seen: "after 1 s: 1 m higher, 1 m/s, acceleration 0; energies 0 + 1 J before, 20 + 1 J after". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import mujoco
import numpy as np

FILE = """<mujoco><option gravity="0 0 -10" timestep="0.001"><flag energy="enable"/></option><worldbody>
<body gravcomp="{}"><freejoint/><geom size="0.1" mass="2"/></body></worldbody></mujoco>"""


def moved(share):
    model = mujoco.MjModel.from_xml_string(FILE.format(share))
    data = mujoco.MjData(model)
    data.qvel[2] = 1.0
    mujoco.mj_forward(model, data)
    before = data.energy.copy()
    mujoco.mj_step(model, data, 1000)
    mujoco.mj_forward(model, data)
    return data, before, data.energy.copy()


print("mujoco", mujoco.__version__)
data, before, after = moved(1)
print(f"after 1 s: {data.qpos[2]:.4g} m higher, {data.qvel[2]:.4g} m/s, acceleration {data.qacc[2]:.4g};", end=" ")
print(f"energies {before[0]:.4g} + {before[1]:.4g} J before, {after[0]:.4g} + {after[1]:.4g} J after")
assert np.isclose(data.qpos[2], 1.0) and np.isclose(data.qvel[2], 1.0) and abs(data.qacc[2]) < 1e-12
assert np.allclose(before, [0.0, 1.0]) and np.allclose(after, [20.0, 1.0]), "the compensated weight does not count now"
data, before, after = moved(0)
assert np.isclose(after.sum(), before.sum(), atol=0.2), "a free fall does not keep its energy"
PY
