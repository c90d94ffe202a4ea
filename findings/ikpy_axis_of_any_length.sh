#!/usr/bin/env bash
# ikpy 4.2.1: a revolute joint of a URDF with axis 1 1 0 does not turn its link: it stretches it.
#
# The axis of a URDF is a direction; Pinocchio, MuJoCo, Drake and yourdfpy turn about it whatever its length. One would
# expect ikpy to do the same, or to refuse it. It puts the components into the formula for unit axes: the "rotation" is
# no rotation, what is beyond the joint grows with the angle, and inverse kinematics reaches points that the arm does
# not. There is no message. Output seen for a link of 1 m across the axis, at 1 rad: "axis 1 1 0: 1.31 m, determinant
# 2.49; normalized: 1.00 m, determinant 1.00". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "ikpy==4.2.1" numpy
"$folder/venv/bin/python" -W ignore - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import ikpy.chain
import numpy as np


def turned(axis):
    """Length of a link of 1 m along z beyond a joint at 1 rad, and the determinant of its rotation."""
    path = pathlib.Path(sys.argv[1]) / "joint.urdf"
    path.write_text(
        '<robot name="r"><link name="base"/><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        f'<parent link="base"/><child link="a"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint><joint name="f" type="fixed"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/></joint></robot>'
    )
    pose = ikpy.chain.Chain.from_urdf_file(str(path), base_elements=["base"]).forward_kinematics([0.0, 1.0, 0.0])
    return np.linalg.norm(pose[:3, 3]), np.linalg.det(pose[:3, :3])


found, unit = turned("1 1 0"), turned("0.70710678 0.70710678 0")
print("ikpy", importlib.metadata.version("ikpy"))
print("axis 1 1 0: {:.2f} m, determinant {:.2f}; normalized: {:.2f} m, determinant {:.2f}".format(*found, *unit))
assert np.allclose(unit, [1.0, 1.0], atol=1e-6)
assert found[0] > 1.1 and found[1] > 1.5, "the axis is normalized now"
PY
