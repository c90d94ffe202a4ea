#!/usr/bin/env bash
# URDF joint without <axis>: kinpy 0.6.1 and pytorch_kinematics 0.10.0 turn it about z, yourdfpy 0.0.60 and ikpy 4.2.1
# about x.
#
# The format says that the axis is x where the element is left out. One would expect all readers to agree on that, or to
# refuse such a joint. kinpy and pytorch_kinematics take z, for joints that turn and for those that slide, without a
# message: whole arms stand elsewhere. Output seen for a slide of 0.5 m: "kinpy 0 0 0.5, pytorch_kinematics 0 0 0.5,
# yourdfpy 0.5 0 0, ikpy 0.5 0 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "kinpy==0.6.1" "pytorch_kinematics==0.10.0" "yourdfpy==0.0.60" \
    "ikpy==4.2.1" numpy
"$folder/venv/bin/python" -W ignore - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import ikpy.chain
import kinpy
import numpy as np
import pytorch_kinematics
import yourdfpy

TEXT = (
    '<robot name="r"><link name="base"/><link name="l"/><joint name="j" type="prismatic"><parent link="base"/>'
    '<child link="l"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>'
)


def poses(text, value):
    path = str(pathlib.Path(sys.argv[1]) / "joint.urdf")
    pathlib.Path(path).write_text(text)
    robot = yourdfpy.URDF.load(path)
    robot.update_cfg([value])
    of_torch = pytorch_kinematics.build_chain_from_urdf(text.encode()).forward_kinematics({"j": value})["l"]
    return {
        "kinpy": kinpy.build_chain_from_urdf(text).forward_kinematics({"j": value})["l"].matrix(),
        "pytorch_kinematics": of_torch.get_matrix()[0].numpy(),
        "yourdfpy": robot.get_transform("l", "base"),
        "ikpy": ikpy.chain.Chain.from_urdf_file(path, base_elements=["base"]).forward_kinematics([0.0, value]),
    }


slides, turns = poses(TEXT, 0.5), poses(TEXT.replace("prismatic", "revolute"), 0.5)
print({name: importlib.metadata.version(name) for name in slides})
print(", ".join("{} {:g} {:g} {:g}".format(name, *np.round(pose[:3, 3], 6) + 0.0) for name, pose in slides.items()))
for name, axis in {"kinpy": 2, "pytorch_kinematics": 2, "yourdfpy": 0, "ikpy": 0}.items():
    assert np.allclose(slides[name][:3, 3], 0.5 * np.eye(3)[axis], atol=1e-6), name
    assert np.allclose(turns[name][axis, :3], np.eye(3)[axis], atol=1e-6), name
    assert np.isclose(np.trace(turns[name][:3, :3]), 1 + 2 * np.cos(0.5), atol=1e-6), name
PY
