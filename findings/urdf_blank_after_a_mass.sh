#!/usr/bin/env bash
# Pinocchio 4.1.0 (urdfdom 6.0.0): a blank after the number of a mass, value="2 ", takes the mass away from its link.
#
# XML makes a blank of a line break within an attribute, and blanks beside the numbers of xyz and rpy do no harm; one
# would expect the same of a mass, or that the file is refused. The parser takes blanks before a number, not after it:
# it prints "mass [2 ] is not a float", drops the <inertial>, and buildModelFromUrdf returns a model whose link has no
# mass: no torque holds it. After a moment of inertia, the link keeps its mass, and its moments are zero. MuJoCo and
# Drake read the number. Published: the hands dex2_5 of unitree_ros have a line break after the ixz of four links.
# Output seen: "'2': 2 kg, -5.886 N m; ' 2': 2 kg, -5.886 N m; '2 ': 0 kg, 0 N m; ixx '0.1 ': 2 kg, moments 0 0 0". Exits
# with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "mujoco==4.0.0" numpy
"$folder/venv/bin/python" - <<'PY'
import mujoco
import numpy as np
import pinocchio

ARM = """<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz=" 0.3 0 0 "/><mass value="{}"/>
<inertia ixx="{}" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous">
<parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""


def seen(mass, moment="0.1"):
    text = ARM.format(mass, moment)
    model = pinocchio.buildModelFromXML(text)
    inertia = model.inertias[1]
    torque = pinocchio.rnea(model, model.createData(), np.array([1.0, 0.0]), np.zeros(1), np.zeros(1))[0]
    theirs = mujoco.MjModel.from_xml_string(text).body_mass[1]
    moments = " ".join(f"{x:g}" for x in np.diag(inertia.inertia))
    print(f"mass {mass!r}, ixx {moment!r}: {inertia.mass:g} kg, moments {moments}, {torque:.4g} N m; MuJoCo {theirs:g} kg")
    assert theirs == 2.0, "MuJoCo reads another mass"
    return inertia.mass, torque, inertia.inertia.any()


print("pinocchio", pinocchio.__version__, "mujoco", mujoco.__version__)
for mass in ("2", " 2"):
    assert np.isclose(seen(mass)[1], -2 * 9.81 * 0.3), "a blank before the number is not taken now"
assert seen("2 ")[:2] == (0.0, 0.0), "a blank after the mass is taken now, or refused"
mass, _, moments = seen("2", "0.1 ")
assert mass == 2.0 and not moments, "a blank after a moment of inertia is taken now, or refused"
PY
