#!/usr/bin/env bash
# urchin 0.0.30: a link without <inertial> gets 1 kg and 1 kg m^2, also in the URDF that it writes.
#
# A URDF that is read and saved should describe the same robot; a link without <inertial>, as that of a sensor or a tool
# frame, has no mass in Pinocchio, Drake and iDynTree. One would expect None for it, as for a missing joint limit, and
# nothing in the file. link.inertial is a mass of 1 kg with moments of 1 kg m^2, and save() writes it: an arm of 2 kg with
# a tool frame at 0.8 m needs 13.7 N m to be held, where it needed 5.9 N m. There is no message. Output seen: "source 2
# kg, 5.89 N m; saved 3 kg, 13.7 N m". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "urchin==0.0.30" "pin==4.1.0" numpy
"$folder/venv/bin/python" - "$folder" <<'PY'
import importlib.metadata
import sys

import numpy as np
import pinocchio as pin
import urchin

source, saved = sys.argv[1] + "/source.urdf", sys.argv[1] + "/saved.urdf"
with open(source, "w") as file:
    file.write(
        '<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="0.3 0 0"/><mass value="2"/><inertia '
        'ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tool"/><joint name="j" '
        'type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" '
        'effort="99" velocity="9"/></joint><joint name="f" type="fixed"><origin xyz="0.8 0 0"/><parent link="arm"/>'
        '<child link="tool"/></joint></robot>'
    )
robot = urchin.URDF.load(source)
assert robot.link_map["tool"].inertial.mass == 1.0, "it has no mass now"
robot.save(saved)


def mass_and_torque(path):
    model = pin.buildModelFromUrdf(path)
    zero = np.zeros(1)
    return model.inertias[1].mass, abs(float(pin.rnea(model, model.createData(), zero, zero, zero)[0]))


before, after = mass_and_torque(source), mass_and_torque(saved)
print("urchin", importlib.metadata.version("urchin"))
print("source {:g} kg, {:.3g} N m; saved {:g} kg, {:.3g} N m".format(*before, *after))
assert np.allclose(before, (2, 2 * 9.81 * 0.3))
assert np.allclose(after, (3, 2 * 9.81 * 0.3 + 9.81 * 0.8)), "the mass is not written any more"
PY
