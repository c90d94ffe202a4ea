#!/usr/bin/env bash
# Pinocchio 4.1.0: a planar joint of URDF moves in the plane of x and y of its frame, whatever its <axis> says.
#
# URDF: a planar joint moves in the plane perpendicular to its axis, and the axis is x where none is given. MuJoCo 4.0.0
# does so. Pinocchio takes the axis z without a message, also where the file says y: the link leaves the plane, and
# heights and gravity torques are others. Output seen: "motion along the axis: Pinocchio 1, MuJoCo 0" for axis y, and
# the same for no axis. Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - "$folder" <<'PY'
import pathlib
import sys

import mujoco
import numpy as np
import pinocchio

BODY = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
print("pinocchio", pinocchio.__version__, "mujoco", mujoco.__version__)
for said, axis in (('<axis xyz="0 1 0"/>', [0, 1, 0]), ("", [1, 0, 0])):
    path = pathlib.Path(sys.argv[1]) / "plane.urdf"
    path.write_text(
        f'<robot name="p"><link name="base"/><link name="l">{BODY}</link><joint name="j" type="planar">'
        f'<parent link="base"/><child link="l"/>{said}</joint></robot>'
    )
    along = []
    model = pinocchio.buildModelFromUrdf(str(path))
    data, frame = model.createData(), model.getFrameId("l")
    theirs = mujoco.MjModel.from_xml_path(str(path))
    state = mujoco.MjData(theirs)
    places = ([], [])
    for k in range(2):
        step = np.zeros(3)
        step[k] = 1.0
        pinocchio.framesForwardKinematics(model, data, pinocchio.integrate(model, pinocchio.neutral(model), step))
        places[0].append(abs(float(data.oMf[frame].translation @ axis)))
        state.qpos[:] = step
        mujoco.mj_forward(theirs, state)
        places[1].append(abs(float(state.xpos[-1] @ axis)))
    ours, other = (round(max(p), 12) for p in places)
    print(f"{said or 'no axis, which is x'}: motion along the axis: Pinocchio {ours:g}, MuJoCo {other:g}")
    assert other == 0, "MuJoCo leaves the plane"
    assert ours == 1, "Pinocchio heeds the axis now"
PY
