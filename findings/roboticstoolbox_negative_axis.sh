#!/usr/bin/env bash
# roboticstoolbox-python 1.5.0: torques of a URDF joint with a negative axis have the other sign than its angle.
#
# A joint about -y turns by its angle about -y; fkine and jacob0 do so. One would expect the torques of gravload and rne
# to do work on the same angle. They are those of the axis +y: -5.886 N m holds a link in place of 5.886 N m, the slope
# of its potential energy and the product of weight and Jacobian. There is no message. Pinocchio, MuJoCo and Drake give
# 5.886. In an arm with axes of both signs, the products of inertia of such joints have the other sign, too. Output
# seen: "axis +y: torque -5.886, slope of the energy -5.886; axis -y: torque -5.886, slope of the energy 5.886". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "roboticstoolbox-python==1.5.0" numpy
"$folder/venv/bin/python" -W ignore - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import numpy as np
import roboticstoolbox

MASS, ARM, STEP = 2.0, 0.3, 1e-6


def seen(axis):
    path = pathlib.Path(sys.argv[1]) / "arm.urdf"
    path.write_text(
        f'<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="{ARM} 0 0"/><mass value="{MASS}"/>'
        '<inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tip"/>'
        f'<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="{axis}"/></joint>'
        f'<joint name="t" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="{ARM} 0 0"/></joint></robot>'
    )
    robot = roboticstoolbox.Robot.URDF(str(path))
    below, above = (robot.fkine([angle], end="tip").t[2] for angle in (-STEP, STEP))
    rise = (above - below) / (2 * STEP)
    assert np.isclose(robot.jacob0(np.zeros(1), end="tip")[2, 0], rise), "jacob0 is not the derivative of fkine"
    of_rne = robot.rne(np.zeros(1), np.zeros(1), np.zeros(1), gravity=[0, 0, -9.81])
    torques = [float(np.ravel(x)[0]) for x in (robot.gravload(np.zeros(1)), of_rne)]
    assert np.allclose(*torques), torques
    return torques[0], MASS * 9.81 * rise


plus, minus = seen("0 1 0"), seen("0 -1 0")
print("roboticstoolbox", importlib.metadata.version("roboticstoolbox-python"))
print("axis +y: torque {:.4g}, slope of the energy {:.4g};".format(*plus), end=" ")
print("axis -y: torque {:.4g}, slope of the energy {:.4g}".format(*minus))
assert np.allclose(plus, -MASS * 9.81 * ARM), "the positive axis changed"
assert np.allclose(minus, [-MASS * 9.81 * ARM, MASS * 9.81 * ARM]), "the signs agree now"
PY
