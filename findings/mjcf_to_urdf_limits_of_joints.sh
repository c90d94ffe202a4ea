#!/usr/bin/env bash
# mjcf-urdf-simple-converter 0.7.3: a wheel of MJCF becomes a URDF joint with limits from 0 to 0; `ref` is left out.
#
# A hinge of MJCF without a range turns without end; URDF has "continuous" for it. One would expect that, or a revolute
# joint with wide limits. The numbers of the range are written although they do not count: lower="0.0" upper="0.0", so
# that Pinocchio 4.1.0 has a joint that cannot move, where MuJoCo 4.0.0 reads no limit in the same file. A hinge that is
# drawn at ref="30" has its range of 0 to 90 degrees from there, -30 to 60 by the zero of URDF, which is as drawn; the
# file says 0 to 90. Each joint adds a link of 1 g. There is no message, as there is for a slide, which becomes fixed.
# Output seen: "wheel: 0 to 0 in Pinocchio, limited in MuJoCo: False; drawn at 30 degrees: 0 to 90, right -30 to 60".
# Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "mjcf-urdf-simple-converter==0.7.3" "mujoco==4.0.0" "pin==4.1.0" numpy
cat > "$folder/door.xml" <<'XML'
<mujoco><worldbody><body name="wheel"><joint name="axle" axis="0 0 1"/><geom type="cylinder" size="0.1 0.02" mass="2"/>
</body><body name="door" pos="0 1 0"><joint name="hinge" axis="0 0 1" ref="30" range="0 90"/><geom type="box"
size="0.4 0.02 1" pos="0.4 0 0" mass="20"/></body></worldbody></mujoco>
XML
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import importlib.metadata

import mjcf_urdf_simple_converter
import mujoco
import numpy as np
import pinocchio

mjcf_urdf_simple_converter.convert("door.xml", "door.urdf")
source, read = mujoco.MjModel.from_xml_path("door.xml"), mujoco.MjModel.from_xml_path("door.urdf")
model = pinocchio.buildModelFromUrdf("door.urdf")
lower, upper = np.degrees(model.lowerPositionLimit) + 0.0, np.degrees(model.upperPositionLimit)
wheel, door = (model.joints[model.getJointId(name)].idx_q for name in ("axle", "hinge"))
right = np.degrees(source.joint("hinge").range - source.qpos0[source.joint("hinge").qposadr])
print("mjcf-urdf-simple-converter", importlib.metadata.version("mjcf-urdf-simple-converter"))
print(f"wheel: {lower[wheel]:.0f} to {upper[wheel]:.0f} in Pinocchio, limited in MuJoCo:", end=" ")
print(f"{bool(read.joint('axle').limited[0])}; drawn at 30 degrees: {lower[door]:.0f} to {upper[door]:.0f},", end=" ")
print(f"right {right[0]:.0f} to {right[1]:.0f}")
assert not source.joint("axle").limited[0] and np.allclose(right, [-30.0, 60.0])
assert not read.joint("axle").limited[0], "MuJoCo has a limit of 0 to 0 now"
assert model.nq == 2 and lower[wheel] == upper[wheel] == 0.0, "the wheel can turn now"
assert np.allclose([lower[door], upper[door]], [0.0, 90.0]), "the range begins where the door is drawn now"
assert abs(sum(read.body_mass) - 22.002) < 1e-9, "no mass is added now"
PY
