#!/usr/bin/env bash
# roboticstoolbox-python 1.5.0: a URDF joint whose axis is along none of x, y, z turns about another axis.
#
# One would expect a turn about the axis of the file, or a message. The link is turned by 1 rad about that axis at
# coordinate zero, and then about its own z, whatever the axis: poses, Jacobians and torques are those of another robot.
# Axes along x, y and z are right. There is no message. Output seen: "axis 0.6 0 0.8 at 0: turned by [0.6, 0.0, 0.8]; from
# 0 to 0.5 rad: [0.0, 0.0, 0.5]". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "roboticstoolbox-python==1.5.0" numpy scipy
"$folder/venv/bin/python" -W ignore - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import numpy as np
import roboticstoolbox
from scipy.spatial.transform import Rotation


def turns(axis):
    path = pathlib.Path(sys.argv[1]) / "arm.urdf"
    path.write_text(
        '<robot name="r"><link name="base"/><link name="arm"/><joint name="j" type="revolute"><parent link="base"/>'
        f'<child link="arm"/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>'
    )
    robot = roboticstoolbox.Robot.URDF(str(path))
    start, end = (Rotation.from_matrix(robot.fkine([angle], end="arm").R) for angle in (0.0, 0.5))
    return start.as_rotvec(), (start.inv() * end).as_rotvec()


print("roboticstoolbox-python", importlib.metadata.version("roboticstoolbox-python"))
for axis in ("0 0 1", "0 1 0", "0.6 0 0.8", "0 0.6 0.8"):
    start, turn = turns(axis)
    named = [float(x) for x in axis.split()]
    print(f"axis {axis} at 0: turned by {np.round(start, 6).tolist()}; from 0 to 0.5 rad: {np.round(turn, 6).tolist()}")
    if 1.0 in named:
        assert np.allclose(start, 0) and np.allclose(turn, 0.5 * np.array(named)), "axes along x, y, z are others"
    else:
        assert np.allclose(start, named), "the pose at zero is another now"
        assert np.allclose(turn, [0, 0, 0.5]), "the axis is another now"
PY
