#!/usr/bin/env bash
# Letters of Euler sequences: MuJoCo 4.0.0 and SciPy 1.17.1 mean the opposite by capitals, Pinocchio 4.1.0 ignores them.
#
# Both take "xyz" and "XYZ", one for turns about axes that move with the body, the other about fixed ones. In SciPy,
# capitals are the axes that move; in MuJoCo (eulerseq of MJCF, mju_euler2Quat) they are the fixed ones. So the same
# letters and angles are two rotations, and the letters must change case from one to the other. The MJCF reader of
# Pinocchio takes the axes that move for both, without a message: a body of a file with eulerseq="XYZ" stands askew.
# Output seen: "XYZ: MuJoCo as SciPy's xyz, Pinocchio as SciPy's XYZ". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mujoco==4.0.0" "pin==4.1.0" "scipy==1.17.1" numpy
"$folder/venv/bin/python" - "$folder" <<'PY'
import pathlib
import sys

import mujoco
import numpy as np
import pinocchio
import scipy
from scipy.spatial.transform import Rotation

ANGLES = [0.3, 0.5, 0.7]


def as_scipy(matrix, letters):
    return [case for case in (letters.lower(), letters.upper())
            if np.allclose(Rotation.from_euler(case, ANGLES).as_matrix(), matrix)]


print("mujoco", mujoco.__version__, "pinocchio", pinocchio.__version__, "scipy", scipy.__version__)
path, found = pathlib.Path(sys.argv[1]) / "turned.xml", {}
for letters in ("xyz", "XYZ"):
    path.write_text(
        f'<mujoco><compiler angle="radian" eulerseq="{letters}"/><worldbody><body name="b" euler="0.3 0.5 0.7">'
        '<joint axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
    )
    theirs = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(theirs)
    mujoco.mj_forward(theirs, data)
    of_mujoco = data.xmat[1].reshape(3, 3)
    of_pinocchio = pinocchio.buildModelFromMJCF(str(path)).jointPlacements[1].rotation
    found[letters] = as_scipy(of_mujoco, letters) + as_scipy(of_pinocchio, letters)
    print("{}: MuJoCo as SciPy's {}, Pinocchio as SciPy's {}".format(letters, *found[letters]))
assert found == {"xyz": ["XYZ", "XYZ"], "XYZ": ["xyz", "XYZ"]}, "the letters mean something else now"
PY
