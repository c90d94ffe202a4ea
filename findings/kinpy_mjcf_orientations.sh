#!/usr/bin/env bash
# kinpy 0.6.1: build_chain_from_mjcf ignores `euler` and `axisangle` of bodies; `pos` of a joint is where its link is.
#
# kinpy reads MJCF as it reads URDF. One would expect the poses of MuJoCo, or a refusal of what it lacks. Of the ways to
# say an orientation it knows `quat` alone: a body with euler="0 30 0" stands upright. A hinge whose `pos` is beside the
# origin of its body moves that origin to the hinge, and what is in the body with it. A slide with axis="1 1 0" travels
# 1.41 m for 1 m, and `ref` is left out. There is no message. Output seen, differences from MuJoCo 4.0.0: "quat: 0 m, 0
# deg; euler: 0 m, 30 deg; axisangle: 0 m, 30 deg; joint beside the origin: 0.25 m, 0 deg; axis 1 1 0: 0.166 m, 0 deg;
# ref: 0 m, 20 deg". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "kinpy==0.6.1" "mujoco==4.0.0" numpy
"$folder/venv/bin/python" -W ignore - <<'PY'
import importlib.metadata

import kinpy
import mujoco
import numpy as np

COORDINATE = 0.4
FILE = """<mujoco><worldbody><body name="link" pos="1 2 3" {}><joint name="joint" {}/>
<geom type="sphere" size="0.1" mass="1"/></body></worldbody></mujoco>"""


def difference(body="", joint='type="hinge" axis="0 1 0"'):
    """Distance, m, and angle, degrees, between the two poses of the link."""
    text = FILE.format(body, joint)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = COORDINATE
    mujoco.mj_forward(model, data)
    poses = kinpy.build_chain_from_mjcf(text).forward_kinematics({"joint": COORDINATE})
    theirs = poses["link_child"].matrix()  # the link behind its joint
    turn = data.body("link").xmat.reshape(3, 3).T @ theirs[:3, :3]
    angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    return np.linalg.norm(theirs[:3, 3] - data.body("link").xpos), angle


quarter = f"{np.cos(np.pi / 12)} 0 {np.sin(np.pi / 12)} 0"
print("kinpy", importlib.metadata.version("kinpy"), "mujoco", mujoco.__version__)
for name, arguments, distance, angle in (
    ("quat", {"body": f'quat="{quarter}"'}, 0.0, 0.0),
    ("euler", {"body": 'euler="0 30 0"'}, 0.0, 30.0),
    ("axisangle", {"body": 'axisangle="0 1 0 30"'}, 0.0, 30.0),
    ("joint beside the origin", {"joint": 'type="hinge" axis="0 1 0" pos="0.25 0 0"'}, 0.25, 0.0),
    ("axis 1 1 0", {"joint": 'type="slide" axis="1 1 0"'}, COORDINATE * (np.sqrt(2) - 1), 0.0),
    ("ref", {"joint": 'type="hinge" axis="0 1 0" ref="20"'}, 0.0, 20.0),
):
    found = difference(**arguments)
    print(f"{name}: {found[0]:.3g} m, {found[1]:.3g} deg")
    assert np.allclose(found, [distance, angle], atol=1e-5), f"{name} is read otherwise now"
PY
