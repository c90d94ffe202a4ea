#!/usr/bin/env bash
# Pinocchio 4.1.0: buildModelFromMJCF drops every body and shape within a <frame>, without a message.
#
# <frame> of MJCF only moves what it holds; it is no body, and MuJoCo resolves it while it reads. One would expect a
# reader that does not know the element to refuse the file, or its contents to stay. Pinocchio leaves out the subtree: a
# robot of two arms, of which one stands in a <frame>, has one arm, and a shape in a <frame> of a body has no mass.
# (Only a world with nothing but frames is refused: "No such node (body)".) Output seen: "joints: MuJoCo 2, Pinocchio 1;
# mass: MuJoCo 7 kg, Pinocchio 2 kg". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "pin==4.1.0" "mujoco==4.0.0" numpy
cat > "$folder/arms.xml" <<'XML'
<mujoco><worldbody>
<body name="left"><joint name="left" axis="0 1 0"/><geom size="0.1" mass="2"/>
<frame pos="0.5 0 0"><geom size="0.1" mass="1"/></frame></body>
<frame pos="0 -1 0"><body name="right"><joint name="right" axis="0 1 0"/><geom size="0.1" mass="4"/></body></frame>
</worldbody></mujoco>
XML
"$folder/venv/bin/python" - "$folder/arms.xml" <<'PY'
import sys

import mujoco
import pinocchio

theirs, model = mujoco.MjModel.from_xml_path(sys.argv[1]), pinocchio.buildModelFromMJCF(sys.argv[1])
masses = theirs.body_mass.sum(), sum(inertia.mass for inertia in model.inertias)
print("pinocchio", pinocchio.__version__, "mujoco", mujoco.__version__)
print(
    f"joints: MuJoCo {theirs.njnt}, Pinocchio {model.njoints - 1}; "
    f"mass: MuJoCo {masses[0]:g} kg, Pinocchio {masses[1]:g} kg"
)
assert (theirs.njnt, round(masses[0], 9)) == (2, 7.0), "MuJoCo reads another model"
assert (model.njoints - 1, round(masses[1], 9)) == (1, 2.0), "Pinocchio reads <frame> now"
PY
